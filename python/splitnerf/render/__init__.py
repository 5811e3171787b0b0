"""Rays, the occupancy grid and volume rendering of the fields."""
