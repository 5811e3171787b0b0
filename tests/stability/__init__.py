"""How far every operator in float32 is from the truth, on inputs made to break it.

``make stability`` runs it; ``tests/python/test_stability.py`` runs a hundredth of it.
"""
