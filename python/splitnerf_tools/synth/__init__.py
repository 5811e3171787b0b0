"""Renders data sets with full truth from an asset."""
