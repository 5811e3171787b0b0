"""Assets under other lights: cameras, backgrounds, output files and the loop over frames."""
