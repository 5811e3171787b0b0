"""The operators of a training step of preset `fast`, at its sizes: their inputs, and how many operations they take.

Operations are those of the formula, a multiplication, an addition or an elementary function each counted as one, index
arithmetic not at all. Bytes are those of the inputs and results, each moved once (:func:`bytes_moved`).
"""

from __future__ import annotations

from collections.abc import Callable, Container
from typing import NamedTuple

import torch
from gpu_world import CORNERS, Sizes, World
from op_cases import with_gradients
from shading_inputs import material_inputs
from test_reference import DIFFERENTIABLE
from torch import Tensor, nn
from torch.utils._pytree import tree_leaves, tree_map

from splitnerf.ops import brdf_lut
from splitnerf_tools.bench import reference

UNREAD = {"sparse_product": (3, 4, 5), "read_pixels": (0, 5, 6, 7, 8)}  # inputs for the backward pass, or of which few numbers are read


class Case(NamedTuple):
    """One line of the table.

    Attributes:
        op: The operator.
        inputs: On the CPU in float32.
        operations: Of one call, from the sizes and the call's results.
        table: Which input may be stored in 16 bits.
        forward: Of a backward pass the inputs of the forward one.
    """

    op: str
    inputs: Callable[[World], tuple]
    operations: Callable[[Sizes, tuple], float]
    table: int | None = None
    forward: Callable[[World], tuple] | None = None


def backward(case: Case, operations: Callable[[Sizes, tuple], float], *between: int) -> Case:
    """The backward pass of a case: its inputs, some of its results, random gradients to all of them."""
    return Case(case.op + "_backward", lambda w: with_gradients(case.op, case.inputs(w), *between), operations, forward=case.inputs)


def as_torch(case: Case) -> tuple[Callable[..., object], Callable[[World], tuple]] | None:
    """A case as torch code and what that takes; of a backward pass together with the forward one. None where there is no such code."""
    op = case.op.removesuffix("_backward")
    plain = layers if op == "material_network" else getattr(reference, op, None)
    if plain is None or (op != case.op and case.forward is None):
        return None
    return (plain, case.inputs) if op == case.op else (differentiated(plain, DIFFERENTIABLE.get(op, range(3))), case.forward)


def differentiated(plain: Callable[..., object], indices: Container[int]) -> Callable[..., object]:
    """Torch code with its gradients to the inputs of these indices."""

    def both(*inputs: object) -> object:
        leaves = [tree_map(lambda x: x.detach().requires_grad_(), x) if i in indices and x is not None else x for i, x in enumerate(inputs)]
        outputs = [x.sum() for x in tree_leaves(plain(*leaves)) if x.requires_grad]
        wanted = [x for x in tree_leaves(leaves) if isinstance(x, Tensor) and x.requires_grad]
        return torch.autograd.grad(outputs, wanted, allow_unused=True)

    return both


def layers(parts: list[Tensor], weights: list[Tensor], biases: list[Tensor], least: float) -> tuple[Tensor, Tensor, Tensor]:
    """The network of the materials as torch's layers."""
    x = torch.cat(parts, 1)
    for w, b in zip(weights[:-1], biases):
        x = torch.relu(nn.functional.linear(x, w, b))
    albedo, roughness, metallic = torch.sigmoid(nn.functional.linear(x, weights[-1], biases[-1])).split((3, 1, 1), 1)
    return albedo, least + (1 - least) * roughness, metallic


def bytes_moved(case: Case, sizes: Sizes, inputs: tuple, outputs: tuple) -> float:
    """Each input read once and each result written once; of a table no more entries than there are corners."""
    read = [x for i, x in enumerate(inputs) if i not in UNREAD.get(case.op, ())]
    tensors = [x for x in tree_leaves((read, outputs)) if isinstance(x, Tensor)]
    total = sum(x.numel() * x.element_size() for x in tensors)
    entries = sizes.spec.n_entries
    if case.op in ("sdf_values", "sdf_field"):
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


