"""The last stage of a run: the exported asset and the light are fitted to the photos through the path tracer's model."""
