"""Refinement: fits the exported asset and the light to the photos, by the model of the path tracer."""
