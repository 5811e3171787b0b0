"""Drawings of cameras and points as seen along an axis of the world."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from markupsafe import Markup

SIDE = 400  # of a plan, in its own units
AHEAD = 0.04  # length of the line that shows where a camera looks, in the plan's edge
SHOWN_POINTS = 4000


def plan(
    axes: tuple[int, int],
    poses: np.ndarray,
    points: np.ndarray,
    kinds: tuple[Iterable[str], Iterable[str]],
    middle: np.ndarray,
    reach: float,
) -> Markup:
    """Cameras and points as an SVG.

    Args:
        axes: The numbers of the axes that point to the right and up.
        poses: [n, 4, 4] camera-to-world, OpenGL axes.
        points: [m, 3]; of more than 4000 some are drawn.
        kinds: The CSS class of each camera, and that of each point.
        middle: [3] the point in the middle of the plan.
        reach: Half of the plan's edge, in the world's units.
    """
    place = lambda p: [SIDE / 2 * (1 + s * (p[i] - middle[i]) / reach) for i, s in zip(axes, (1, -1))]  # noqa: E731
    parts, (camera_kinds, point_kinds) = [], (list(kind) for kind in kinds)
    for index in np.random.default_rng(0).permutation(len(points))[:SHOWN_POINTS]:
        x, y = place(points[index])
        if 0 <= x <= SIDE and 0 <= y <= SIDE:
            parts.append(f'<circle class="{point_kinds[index]}" cx="{x:.1f}" cy="{y:.1f}" r="0.8"/>')
    for pose, kind in zip(poses, camera_kinds):
        tip, ahead = pose[:3, 3], -pose[:3, 2]
        (x0, y0), (x1, y1) = place(tip), place(tip + 2 * AHEAD * reach * ahead)
        parts.append(f'<circle class="{kind}" cx="{x0:.1f}" cy="{y0:.1f}" r="3"/>')
        parts.append(f'<path class="{kind}" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"/>')
    return Markup(f'<svg viewBox="0 0 {SIDE} {SIDE}" role="img" aria-label="cameras and points">{"".join(parts)}</svg>')
