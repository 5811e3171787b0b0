"""Entries of the terms of the training loss. A row is a batch of a few pixels, points or pairs."""

from collections.abc import Callable

import torch
from splitnerf import ops
from torch import Tensor

from stability.cases import Draw
from stability.entry import Entry, Rows

BATCH, PAIRS, POINTS = 48, 6, 24
LEVELS = [4, 20]
BY_CONDITION = "a few roundings of each term, times its condition; sums in float64"


def batches(rows: Rows, names: tuple[str, ...], call: Callable[..., tuple], outputs: tuple[str, ...]) -> Rows:
    """Calls the operator once a row."""
    n = len(rows[names[0]])
    found = [call(*(rows[name][i] for name in names)) for i in range(n)]
    return {
        name: torch.stack([f[k] for f in found])[:, None] if n else rows[names[0]].new_empty(0, 1)
        for k, name in enumerate(outputs)
    }


def draw_pixels(draw: Draw, n: int) -> Rows:
    """Colours from black to 1e6, saturated photos, opacities at and beside both ends."""
    target = draw.mixed((0.0, 254 / 255, 1.0), draw.uniform(n, BATCH, 4)).clamp(0, 1)
    return {
        "mean": draw.radiance(n, BATCH, 3, top=1e6),
        "opacity": draw.mixed((0.0, 1e-7, 1e-3, 1 - 1e-3, 1.0), draw.uniform(n, BATCH)),
        "target": target,
        "background": draw.shares(n, BATCH, 3),
        "whole": draw.chance(0.3, n, BATCH),
    }


def pixels(rows: Rows, shared: Rows) -> Rows:
    names = ("mean", "opacity", "target", "background", "whole")

    def losses(*given: Tensor, linear: bool = True) -> Tensor:
        return ops.training.pixel_losses(**dict(zip(names, given)), linear=linear)

    linear = batches(rows, names, losses, ("colour", "mask"))
    encoded = batches(rows, names, lambda *x: losses(*x, linear=False), ("colour of sRGB", "mask of sRGB"))
    return linear | encoded


def repaired_pixels(rows: Rows) -> Rows:
    tops = {"mean": 1e6, "opacity": 1, "target": 1, "background": 1}
    return rows | {name: rows[name].clamp(0, top) for name, top in tops.items()}


def draw_gradients(draw: Draw, n: int) -> Rows:
    """Gradients of length 0 to 1e6, neighbours that are the same, nearly the same, opposite and anything."""
    here = draw.vectors(n * BATCH).reshape(n, BATCH, 3)
    ordinary = draw.normal(n, BATCH, 3)
    here = torch.where(draw.chance(0.5, n, 1, 1), ordinary, here)
    near = here[:, :PAIRS] * draw.pick((1.0, 1 + 1e-6, -1.0, 3.0), n, PAIRS, 1)
    near = near + draw.pick((0.0, 1e-6, 1e-2, 1.0), n, PAIRS, 1) * draw.normal(n, PAIRS, 3)
    return {"gradients": torch.cat([here, near], 1), "weights": draw.shares(n, BATCH)}


def field_gradients(rows: Rows, shared: Rows) -> Rows:
    losses = lambda g, w: ops.training.gradient_losses(g, w, torch.arange(PAIRS))
    return batches(rows, ("gradients", "weights"), losses, ("eikonal", "smoothness"))


def draw_points(draw: Draw, n: int) -> Rows:
    """Points that coincide, touch, and lie up to 1e6 widths apart."""
    spread = draw.mixed((0.0, 1e-7, 1e-3, 1e6), draw.logarithmic(1e-3, 30, n, 1, 1))
    x: Tensor = draw.uniform(n, 1, 3, low=-1, high=1) + spread * draw.normal(n, POINTS, 3)
    return {"x": x}


def draw_texels(draw: Draw, n: int) -> Rows:
    """Log radiance beside the coarser levels: none, nearly none, ordinary, and more than any light has."""
    return {"texels": draw.pick((0.0, 1e-6, 1e-2, 1.0, 30.0), n, 1, 1) * draw.normal(n, POINTS, 3)}


ENTRIES = (
    Entry(
        "pixel_losses",
        draw=draw_pixels,
        call=pixels,
        smooth=("mean", "opacity"),
        repair=repaired_pixels,
        bound=4e-6,
        size=BATCH,
        chunk=256,
        floor=1e-12,
        gradient_floor=1e-9,
        reason=BY_CONDITION + "; of colours in [0, 1] errors below 1e-6 count as that",
    ),
    Entry(
        "gradient_losses",
        draw=draw_gradients,
        call=field_gradients,
        smooth=("gradients",),
        bound=4e-6,
        size=BATCH,
        chunk=256,
        floor=0.1,
        gradient_floor=0.1,
        repair=lambda rows: {k: x.clamp(-1e6, 1e6) if k == "gradients" else x.clamp(0, 1) for k, x in rows.items()},
        reason=BY_CONDITION + "; of distances of unit vectors and of gradients of order 1 the error is absolute",
    ),
    Entry(
        "quadratic_entropy",
        draw=draw_points,
        smooth=("x",),
        bound=2e-6,
        call=lambda rows, shared: batches(rows, ("x",), lambda x: (ops.training.quadratic_entropy(x),), ("entropy",)),
        size=POINTS,
        chunk=256,
        floor=1.0,
        gradient_floor=1e-3,
        repair=lambda rows: {"x": rows["x"].clamp(-1e6, 1e6)},
        reason="the likeness of a pair is off by 2^-22 of itself; an entropy below 1 is a logarithm close to 0",
    ),
    Entry(
        "light_prior",
        draw=draw_texels,
        smooth=("texels",),
        bound=4e-6,
        call=lambda rows, shared: batches(rows, ("texels",), lambda x: (ops.light.light_prior(x, LEVELS),), ("prior",)),
        size=POINTS,
        chunk=256,
        floor=1e-12,
        gradient_floor=1e-6,
        repair=lambda rows: {"texels": rows["texels"].clamp(-1e3, 1e3)},
        reason=BY_CONDITION,
    ),
)
