"""The page about a data set: cameras around the object, what was found, and the photos with their masks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup
from scipy import ndimage
from splitnerf.data.dataset import spread

from splitnerf_tools.inspection.checks import Inspection, horizontal_axes
from splitnerf_tools.report.drawings import line_chart, plan
from splitnerf_tools.report.embedding import photo_uri, write_html

MARGIN = 1.1  # half of a plan's edge in the distance of the farthest camera
SHOWN = 120  # photos at most of which nothing is suspected
MASK_COLOUR, HULL_COLOUR = (0.95, 0.45, 0.05), (0.15, 0.65, 1.0)


def write_page(path: Path, found: Inspection) -> None:
    """Writes a page without outside references. Raises OSError where the page cannot be written."""
    suspects: dict[int, list[str]] = {}
    for finding in found.findings:
        for index, reason in finding.suspects.items():
            suspects.setdefault(index, []).append(reason)
    first = sorted(suspects, key=lambda index: -len(suspects[index]))
    others = spread([index for index in range(len(found.views)) if index not in suspects], SHOWN)
    kinds = [
        "suspect" if index in suspects else "held-out" if view.held_out else "camera"
        for index, view in enumerate(found.views)
    ]
    write_html(
        path,
        "splitnerf_tools.inspection",
        "inspect.html.j2",
        title=found.title,
        findings=found.findings,
        plans=_plans(found, kinds),
        charts=_charts(found),
        photos=[_photo(found, index, suspects.get(index, [])) for index in [*first, *others]],
        left_out=len(found.views) - len(first) - len(others),
    )


def _plans(found: Inspection, kinds: list[str]) -> list[Markup]:
    """The cameras and the hull from above and from the side."""
    x, y = horizontal_axes(found.upward)
    turn = np.stack([x, y, found.upward])
    poses = np.stack([view.pose for view in found.views])
    poses[:, :3, :3] = turn @ poses[:, :3, :3]
    poses[:, :3, 3] = (poses[:, :3, 3] - found.fit.centre) @ turn.T
    points = (found.fit.cells - found.fit.centre) @ turn.T
    reach = MARGIN * max(np.abs(poses[:, :3, 3]).max(), found.fit.radius)
    dots = ["object"] * len(points)
    return [plan((0, up), poses, points, (kinds, dots), np.zeros(3), reach) for up in (1, 2)]


def _charts(found: Inspection) -> list[Markup]:
    charts = {
        "Masks cover (% of the photo)": [100 * view.share for view in found.views],
        "Agreement of masks and poses (intersection over union)": found.fit.agreement,
        "Brighter than photos beside it (EV)": found.brightness,
        "Clipped (% of the object)": [100 * view.clipped for view in found.views],
    }
    return [
        line_chart(title, {"the last photo": [(i, float(value)) for i, value in enumerate(values)]}, across="photo")
        for title, values in charts.items()
    ]


def _photo(found: Inspection, index: int, reasons: list[str]) -> dict:
    """A photo with the outline of its mask, and that of the hull where the two disagree."""
    view = found.views[index]
    pixels = np.where(view.known[..., None], view.colour, 0.5)
    if index in found.fit.outliers:
        pixels[_line(found.fit.outlines[index])] = HULL_COLOUR
    pixels[_line(view.mask)] = MASK_COLOUR
    return {"name": view.name, "picture": photo_uri(pixels), "reasons": reasons, "held_out": view.held_out}


def _line(mask: np.ndarray) -> np.ndarray:
    """[h, w] bool, the outermost pixels of a mask and those just outside of it."""
    return ndimage.binary_dilation(mask) & ~ndimage.binary_erosion(mask)
