"""The report's section on the light: maps in 16 bits for the page's exposure control, and pictures of all roughnesses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from splitnerf.data.environment import resize_environment
from splitnerf_tools.report.browser import as_halves, packed
from splitnerf_tools.report.pictures import WHITE_PER_MEAN, tonemapped, white_of

ROWS = 128  # of a light within the page


def embedded_light(name: str, radiance: np.ndarray) -> dict:
    """A light [h, w, 3] for the page: a picture at its own exposure, and 256 x 128 texels as packed halves."""
    radiance = np.nan_to_num(np.asarray(radiance, np.float32))
    small = resize_environment(radiance, ROWS, 2 * ROWS)
    width, height, content = as_halves(small)
    white = white_of(radiance)
    return {
        "name": name, "white": white, "picture": tonemapped(small, white), "width": width, "height": height, "packed": packed(content),
    }  # fmt: skip


def panels_section(panels: Sequence[Mapping]) -> dict | None:
    """The light as trained, by roughness, all under one exposure; see :func:`splitnerf_tools.report.write_report`."""
    if not panels:
        return None
    white = white_of(min(panels, key=lambda panel: panel["roughness"])["g"])
    columns = [
        {
            "name": f"ρ = {panel['roughness']:g}",
            "g": tonemapped(panel["g"], white),
            "g_bar": None if panel.get("g_bar") is None else tonemapped(panel["g_bar"], white),
        }
        for panel in panels
    ]
    return {"columns": columns, "note": f"White is a radiance of {white:.3g}, {WHITE_PER_MEAN} times the mean."}
