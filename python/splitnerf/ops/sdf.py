"""The distance field: in one pass with its gradient, its values alone, and the search for samples along rays.

``sdf_field`` is differentiable once in the table and the weights; ``sdf_values`` and ``sample_rays`` have no gradient.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.ops._library import lib, refuse_gradients, register
from splitnerf.ops.hash_grid import HashGridSpec, refuse_rounded_gradients
from splitnerf.ops.rays import PackedSamples


class SdfNetwork(NamedTuple):
    """The numbers of a field ``outputs(x) = out softplus(hidden [x, features(x)] + hidden_bias) + out_bias``.

    The first output is the signed distance.

    Attributes:
        spec: The shape of the hash grid that computes the features.
        n_active: The number of open levels.
        table: [spec.n_entries, spec.n_features] entries in the dtype of the other tensors; or in float16 or bfloat16
            where the others are float32.
        hidden, hidden_bias: [width, 3 + spec.n_outputs] weights and [width] biases of the hidden layer.
        out, out_bias: [m, width] weights and [m] biases of the output layer.
        beta: The sharpness of the activation softplus(y) = log(1 + exp(beta y)) / beta, positive.
        box: The half size of the cube that the grid covers, scene units.
    """

    spec: HashGridSpec
    n_active: int
    table: Tensor
    hidden: Tensor
    hidden_bias: Tensor
    out: Tensor
    out_bias: Tensor
    beta: float
    box: float

    def snapshot(self) -> SdfNetwork:
        """A copy in memory of its own, which later training steps do not change."""
        return SdfNetwork(*(x.clone() if isinstance(x, Tensor) else x for x in self))

    def arguments(self) -> tuple:
        """The arguments that the operators take for a network."""
        return (
            self.table,
            self.hidden,
            self.hidden_bias,
            self.out,
            self.out_bias,
            self.beta,
            *self.spec.arguments(self.n_active),
            self.box,
        )


def sdf_field(
    positions: Tensor,
    table: Tensor,
    hidden: Tensor,
    hidden_length: Tensor,
    hidden_bias: Tensor,
    out: Tensor,
    out_length: Tensor,
    out_bias: Tensor,
    beta: float,
    box: float,
    spec: HashGridSpec,
    n_active: int | None = None,
    stored: Tensor | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    r"""A distance field at points, with the features of its hash grid and the distance's gradient, in one pass.

    Rows of weights are normalised, row by row:

    .. math::

       W &= hidden\_length\ \frac{hidden}{|hidden|}, \qquad V = out\_length\ \frac{out}{|out|} \\
       a &= W\, [positions, features] + hidden\_bias \\
       outputs &= V\, \mathrm{softplus}(a) + out\_bias

    By the chain rule the gradient is :math:`q_{0..2} + J\, q_{3..} / (2\, box)` with
    :math:`q = (V_0\, \mathrm{softplus}'(a))\, W`, and J the derivatives of the features by the position in the unit cube.

    Args:
        positions: [n, 3] points, scene units, float32 or float64. Features of a point outside of [-box, box] are those of the
            nearest point of this cube. A NaN coordinate gives NaN.
        table: [spec.n_entries, spec.n_features] entries in the dtype of positions; or, if it needs no gradient, float16 or
            bfloat16 with float32 positions.
        hidden, hidden_length, hidden_bias: [width, 3 + C] directions, [width, 1] lengths and [width] biases of the hidden layer,
            C = spec.n_outputs. A direction of zeros gives NaN.
        out, out_length, out_bias: [m, width] directions, [m, 1] lengths and [m] biases of the output layer, m > 0.
        beta: The sharpness of the activation softplus(y) = log(1 + exp(beta y)) / beta, positive.
        box: The half size of the cube that the grid covers, scene units, positive.
        spec: The shape of the grid.
        n_active: The number of open levels, coarsest first; features of closed levels are 0. Default: all.
        stored: A copy of the float32 table in float16 or bfloat16, which is read instead of the table; or None.

    Returns:
        outputs [n, m], features [n, C] and gradient [n, 3] = d outputs[:, 0] / d positions. Differentiable once in table, weights,
        lengths and biases; the backward pass evaluates the field again. With `stored` the gradient goes to the table.

    Raises:
        ValueError: A shape, dtype, number or level count does not fit; the message names it.
        RuntimeError: positions, `stored` or a 16-bit table requires a gradient; raised in the backward pass.

    Source: SplitNeRF, section 4.1; weight normalisation: Salimans and Kingma 2016; grid: Mueller et al. 2022, section 3.
    """
    numbers = spec.arguments(spec.n_levels if n_active is None else n_active)
    return lib.sdf_field(
        positions, table, hidden, hidden_length, hidden_bias, out, out_length, out_bias, beta, *numbers, box, stored
    )


def sdf_values(positions: Tensor, network: SdfNetwork) -> Tensor:
    """Signed distances [n] at positions [n, 3], scene units: hash grid and network in one pass.

    Raises:
        ValueError: A shape, dtype or number does not fit.
    """
    return lib.sdf_values(positions, *network.arguments())


def sample_rays(
    rays_o: Tensor,
    rays_d: Tensor,
    jitter: Tensor,
    cells: Tensor,
    network: SdfNetwork,
    *,
    step: float,
    s: float,
    anneal: float = 1.0,
    min_weight: float,
    min_transmittance: float,
    reach: float,
    lipschitz: float,
    max_samples: int = 1024,
    room: int = 0,
) -> tuple[PackedSamples, Tensor, Tensor]:
    """The samples of :func:`march_rays` that contribute to a pixel; the search evaluates the distance along the rays.

    Two neighbouring samples are kept where one of them may have a rendering weight above `min_weight`. The weight is
    that of :func:`surface_weights` with the slope between their midpoints, or a bound for a surface between the
    midpoints. The ray ends where the transmittance is below `min_transmittance`. After a sample at distance f the
    search skips the samples within ``(|f| - reach) / lipschitz``. Where it then meets density or the other sign, the
    field is steeper than `lipschitz`: the search goes back and looks at what it skipped. It does that 32 times on a ray
    at most. After that it skips a quarter as much and does not go back. So a steep field costs few evaluations, and one
    of up to 4 `lipschitz` is still followed.

    Args:
        rays_o, rays_d: [n_rays, 3] origins (scene units) and unit directions.
        jitter: [n_rays] offsets of each ray's lattice of samples in [0, 1), as shares of the step.
        cells: [r, r, r] uint8 cells as in :func:`march_rays`; they cover the network's box.
        network: The distance field.
        step: The length of a sample, scene units.
        s: The sharpness of the density, positive.
        anneal: The annealing of the cosine in [0, 1], see :func:`surface_weights`.
        min_weight: The rendering weight above which samples are kept, in [0, 1).
        min_transmittance: The transmittance at which a ray ends, in [0, 1).
        reach: The distance outside the surface beyond which the density vanishes, scene units.
        lipschitz: The bound on the length of the field's gradient.
        max_samples: The largest number of evaluated distances of one ray.
        room: If positive, the number of samples in the result, so that the host need not wait for a GPU's count. The last
            rays lose what has no room. Zeros that belong to no ray fill it up.

    Returns:
        The kept samples; [n_rays] int64, the number of distances per ray that the search asked for (on a GPU more are
        evaluated: a group of neighbours at once); and [] int64, the number of samples that were found.

    Raises:
        ValueError: A shape, dtype or number does not fit.
    """
    *samples, evaluated, found = lib.sample_rays(
        rays_o,
        rays_d,
        jitter,
        cells,
        *network.arguments(),
        step,
        max_samples,
        s,
        anneal,
        min_weight,
        min_transmittance,
        reach,
        lipschitz,
        room,
    )
    return PackedSamples(*samples), evaluated, found


def _fake_sample(rays_o, rays_d, jitter, cells, table, *rest):
    n = rest[-1] or torch.library.get_ctx().new_dynamic_size()
    long, n_rays = torch.int64, rays_o.shape[0]
    return (
        rays_o.new_empty(n, dtype=long),
        rays_o.new_empty(n),
        rays_o.new_empty(n),
        rays_o.new_empty(n_rays + 1, dtype=long),
        rays_o.new_empty(n_rays, dtype=long),
        rays_o.new_empty((), dtype=long),
    )


def _keep_field(ctx, inputs, output):
    """Saves the tensors, and with them the table's copy if there is one; the numbers are in between."""
    positions, table, *weights, stored = inputs
    ctx.save_for_backward(positions, table, *weights[:6], *([] if stored is None else [stored]))
    ctx.numbers = weights[6:]


def _field_backward(ctx, *grads):
    positions, table, *weights = ctx.saved_tensors
    stored = weights[6:]
    refuse_gradients(ctx, "sdf_field", positions=0)
    refuse_rounded_gradients(ctx, "sdf_field", table, stored, 15)
    found = lib.sdf_field_backward(positions, *(stored or [table]), *weights[:6], *ctx.numbers, *grads)
    return None, *found, *(None for _ in ctx.numbers), None


register(
    "sdf_field",
    fake=lambda positions, table, hidden, length, bias, out, *rest: (
        positions.new_empty(positions.shape[0], out.shape[0]),
        positions.new_empty(positions.shape[0], hidden.shape[1] - 3),
        positions.new_empty(positions.shape),
    ),
    setup_context=_keep_field,
    backward=_field_backward,
)
register(
    "sdf_field_backward", fake=lambda positions, *tensors: tuple(positions.new_empty(t.shape) for t in tensors[:7])
)
register("sdf_values", fake=lambda positions, *rest: positions.new_empty(positions.shape[0]))
register("sample_rays", fake=_fake_sample)
