"""Masks for photos that have none: what stands in the middle, told from what is around it by a radiance field of all."""
