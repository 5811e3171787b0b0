"""Every operator that has a kernel, at the sizes of a training step on a GPU: its inputs, and how many operations it takes.

Operations are those of the formula, a multiplication, an addition or an elementary function each counted as one, index
arithmetic not at all. Bytes are those of the inputs and results, each moved once (:func:`bytes_moved`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from gpu_world import CORNERS, Sizes, World
from op_cases import CASES as TEST_INPUTS
from op_cases import with_gradients
from torch import Tensor
from torch.utils._pytree import tree_leaves

from splitnerf.bench import reference
from splitnerf.ops import brdf_lut

UNREAD = {"sparse_product": (3, 4, 5), "read_pixels": (0, 5, 6, 7, 8)}  # inputs for the backward pass, or of which few numbers are read


class Case(NamedTuple):
    """One line of the table.

    Attributes:
        op: The operator.
        inputs: On the CPU in float32.
        operations: Of one call, from the sizes and the call's results.
        plain: The same in torch eager, where the package has that.
        table: Which input may be stored in 16 bits.
        variant: What tells it from another line of the same operator.
    """

    op: str
    inputs: Callable[[World], tuple]
    operations: Callable[[Sizes, tuple], float]
    plain: Callable[..., object] | None = None
    table: int | None = None
    variant: str = ""

    @property
    def name(self) -> str:
        return f"{self.op}, {self.variant}" if self.variant else self.op


def backward(case: Case, operations: Callable[[Sizes, tuple], float], *between: int) -> Case:
    """The backward pass of a case: its inputs, some of its results, random gradients to all of them."""
    return Case(case.op + "_backward", lambda w: with_gradients(case.op, case.inputs(w), *between), operations)


def bytes_moved(case: Case, sizes: Sizes, inputs: tuple, outputs: tuple) -> float:
    """Each input read once and each result written once; of a table no more entries than there are corners."""
    read = [x for i, x in enumerate(inputs) if i not in UNREAD.get(case.op, ())]
    tensors = [x for x in tree_leaves((read, outputs)) if isinstance(x, Tensor)]
    total = sum(x.numel() * x.element_size() for x in tensors)
    entries = sizes.spec.n_entries
    if case.op in ("hash_encode", "hash_encode_jacobian", "hash_encode_jacobian_backward_positions", "sdf_values", "sdf_field"):
        corners = CORNERS * len(inputs[0])
        touched = sum(min(level[2], corners) for level in sizes.spec.levels()[: sizes.levels])
        table = next(x for x in tensors if len(x) == entries)
        total -= (entries - touched) * table.shape[1] * table.element_size()
    return float(total)


def gather(operations_of_a_point: Callable[[Sizes], float]) -> Callable[[Sizes, tuple], float]:
    return lambda s, out: s.field_points * operations_of_a_point(s)


def a_point(n: float) -> Callable[[Sizes, tuple], float]:
    return lambda s, out: n * s.points


def a_sample(n: float) -> Callable[[Sizes, tuple], float]:
    return lambda s, out: n * s.samples


# 2 features; with the Jacobian 4 numbers of each (the value and three derivatives) are summed over the corners.
HASH = Case("hash_encode", World.grid, gather(lambda s: s.encode(2)), reference.hash_encode, 1)
SCATTERED = Case(
    "hash_encode",
    lambda w: w.grid(True),
    gather(lambda s: s.encode(2)),
    reference.hash_encode,
    1,
    variant="scattered points",
)
# The grid with its Jacobian, the hidden units, the outputs, the distance's gradient by the units and the Jacobian.
FIELD = Case(
    "sdf_field", World.field,
    gather(lambda s: s.encode(8) + 2 * s.layer + 2 * s.outputs * s.width + 6 * s.features + 4 * s.width), None, 1,
)  # fmt: skip
QUERY = Case("query_direction", World.query, a_point(45), reference.query_direction)
SPLIT = Case("split_sum_shade", World.split_sum, a_point(70), reference.split_sum_shade)
SUMS = Case("shade_sums", lambda w: (*w.shading(), torch.stack(w.threes(4), 1), brdf_lut(), True, None, None), a_point(75))
PREFILTER = Case(  # of a pair: a cosine 5, the lobe 10, three sums and their total 7
    "prefilter_light", World.prefiltering, lambda s, out: 22 * s.queries * s.lights,
    reference.prefilter_light,
)  # fmt: skip
# Two lookups a point, three of four of them rough: 169 basis functions of 4 each, and their sums with three colours, 6 each.
LOOKUP = Case("light_lookup", World.pyramid, a_point(2 * (60 + 0.75 * 169 * 10)))
OWN = Case("monte_carlo_light", World.own_directions, lambda s, out: 55 * s.traced * s.own)
SHARED = Case("summed_light", World.shared_directions, lambda s, out: 45 * s.segments * s.directions)
NEUS = Case("neus_weights", World.neus, a_sample(12))
SURFACE = Case("surface_weights", World.surface, a_sample(35))
COMPOSITE = Case("composite", World.composing, a_sample(6))
SHARPNESS = Case("sharpness", lambda w: (w.rand(w.sizes.samples, seed=76),), a_sample(10))
CHROMA = Case("log_chroma", lambda w: (w.rand(w.sizes.queries, 3, seed=74),), lambda s, out: 60 * s.queries)
PRIOR = Case("light_prior", World.texels, lambda s, out: 80 * (4 * s.light_resolution**2 // 3))
PIXELS = Case("pixel_losses", World.pixels, lambda s, out: 60 * s.rays)
SRGB = Case("linear_to_srgb", lambda w: (w.rand(w.sizes.samples, 3),), a_sample(12))

CASES = [
    HASH, SCATTERED,
    Case("hash_encode_backward", lambda w: w.grid_gradients(1, False), gather(lambda s: s.encode(2))),
    Case("hash_encode_backward", lambda w: w.grid_gradients(1, False, True), gather(lambda s: s.encode(2)),
         variant="scattered points"),
    Case("hash_encode_jacobian", World.grid, gather(lambda s: s.encode(8)), None, 1),
    Case("hash_encode_jacobian_backward", lambda w: w.grid_gradients(1, True), gather(lambda s: s.encode(8))),
    # Of a corner: the products with four gradients and six second derivatives of the weight.
    Case("hash_encode_jacobian_backward_positions", lambda w: w.grid_gradients(2, True),
         gather(lambda s: s.encode(8) + s.levels * CORNERS * 12)),
    # The grid twice, to and from; the units twice (value and slope), the gradients to features and slopes, and two outer products
    # for the weights.
    FIELD, backward(FIELD, gather(lambda s: 2 * s.encode(8) + 6 * s.layer + 4 * s.outputs * s.width + 12 * s.features)),
    Case("sdf_values", lambda w: (w.positions, *w.network),
         gather(lambda s: s.encode(2) + s.layer + 6 * s.width), None, 1),
    # Per distance asked for, as many as the last result says.
    Case("sample_rays", World.sampling,
         lambda s, out: float(out[4].sum()) * (s.encode(2) + s.layer + 6 * s.width + 20), None, 4),
    Case("march_rays", World.marching, lambda s, out: 12 * len(out[0])),
    Case("take_rows", lambda w: (w.row_arrays(w.sizes.samples), w.shaded), a_point(30)),
    Case("put_rows", lambda w: (w.row_arrays(len(w.shaded)), w.shaded, [w.sizes.samples] * 3), a_point(30)),
    Case("light_queries", World.query, a_point(50)),
    Case("draw_rays", World.drawing, lambda s, out: 40 * s.rays),
    Case("read_pixels", World.reading, lambda s, out: 40 * s.rays),
    Case("probe_points", World.probes, lambda s, out: 60 * s.smooth),
    Case("place_samples", World.placing, a_sample(10)),
    NEUS, backward(NEUS, a_sample(20), 0), SURFACE, backward(SURFACE, a_sample(60), 1),
    COMPOSITE, backward(COMPOSITE, a_sample(14)), SHARPNESS, backward(SHARPNESS, a_sample(12)),
    Case("spread_samples", World.spreading, a_sample(6)),
    Case("interpolate", World.interpolation, a_sample(24)),
    Case("interpolate_backward", World.interpolation_backward, a_sample(24)),
    QUERY, backward(QUERY, a_point(110)), SPLIT, backward(SPLIT, a_point(180)), SUMS, backward(SUMS, a_point(190)),
    PREFILTER, Case("prefilter_light_backward", World.prefiltering_backward, lambda s, out: 22 * s.queries * s.lights),
    Case("sample_ggx_lobe", lambda w: (*w.prefiltering()[:2], w.sizes.own, 3), lambda s, out: 25 * s.queries * s.own),
    Case("sparse_product", World.averaging, lambda s, out: 12 * s.light_resolution**2), LOOKUP,
    backward(LOOKUP, a_point(2 * (120 + 0.75 * 169 * 20))),
    Case("specular_share", lambda w: (*w.shading(), brdf_lut()), a_point(60)),
    Case("sample_bsdf", lambda w: (*w.own_directions()[:3], w.shares(), w.sizes.own, 3), lambda s, out: 60 * s.traced * s.own),
    OWN, backward(OWN, lambda s, out: 120 * s.traced * s.own), SHARED,
    backward(SHARED, lambda s, out: 100 * s.segments * s.directions),
    # About eight vertices around a point, an addition and a product for each of the directions.
    Case("cached_visibility", World.near_the_mesh, lambda s, out: 16 * s.segments * s.directions),
    Case("cached_occlusion", World.occlusion, lambda s, out: (16 + 30) * s.segments * s.directions),
    SRGB, backward(SRGB, a_sample(12)), Case("srgb_to_linear", lambda w: (w.rand(w.sizes.samples, 3),), a_sample(12)),
    CHROMA, backward(CHROMA, lambda s, out: 80 * s.queries), PRIOR, backward(PRIOR, lambda s, out: 100 * len(out[0])),
    PIXELS, backward(PIXELS, lambda s, out: 90 * s.rays),
    Case("gradient_losses", World.normals_beside, a_sample(10)),
    Case("gradient_losses_backward", lambda w: with_gradients("gradient_losses", w.normals_beside(), 1)[:-1], a_sample(20)),
    Case("material_losses", World.materials, a_point(20)),
    Case("material_losses_backward", lambda w: with_gradients("material_losses", w.materials(), 1)[:-1], a_point(20)),
    # Of a pair of five numbers: their distance 15, its exponential and the sum.
    Case("quadratic_entropy", lambda w: (w.randn(w.sizes.entropy, 5),), lambda s, out: 17 * s.entropy**2),
]  # fmt: skip


# Those that took most of a step on a GPU (docs/cuda.md), first: they are timed should the time not last for all.
COSTLY = ("sample_rays", "sdf_field_backward", "cached_occlusion", "cached_visibility", "hash_encode_jacobian_backward",
          "summed_light_backward", "sdf_field", "hash_encode_jacobian", "light_lookup_backward", "sparse_product")  # fmt: skip


def all_cases() -> list[Case]:
    """Those above, the costly ones first, and operators that are new since, with the inputs of their test."""
    known = {case.op for case in CASES}
    missing = [op for op in TEST_INPUTS if op not in known]
    first = {op: i for i, op in enumerate(COSTLY)}
    return sorted(CASES, key=lambda case: first.get(case.op, len(first))) + [
        Case(op, lambda w, op=op: TEST_INPUTS[op](torch.float32), lambda s, out: math.nan, variant="small inputs")
        for op in missing
    ]
