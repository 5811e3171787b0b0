"""Texture coordinates."""

from __future__ import annotations

import numpy as np
import trimesh
import xatlas

from splitnerf.devices import refuse_one_processor

PADDING = 4  # texels between charts
CHARTS = 64  # no chart has more than 1 / CHARTS of the surface: its time rises with the square of its faces


def unwrap(vertices: np.ndarray, faces: np.ndarray, texture_size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cuts a mesh into charts and packs them into one square texture without overlap.

    Args:
        vertices: [n, 3] float32.
        faces: [m, 3] int32.
        texture_size: Texels along an edge of the texture, for the space between the charts.

    Returns:
        origins [k] int64, the vertex that each new one is a copy of; faces [m, 3] int32 of the new vertices; and
        uv [k, 2] float32 in [0, 1], (0, 0) the top left corner.

    Raises:
        InputError: The machine has one processor.
    """
    refuse_one_processor()
    atlas = xatlas.Atlas()
    atlas.add_mesh(vertices, faces.astype(np.uint32))
    options = xatlas.PackOptions()
    options.resolution = texture_size
    options.padding = 2 * PADDING  # the packed area is up to twice as large as requested
    options.bilinear = True
    charts = xatlas.ChartOptions()
    charts.max_chart_area = float(trimesh.Trimesh(vertices, faces, process=False).area) / CHARTS
    atlas.generate(charts, options)
    origins, new_faces, uv = atlas[0]
    texels = uv * [atlas.width, atlas.height]
    uv = texels / max(atlas.width, atlas.height)
    return origins.astype(np.int64), new_faces.astype(np.int32), uv.astype(np.float32)
