"""The embedded demo: a small scene that is built and rendered on the spot."""
