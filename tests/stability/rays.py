"""Entries of the operators along rays: weights of samples, and their sums."""

from functools import partial

import torch
from splitnerf import ops
from torch import Tensor

from stability import exact
from stability.cases import Draw, unit
from stability.entry import Entry, Rows

SAMPLES = 8  # of a ray
SHADED = 5  # of these
LONG = 10_000  # samples of a long ray
STEP = 1 / 128
WIDEST = 4e6  # length of a sample over which the distance may fall by half as much
LEAST = 1e-4  # opacity
BY_DEPTH = "a rounding of s f moves a weight by s f 2^-24, which the condition holds; else a few roundings"
BY_NORMAL = "absolute: a rounding of the normal moves a depth by s step 2^-23; gradients of up to s are differences"


def offsets(n: int, samples: int) -> Tensor:
    return torch.arange(n + 1) * samples


def fields(draw: Draw, n: int, samples: int) -> Tensor:
    """[n, samples + 1] distances times sharpness at the borders of samples: surfaces, fog, steps of up to 1e6."""
    falling = draw.uniform(n, 1, low=-30, high=60) - draw.logarithmic(1e-3, 30, n, 1) * torch.arange(samples + 1)
    fog = draw.uniform(n, 1, low=0, high=20) + draw.logarithmic(1e-6, 1e-1, n, 1) * draw.normal(n, samples + 1)
    wild = draw.signs(n, samples + 1) * draw.mixed(
        (0.0, 1e-38, 1e-7, 1.0, 20.0, 88.0, 1e6), draw.logarithmic(1e-6, 1e6, n, samples + 1)
    )
    kind = draw.uniform(n, 1)
    return torch.where(kind < 0.4, falling, torch.where(kind < 0.7, fog, wild))


def between_ends(f_prev: Tensor, f_next: Tensor, step: float) -> Rows:
    """The distance in the middle, and the slope along the ray of a gradient that is 1 across it."""
    cosine = (f_next - f_prev) / step
    return {"sdf": 0.5 * (f_prev + f_next), "slope": cosine / torch.sqrt(1 - cosine**2)}


def draw_ends(draw: Draw, n: int, step: float, s: float = 1.0) -> Rows:
    values = fields(draw, n, SAMPLES).clamp(-60, 60) / s  # beyond, the ends have lost the digits of their difference
    return between_ends(values[:, :-1], values[:, 1:], step)


def draw_long(draw: Draw, n: int, step: float) -> Rows:
    """Fog of ten thousand samples, from hardly any to opaque in a few steps."""
    depth = draw.logarithmic(1e-9, 1e-2, n, 1).expand(n, LONG)
    f = draw.uniform(n, 1, low=-2, high=2) + 0 * depth
    return between_ends(f + depth * draw.uniform(n, LONG, low=0.9, high=1.1), f, step)


def along_z(rows: Rows) -> tuple[Tensor, Tensor]:
    """Gradients [n, samples, 3] and directions [n, 3] of rays along z."""
    slope = rows["slope"]
    gradient = torch.stack([torch.ones_like(slope), torch.zeros_like(slope), slope], -1)
    return gradient, torch.tensor([[0.0, 0.0, 1.0]]).to(slope).expand(len(slope), 3)


def weights(rows: Rows, shared: Rows, step: float) -> Rows:
    """The sharpness is shared by all rays of a call: that of s f is asked with s = 1, that of s beside."""
    n, samples = rows["sdf"].shape
    gradient, rays_d = along_z(rows)
    _, w, opacity = ops.surface_weights(
        rows["sdf"].flatten(), gradient.reshape(-1, 3), rays_d, shared["s"], offsets(n, samples), step=step
    )
    return {"weights": w.reshape(n, samples), "opacity": opacity[:, None]}


def draw_surface(draw: Draw, n: int) -> Rows:
    """Fields through a surface, steps across the box included, with gradients of length 0 to 1e6."""
    along = draw.uniform(n, 1, low=-0.3, high=0.6) - draw.uniform(n, 1, high=2) * STEP * torch.arange(SAMPLES)
    wild = draw.signs(n, SAMPLES) * draw.mixed((0.0, 1e-38, 1e-7, 1.0), draw.logarithmic(1e-6, 1, n, SAMPLES))
    sdf = torch.where(draw.chance(0.7, n, 1), along, wild)
    gradient = draw.vectors(n * SAMPLES).reshape(n, SAMPLES, 3)
    near = unit(draw.normal(n, SAMPLES, 3)) * draw.uniform(n, SAMPLES, 1, low=0.8, high=1.2)
    gradient = torch.where(draw.chance(0.7, n, 1, 1), near, gradient)
    return {"sdf": sdf, "gradient": gradient, "rays_d": draw.directions(n)}


def surface(rows: Rows, shared: Rows, anneal: float) -> Rows:
    n = len(rows["sdf"])
    normals, w, opacity = ops.surface_weights(
        rows["sdf"].flatten(),
        rows["gradient"].reshape(-1, 3),
        rows["rays_d"],
        shared["s"],
        offsets(n, SAMPLES),
        step=STEP,
        anneal=anneal,
    )
    return {"normals": normals.reshape(n, SAMPLES, 3), "weights": w.reshape(n, SAMPLES), "opacity": opacity[:, None]}


