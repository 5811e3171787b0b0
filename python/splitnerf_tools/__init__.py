"""Tools around the method: capture of photos, inspection, the viewer, reports, test scenes, many runs, measurements."""
