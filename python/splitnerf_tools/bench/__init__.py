"""Benchmarks that a user can run: time against error of operators and of whole runs, and the operators' accuracy."""
