"""Writers of meshes and environment maps."""
