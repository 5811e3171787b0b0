"""Training: from posed images to a surface, its materials and the light; `loop.train` reads top to bottom."""
