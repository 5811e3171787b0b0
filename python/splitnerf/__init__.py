"""SplitNeRF: a relightable asset (mesh, PBR materials, HDR environment) from posed images."""

__version__ = "0.1.0"
