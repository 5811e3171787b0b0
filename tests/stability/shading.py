"""Entries of the operators that shade: split sum, sums over incoming light, and the curve of images."""

import torch
from splitnerf import ops
from splitnerf.ops._library import lib
from splitnerf.ops.shading import SHADED
from torch import Tensor

from stability import exact
from stability.cases import Draw, drawn_directions, unit
from stability.entry import Entry, Rows

UNITS = ("normals", "view_dirs", "light_dirs")
IN_UNIT_RANGE = ("albedo", "roughness", "metallic", "occlusion_s", "occlusion_d", "share")
TABLE = {"lut": ops.shading.brdf_lut()}  # always float32; its numbers are as uncertain as the rest
SAMPLES = 4  # directions a point
NO_SHARE = 1e-36  # of components of directions: a cosine over pi should have a float32
BY_CONDITION = "a few roundings, times how much the true value changes by a relative change of the inputs and the table"


def repaired(rows: Rows) -> Rows:
    """Directions of length 1 or 0, shares in [0, 1], light and densities not below 0.

    Where the normal has length 0 the query has the length chi, which vanishes towards roughness 1: below 0.9 there.
    """
    out = dict(rows)
    for name, x in rows.items():
        if name in UNITS:
            out[name] = unit(torch.where(x.abs() < NO_SHARE, 0.0, x.double()))
        elif name in IN_UNIT_RANGE:
            out[name] = x.clamp(0, 1)
        elif name != "linear":
            out[name] = x.clamp(0, 1e30)
    if "normals" in rows:
        nothing = (rows["normals"] == 0).all(1, keepdim=True)
        out["roughness"] = torch.where(nothing, out["roughness"].clamp(max=0.9), out["roughness"])
    return out


def surface(draw: Draw, n: int) -> Rows:
    """Normals, one in fifty of length 0, directions to the viewer at extreme angles, and roughness."""
    normals = draw.directions(n)
    view_dirs = draw.at_cosine(normals)
    normals[draw.chance(0.02, n)] = 0
    return repaired({"normals": normals, "view_dirs": view_dirs, "roughness": draw.roughness(n)})


def draw_material(draw: Draw, n: int) -> Rows:
    return surface(draw, n) | {"albedo": draw.shares(n, 3), "metallic": draw.shares(n, 1)}


def draw_shaded(draw: Draw, n: int) -> Rows:
    return draw_material(draw, n) | {
        "specular": draw.radiance(n, 3),
        "diffuse": draw.radiance(n, 3),
        "occlusion_s": draw.shares(n, 3),
        "occlusion_d": draw.shares(n, 3),
        "indirect_s": draw.radiance(n, 3),
        "indirect_d": draw.radiance(n, 3),
    }


def draw_sums(draw: Draw, n: int) -> Rows:
    light = {name: draw.radiance(n, 3) for name in (*ops.shading.LightSums._fields, "other")} | {
        "share": draw.shares(n, 1)
    }
    return within_the_light(draw_material(draw, n) | light)


def within_the_light(rows: Rows) -> Rows:
    """The light at grazing angles is a share of all of it, (1 - v.h)^5 of each direction's; so is the dielectric's."""
    return rows | {name: torch.minimum(rows[name], rows["specular"]) for name in ("grazing", "dielectric")}


def draw_lit(draw: Draw, n: int) -> Rows:
    """Points with a few directions each, drawn for their materials or extreme ones, with their densities."""
    rows = surface(draw, n)
    names = ("normals", "view_dirs", "roughness")
    given, seed = (rows[name].float() for name in names), int(draw.uniform(1).item() * 1e9)
    sampled, pdf = drawn_directions(*given, draw.uniform(1).item(), SAMPLES, seed)
    own = draw.at_cosine(rows["normals"].repeat_interleave(SAMPLES, 0)).reshape(n, SAMPLES, 3)
    wild = draw.chance(0.3, n, SAMPLES)
    return rows | {
        "light_dirs": torch.where((own.abs() < NO_SHARE) & wild[..., None], 0.0, own).where(
            wild[..., None], sampled.double()
        ),
        "pdf": draw.mixed((1e-7, 0.3, 1e3), draw.uniform(n, SAMPLES)).where(wild, pdf.double()),
        "radiance": draw.radiance(n, SAMPLES, 3, top=1e20),
    }


def shade_modes(rows: Rows, shared: Rows) -> Rows:
    given = [rows[name] for name in SHADED]
    modes = {mode: (i, False) for i, mode in enumerate(ops.shading.FRESNEL_MODES)} | {"compensated": (0, True)}
    indirect = rows["indirect_s"], rows["indirect_d"]
    return {name: lib.split_sum_shade(*given, shared["lut"].float(), *mode, *indirect) for name, mode in modes.items()}


def shade_from_sums(rows: Rows, shared: Rows) -> Rows:
    sums = torch.stack([rows[name] for name in ops.shading.LightSums._fields], 1)
    given = [*(rows[name] for name in SHADED[:5]), sums]
    modes = {"single": (False, None, None), "compensated": (True, None, None)}
    modes["mixed"] = True, rows["other"], rows["share"][:, 0]
    return {name: lib.shade_sums(*given, shared["lut"].float(), *mode) for name, mode in modes.items()}


