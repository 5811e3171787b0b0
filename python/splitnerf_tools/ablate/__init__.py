"""Ablation: the gain of each part of the method, by one run in which the part is removed or replaced."""