def repaired_surface(rows: Rows) -> Rows:
    sdf, gradient = rows["sdf"].clamp(-1, 1), rows["gradient"].clamp(-1e6, 1e6)
    return {"sdf": sdf, "gradient": gradient, "rays_d": unit(rows["rays_d"].double())}


def draw_composite(draw: Draw, n: int, samples: int) -> Rows:
    values = draw.radiance(n, samples, 3)
    return {"weights": draw.shares(n, samples), "values": values * draw.signs(n, 1, 1)}


def sums(rows: Rows, shared: Rows) -> Rows:
    n, samples = rows["weights"].shape
    return {
        "sums": ops.composite(rows["weights"].flatten(), rows["values"].reshape(n * samples, 3), offsets(n, samples))
    }


def draw_means(draw: Draw, n: int) -> Rows:
    """With an opacity of any size, the least one and its neighbours in float32 apart."""
    opacity = draw.mixed((0.0, 1e-30, 1.0), draw.logarithmic(1e-3, 1, n, 1)).clamp(0, 1)
    return draw_composite(draw, n, SAMPLES) | {"opacity": opacity}


def means(rows: Rows, shared: Rows) -> Rows:
    n, samples = rows["weights"].shape
    values = rows["values"].reshape(n * samples, 3)
    found = ops.composite(rows["weights"].flatten(), values, offsets(n, samples), rows["opacity"].flatten(), LEAST)
    return {"means": found}


def draw_interpolation(draw: Draw, n: int) -> Rows:
    """Values at shaded samples, and of each sample the two beside it, now and then the same one."""
    first = torch.randint(SHADED, (n, SAMPLES), generator=draw.generator)
    beside = (first + draw.chance(0.7, n, SAMPLES)).clamp(max=SHADED - 1)
    values = draw.radiance(n, SHADED, 3) * draw.signs(n, 1, 1)
    return {"values": values, "share": draw.shares(n, SAMPLES), "first": first, "second": beside}


def interpolated(rows: Rows, shared: Rows) -> Rows:
    n, none = len(rows["first"]), torch.empty(0, dtype=torch.int64)
    first, second = ((rows[name] + SHADED * torch.arange(n)[:, None]).flatten() for name in ("first", "second"))
    subset = ops.rays.ShadingSubset(none, first, second, rows["share"].flatten(), *[none] * 4)
    return {"values": subset.interpolate(rows["values"].reshape(n * SHADED, 3)).reshape(n, SAMPLES, 3)}


def ends_entry(name: str, s: float, draw, step: float, **changes) -> Entry:
    options = {"bound": 4e-6, "gradient_bound": 8e-6, "floor": 1e-30, "gradient_floor": 1e-30 * s}
    options["exact"] = partial(exact.weights_along_z, step=step)
    return Entry(
        name,
        draw=partial(draw, step=step),
        call=partial(weights, step=step),
        smooth=("sdf", "slope"),
        smooth_shared=("s",),
        shared={"s": torch.tensor(s)},
        exact_bound=1e-13,
        reason=BY_DEPTH,
        **(options | changes),
    )


def surface_entry(name: str, s: float, anneal: float) -> Entry:
    return Entry(
        name,
        draw=draw_surface,
        call=partial(surface, anneal=anneal),
        exact=partial(exact.surface_weights, step=STEP, anneal=anneal),
        exact_bound=1e-12,
        smooth=("sdf", "gradient"),
        smooth_shared=("s",),
        shared={"s": torch.tensor(s)},
        repair=repaired_surface,
        bound=4e-6,
        gradient_bound=4e-4,
        floor=1.0,
        gradient_floor=1.0,
        size=SAMPLES,
        reason=BY_NORMAL,
    )


def sums_entry(name: str, samples: int, **options) -> Entry:
    return Entry(
        name,
        draw=partial(draw_composite, samples=samples),
        call=sums,
        smooth=("weights", "values"),
        bound=1e-6,
        gradient_bound=1e-6,
        reason="sums in float64, rounded once; gradients are sums over the channels",
        **options,
    )


ENTRIES = (
    surface_entry("surface_weights", 200.0, 1.0),
    ends_entry("surface_weights, any ends", 1.0, draw_ends, WIDEST),
    ends_entry("surface_weights, any ends, s = 8000", 8000.0, partial(draw_ends, s=8000.0), WIDEST / 8000),
    ends_entry("surface_weights, 10^4 samples", 64.0, draw_long, 1.0, size=LONG, chunk=8, exact=None),
    surface_entry("surface_weights, annealed", 20.0, 0.3),
    sums_entry("composite", SAMPLES),
    Entry(
        "composite, divided by the opacity",
        draw=draw_means,
        call=means,
        smooth=("weights", "values", "opacity"),
        bound=1e-6,
        repair=lambda rows: rows | {"opacity": torch.where(rows["opacity"] < 1e-3, 0.0, rows["opacity"].clamp(max=1))},
        reason="a sum in float64 and one division",
    ),
    sums_entry("composite, 10^4 samples", LONG, size=LONG, chunk=8),
    Entry(
        "interpolate",
        draw=draw_interpolation,
        call=interpolated,
        smooth=("values",),
        bound=1e-6,
        gradient_bound=1e-6,
        size=SAMPLES,
        repair=lambda rows: rows | {"share": rows["share"].clamp(0, 1)},
        reason="a weighted mean of two; gradients are sums of eight weights",
    ),
)
