"""Benchmarks that a user can run: what a skip is worth."""