def directions(rows: Rows, shared: Rows) -> Rows:
    given = (rows["normals"], rows["view_dirs"], rows["roughness"])
    n, lut = len(given[0]), shared["lut"].float()
    return {query: lib.light_queries(*given, lut, query == "mean")[0][:n] for query in ops.shading.QUERIES}


def light_sums(rows: Rows, shared: Rows) -> Rows:
    names = ("normals", "view_dirs", "roughness", "light_dirs", "pdf", "radiance")
    return ops.shading.monte_carlo_light(*(rows[name] for name in names))._asdict()


def summed(rows: Rows, shared: Rows) -> Rows:
    given = [rows[name] for name in ("normals", "view_dirs", "roughness")]
    return ops.shading.summed_light(
        *given, shared["directions"], shared["solid_angles"], shared["radiance"], rows["visible"], rows["sent"]
    )._asdict()


def draw_summed(draw: Draw, n: int) -> Rows:
    return surface(draw, n) | {"visible": draw.shares(n, 32), "sent": draw.radiance(n, 32, 3, top=1e20)}


def repaired_summed(rows: Rows) -> Rows:
    return repaired(rows) | {"visible": rows["visible"].clamp(0, 1)}


def sky(n: int) -> Rows:
    """Directions with the solid angle and the light of each: black but for one lamp of 1e6 and a dim half."""
    draw = Draw(1)
    radiance: Tensor = draw.uniform(n, 3)
    radiance[n // 2 :] = 0
    radiance[-1] = 1e6
    towards, solid_angles = unit(draw.normal(n, 3)).float(), draw.uniform(n).float()
    return {"directions": towards, "solid_angles": solid_angles, "radiance": radiance.float()}


def draw_linear(draw: Draw, n: int) -> Rows:
    edges = (0.0, 1e-45, 1e-38, 0.0031308, 1.0, 1e6, 1e30, 1e38, -1e-38, -1.0)
    return {"linear": draw.mixed(edges, draw.logarithmic(1e-8, 1e4, n))}


def draw_srgb(draw: Draw, n: int) -> Rows:
    edges = (0.0, 1e-45, 1e-38, 0.04045, 1.0, 1e6, 1e15)
    return {"srgb": draw.mixed(edges, draw.logarithmic(1e-8, 1e4, n))}


ENTRIES = (
    Entry(
        "light_queries",
        draw=surface,
        call=directions,
        shared=TABLE,
        smooth=("normals", "roughness"),
        repair=repaired,
        bound=2e-6,
        exact=exact.light_queries,
        exact_bound=1e-14,
        gradient_floor=1.0,
        reason=BY_CONDITION + "; gradients of unit vectors count as at least 1, as theirs may vanish",
    ),
    Entry(
        "split_sum_shade",
        draw=draw_shaded,
        call=shade_modes,
        shared=TABLE,
        repair=repaired,
        bound=2e-6,
        smooth=SHADED,
        exact=exact.split_sum_shade,
        exact_bound=1e-14,
        reason=BY_CONDITION,
    ),
    Entry(
        "shade_sums",
        draw=draw_sums,
        call=shade_from_sums,
        shared=TABLE,
        repair=lambda rows: within_the_light(repaired(rows)),
        bound=2e-6,
        smooth=(*SHADED[:5], *ops.shading.LightSums._fields, "other"),
        exact=exact.shade_sums,
        exact_bound=1e-14,
        reason=BY_CONDITION,
    ),
    Entry(
        "monte_carlo_light",
        draw=draw_lit,
        call=light_sums,
        repair=repaired,
        bound=4e-6,
        smooth=("normals", "roughness", "radiance"),
        gradient_bound=2e-5,
        exact=exact.light_sums,
        exact_bound=1e-14,
        floor=1e-10,
        size=SAMPLES,
        gradient_floor=1e-30,
        reason=BY_CONDITION
        + "; half vectors are unit to a rounding, each its own; gradients below 1e-30 come from light that has "
        "no normal float",
    ),
    Entry(
        "summed_light",
        draw=draw_summed,
        call=summed,
        repair=repaired_summed,
        shared=sky(32),
        bound=4e-6,
        smooth=("normals", "roughness"),
        smooth_shared=("radiance",),
        gradient_bound=1e-5,
        size=32,
        chunk=4096,
        reason=BY_CONDITION,
    ),
    Entry(
        "linear_to_srgb",
        draw=draw_linear,
        smooth=("linear",),
        exact=exact.linear_to_srgb,
        exact_bound=1e-14,
        call=lambda rows, shared: {"srgb": ops.linear_to_srgb(rows["linear"])},
        bound=1e-5,
        gradient_bound=1e-5,
        reason="x^(1/2.4): the float32 nearest to 1/2.4 is off by 4e-8, times ln x up to 90; its slope jumps once",
    ),
    Entry(
        "srgb_to_linear",
        draw=draw_srgb,
        conditioned=False,
        exact=exact.srgb_to_linear,
        exact_bound=1e-14,
        repair=lambda rows: {"srgb": rows["srgb"].clamp(0, 1e15)},
        call=lambda rows, shared: {"linear": ops.shading.srgb_to_linear(rows["srgb"])},
        bound=4e-6,
        reason="x^2.4: the float32 nearest to 2.4 is off by 9e-8, times ln x of up to 35, and 2.4 roundings of x",
    ),
)
