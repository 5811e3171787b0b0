"""The distance field: its layer over hash-grid features, its values at points, and the search for samples along rays.

``sdf_layer`` is differentiable once in features, jacobian and weights; ``sdf_values`` and ``sample_rays`` have no
gradient.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.ops._library import lib, refuse_gradients, register
from splitnerf.ops.hash_grid import HashGridSpec
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
            self.table, self.hidden, self.hidden_bias, self.out, self.out_bias, self.beta,
            *self.spec.arguments(self.n_active), self.box,
        )  # fmt: skip


def sdf_layer(
    positions: Tensor,
    features: Tensor,
    jacobian: Tensor,
    hidden: Tensor,
    hidden_bias: Tensor,
    out: Tensor,
    out_bias: Tensor,
    beta: float,
    box: float,
) -> tuple[Tensor, Tensor]:
    """The network of a distance field and the distance's gradient, in one pass.

    ``a = hidden [positions, features] + hidden_bias``, ``outputs = out softplus(a) + out_bias``, and by the chain rule
    ``d outputs[0] / d positions = q[:3] + jacobian q[3:] / (2 box)`` with ``q = (out[0] softplus'(a)) hidden``.

    Args:
        positions: [n, 3], scene units in [-box, box].
        features, jacobian: [n, C] and [n, 3, C] from :func:`hash_encode_jacobian` at ``positions / (2 box) + 1/2``.
        hidden, hidden_bias: [width, 3 + C] weights and [width] biases of the hidden layer.
        out, out_bias: [m, width] weights and [m] biases of the output layer.
        beta: The sharpness of the activation softplus(y) = log(1 + exp(beta y)) / beta, positive.
        box: The half size of the cube that the grid covers, scene units.

    Returns:
        outputs [n, m] and gradient [n, 3] of the first output.

    Raises:
        ValueError: A shape, dtype or number does not fit.
    """
    return lib.sdf_layer(positions, features, jacobian, hidden, hidden_bias, out, out_bias, beta, box)


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
        rays_o, rays_d, jitter, cells, *network.arguments(), step, max_samples, s, anneal, min_weight, min_transmittance,
        reach, lipschitz, room,
    )  # fmt: skip
    return PackedSamples(*samples), evaluated, found


def _fake_sample(rays_o, rays_d, jitter, cells, table, *rest):
    n = rest[-1] or torch.library.get_ctx().new_dynamic_size()
    long, n_rays = torch.int64, rays_o.shape[0]
    return (
        rays_o.new_empty(n, dtype=long), rays_o.new_empty(n), rays_o.new_empty(n), rays_o.new_empty(n_rays + 1, dtype=long),
        rays_o.new_empty(n_rays, dtype=long), rays_o.new_empty((), dtype=long),
    )  # fmt: skip


def _keep_layer(ctx, inputs, output):
    *tensors, ctx.beta, ctx.box = inputs
    ctx.save_for_backward(*tensors)


def _layer_backward(ctx, grad_outputs, grad_gradient):
    refuse_gradients(ctx, "sdf_layer", positions=0)
    return None, *lib.sdf_layer_backward(*ctx.saved_tensors, ctx.beta, ctx.box, grad_outputs, grad_gradient), None, None


register(
    "sdf_layer",
    fake=lambda positions, features, jacobian, hidden, hidden_bias, out, *rest: (
        positions.new_empty(positions.shape[0], out.shape[0]),
        positions.new_empty(positions.shape),
    ),
    setup_context=_keep_layer,
    backward=_layer_backward,
)
register("sdf_layer_backward", fake=lambda positions, *rest: tuple(t.new_empty(t.shape) for t in rest[:6]))
register("sdf_values", fake=lambda positions, *rest: positions.new_empty(positions.shape[0]))
register("sample_rays", fake=_fake_sample)