# The grid with its Jacobian, the hidden units, the outputs, the distance's gradient by the units and the Jacobian.
FIELD = Case(
    "sdf_field", World.field,
    gather(lambda s: s.encode(8) + 2 * s.layer + 2 * s.outputs * s.width + 6 * s.features + 4 * s.width), 1,
)  # fmt: skip
SPLIT = Case("split_sum_shade", World.split_sum, a_point(70))
SUMS = Case("shade_sums", lambda w: (*w.shading(), torch.stack(w.threes(4), 1), brdf_lut(), True, None, None), a_point(75))
# Two lookups a point, three of four of them rough: 169 basis functions of 4 each, and their sums with three colours, 6 each.
LOOKUP = Case("light_lookup", World.pyramid, a_point(2 * (60 + 0.75 * 169 * 10)))
SHARED = Case("summed_light", World.shared_directions, lambda s, out: 45 * s.segments * s.directions)
SURFACE = Case("surface_weights", World.surface, a_sample(35))
COMPOSITE = Case("composite", World.composing, a_sample(6))
SHARPNESS = Case("sharpness", lambda w: (w.rand(w.sizes.samples, seed=76),), a_sample(10))
CHROMA = Case("log_chroma", lambda w: (w.rand(w.sizes.queries, 3, seed=74),), lambda s, out: 60 * s.queries)
PRIOR = Case("light_prior", World.texels, lambda s, out: 80 * (4 * s.light_resolution**2 // 3))
PIXELS = Case("pixel_losses", World.pixels, lambda s, out: 60 * s.rays)
# Of a point: 48 inputs and twice 64 units; on the way back the same again and twice as many for the gradients.
NETWORK = Case("material_network", lambda w: material_inputs(w.sizes.points, torch.float32, (48, 64, 64), (3, 13, 32)), a_point(2 * 7488))

CASES = [
    # The grid twice, to and from; the units twice (value and slope), the gradients to features and slopes, and two outer products
    # for the weights.
    FIELD, backward(FIELD, gather(lambda s: 2 * s.encode(8) + 6 * s.layer + 4 * s.outputs * s.width + 12 * s.features)),
    Case("sdf_values", lambda w: (w.positions, *w.network),
         gather(lambda s: s.encode(2) + s.layer + 6 * s.width), 1),
    # Per distance asked for, as many as the last result says.
    Case("sample_rays", World.sampling,
         lambda s, out: float(out[4].sum()) * (s.encode(2) + s.layer + 6 * s.width + 20), 4),
    Case("take_rows", lambda w: (w.row_arrays(w.sizes.samples), w.shaded), a_point(30)),
    Case("put_rows", lambda w: (w.row_arrays(len(w.shaded)), w.shaded, [w.sizes.samples] * 3), a_point(30)),
    Case("light_queries", World.query, a_point(50)),
    Case("draw_rays", World.drawing, lambda s, out: 40 * s.rays),
    Case("read_pixels", World.reading, lambda s, out: 40 * s.rays),
    Case("probe_points", World.probes, lambda s, out: 60 * s.smooth),
    Case("place_samples", World.placing, a_sample(10)),
    SURFACE, backward(SURFACE, a_sample(60), 1),
    COMPOSITE, backward(COMPOSITE, a_sample(14)), SHARPNESS, backward(SHARPNESS, a_sample(12)),
    Case("spread_samples", World.spreading, a_sample(6)),
    Case("interpolate", World.interpolation, a_sample(24)),
    Case("interpolate_backward", World.interpolation_backward, a_sample(24)),
    SPLIT, backward(SPLIT, a_point(180)), SUMS, backward(SUMS, a_point(190)),
    Case("sparse_product", World.averaging, lambda s, out: 12 * s.light_resolution**2), LOOKUP,
    backward(LOOKUP, a_point(2 * (120 + 0.75 * 169 * 20))),
    SHARED,
    backward(SHARED, lambda s, out: 100 * s.segments * s.directions),
    # About eight vertices around a point, an addition and a product for each of the directions.
    Case("cached_visibility", World.near_the_mesh, lambda s, out: 16 * s.segments * s.directions),
    Case("cached_occlusion", World.occlusion, lambda s, out: (16 + 30) * s.segments * s.directions),
    NETWORK, backward(NETWORK, a_point(6 * 7488)),
    CHROMA, backward(CHROMA, lambda s, out: 80 * s.queries), PRIOR, backward(PRIOR, lambda s, out: 100 * len(out[0])),
    PIXELS, backward(PIXELS, lambda s, out: 90 * s.rays),
    Case("gradient_losses", World.normals_beside, a_sample(10)),
    Case("gradient_losses_backward", lambda w: with_gradients("gradient_losses", w.normals_beside(), 1)[:-1], a_sample(20)),
    Case("material_losses", World.materials, a_point(20)),
    Case("material_losses_backward", lambda w: with_gradients("material_losses", w.materials(), 1)[:-1], a_point(20)),
    # Of a pair of five numbers: their distance 15, its exponential and the sum.
    Case("quadratic_entropy", lambda w: (w.randn(w.sizes.entropy, 5),), lambda s, out: 17 * s.entropy**2),
]  # fmt: skip


# Those that took most of a step on a GPU, first: they are timed should the time not last for all.
COSTLY = ("sample_rays", "sdf_field_backward", "cached_occlusion", "cached_visibility", "summed_light_backward", "sdf_field",
          "light_lookup_backward", "sparse_product")  # fmt: skip


def all_cases() -> list[Case]:
    """Those above, the costly ones first."""
    first = {op: i for i, op in enumerate(COSTLY)}
    return sorted(CASES, key=lambda case: first.get(case.op, len(first)))
