"""Error metrics and the protocol that `splitnerf evaluate` follows."""
