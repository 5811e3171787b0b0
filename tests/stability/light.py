"""Entries of the operators on light: filtering, lookup, sparse maps."""

from functools import lru_cache

import torch
from splitnerf import ops
from torch import Tensor

from stability import exact
from stability.cases import Draw, directions_of, unit
from stability.entry import Entry, Rows

LIGHTS = 96
RESOLUTIONS, NODES, ZONAL_ROWS = (16, 8, 4), (0.1, 0.2, 0.35, 0.5), 33


def repaired(rows: Rows) -> Rows:
    return {name: x.clamp(0, 1) if name == "roughness" else directions_of(x) for name, x in rows.items()}


def draw_queries(draw: Draw, n: int) -> Rows:
    """Queries anywhere, in the very direction of a light, and close to it."""
    lights = lamps()["light_dirs"].double()
    at = lights[torch.randint(LIGHTS, (n,), generator=draw.generator)]
    close = unit(at + draw.pick((0.0, 1e-7, 1e-4, 1e-2), n, 1) * draw.normal(n, 3))
    return {
        "query_dirs": torch.where(draw.chance(0.5, n, 1), close, draw.directions(n)),
        "roughness": draw.roughness(n),
    }


@lru_cache(maxsize=1)
def lamps() -> Rows:
    """Lights over the whole sphere: one of 1e6, one of 1e-8, a few ordinary ones, and black."""
    draw = Draw(2)
    light = torch.zeros(LIGHTS, 3, dtype=torch.float64)
    light[: LIGHTS // 4] = draw.uniform(LIGHTS // 4, 3)
    light[LIGHTS // 2] = 1e6
    light[LIGHTS // 2 + 1] = 1e-8
    return {"light_dirs": unit(draw.normal(LIGHTS, 3)).float(), "light": light.float()}


def bright(size: float) -> Rows:
    return lamps() | {"light": torch.full((LIGHTS, 3), size)}


def filtered(rows: Rows, shared: Rows) -> Rows:
    return {"gbar": ops.prefilter_light(**rows, **shared)}


def draw_lookup(draw: Draw, n: int) -> Rows:
    """Directions to texel borders and across the octahedron's seams; roughness at the levels' nodes."""
    texel = (torch.round(draw.uniform(n, 3, low=-8, high=8)) / 8).clamp(-1, 1)
    texel[:, 2] = torch.where(texel.abs().sum(1) == 0, 1.0, texel[:, 2])
    directions = torch.where(draw.chance(0.3, n, 1), unit(texel), draw.directions(n))
    return {"directions": directions, "roughness": draw.mixed(NODES + (0.0, 1e-7, 1.0), draw.uniform(n, 1)).clamp(0, 1)}


@lru_cache(maxsize=1)
def pyramid() -> Rows:
    """A dim sky with one lamp of 1e6, around which the harmonics ring."""
    draw = Draw(3)
    levels = draw.uniform(sum(r * r for r in RESOLUTIONS), 3)
    levels[5] = 1e6
    levels[300:310] = 0
    sh = 0.1 * draw.normal(169, 3)  # degrees 0 to 12
    sh[0] = torch.tensor([4.0, 0.5, 1e-3])
    return {"levels": levels.float(), "sh": sh.float(), "zonal": ops.light.zonal_factors(NODES[-1], ZONAL_ROWS)}


def looked_up(rows: Rows, shared: Rows) -> Rows:
    resolutions, nodes = torch.tensor(RESOLUTIONS), torch.tensor(NODES, dtype=torch.float64)
    tables = shared["levels"], shared["sh"], resolutions, nodes, shared["zonal"]
    return {"radiance": ops.light.light_lookup(rows["directions"], rows["roughness"], *tables)}


@lru_cache(maxsize=2)
def matrix(dtype: torch.dtype) -> ops.light.SparseMap:
    """Filters of an 8^2 map, the same float32 numbers in either precision."""
    return ops.light.light_filters(8, [(8, 0.3), (4, 0.4)]).to(dtype)


def products(rows: Rows, shared: Rows) -> Rows:
    """One product a row."""
    values: Tensor = rows["values"]
    found = [ops.light.sparse_product(matrix(values.dtype), x) for x in values]
    return {"products": torch.stack(found) if found else values.new_empty(0, 80, 3)}


def filter_entry(name: str, shared: Rows, reason: str, **options) -> Entry:
    return Entry(
        name,
        draw=draw_queries,
        call=filtered,
        smooth_shared=("light",),
        shared=shared,
        repair=repaired,
        bound=4e-6,
        gradient_bound=1e-5,
        exact=exact.prefilter_light,
        exact_bound=1e-13,
        reason=reason,
        **options,
    )


LIGHTS_ADDED = "a few roundings and the sum over the lights; weights go down to 1e-16: light below 1e-22 underflows"
ENTRIES = (
    filter_entry("prefilter_light", lamps(), LIGHTS_ADDED, floor=1e-22),
    filter_entry("prefilter_light, 1e30", bright(1e30), "as above; a constant light stays itself"),
    Entry(
        "light_lookup",
        draw=draw_lookup,
        call=looked_up,
        smooth=("directions", "roughness"),
        smooth_shared=("levels", "sh"),
        shared=pyramid(),
        repair=repaired,
        vectors=("directions",),
        bound=4e-6,
        gradient_bound=2e-5,
        floor=1e-6,
        gradient_floor=1e-3,
        exact=exact.light_lookup,
        exact_bound=1e-13,
        reason="a few roundings, sums of 169 harmonics; radiance below a millionth of the mean light counts as that; "
        "a direction is known to a rounding of its length",
    ),
    Entry(
        "sparse_product",
        call=products,
        smooth=("values",),
        bound=2e-6,
        gradient_bound=2e-6,
        size=64,
        draw=lambda draw, n: {"values": draw.radiance(n, 64, 3, top=1e30)},
        chunk=512,
        reason="sums of 64 weighted terms in four parts",
    ),
)
