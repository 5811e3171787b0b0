"""Benchmarks that a user can run: what a skip is worth, and how exact the operators are."""
