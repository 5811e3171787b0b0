"""The Monte Carlo estimate of the pre-integrated light.

Differentiable once in ``light``; a gradient to directions or roughness raises.

Source: SplitNeRF Eq. (11).
"""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops._library import lib, refuse_gradients, register


def prefilter_light(query_dirs: Tensor, roughness: Tensor, light_dirs: Tensor, light: Tensor) -> Tensor:
    r"""Estimates gbar(w_s, rho) from light samples that all queries share.

    .. math::

       \bar g(w_s, \rho) = \frac{\sum_i D(w_i, w_s, \rho)\, L_i\, (w_i \cdot w_s)^+}{\sum_i D(w_i, w_s, \rho)\, (w_i \cdot w_s)^+}

    The light directions should cover the sphere uniformly (:func:`fibonacci_directions` with a random rotation). The weights of
    the s n pairs are never stored: memory is O(s + n).

    Args:
        query_dirs: [s, 3] unit directions w_s.
        roughness: [s, 1] perceptual roughness in [0, 1].
        light_dirs: [n, 3] unit directions w_i, n > 0.
        light: [n, 3] radiance L_i at rho = 0.

    Returns:
        [s, 3] radiance; 0 for a query with no light direction above its horizon.

    Raises:
        ValueError: A shape or dtype does not fit.
    """
    return lib.prefilter_light(query_dirs, roughness, light_dirs, light)[0]


def fibonacci_directions(n: int, generator: torch.Generator | None = None, dtype=torch.float32) -> Tensor:
    """[n, 3] directions of a uniform lattice on the sphere under a random rotation (Haar measure).

    At equal n the error of gbar is 2 to 10 times smaller than with independent directions. The result is on the
    generator's device.
    """
    device = torch.device("cpu") if generator is None else generator.device
    lattice = torch.from_numpy(_core.fibonacci_sphere(n)).to(device=device, dtype=dtype)
    q, r = torch.linalg.qr(torch.randn(3, 3, dtype=dtype, generator=generator, device=device))
    rotation = q * torch.sign(torch.diagonal(r))
    return (lattice[:, :, None] * rotation).sum(1)


def sample_ggx_lobe(axes: Tensor, roughness: Tensor, n_samples: int, seed: int = 0) -> Tensor:
    """Directions with density proportional to D(w)(w.axis)+, for lobes so narrow that a shared set would miss them.

    The plain mean of the light over the directions estimates gbar, because the density is exact. Each axis
    gets a random shift by the seed, so that the mean is unbiased. No gradient.

    Args:
        axes: [s, 3] unit axes of the lobes.
        roughness: [s, 1] perceptual roughness in [0, 1].
        n_samples: The number of directions per axis.
        seed: The seed of the random shifts.

    Returns:
        [s, n_samples, 3] unit directions.

    Raises:
        ValueError: A shape, dtype or count does not fit.
    """
    return lib.sample_ggx_lobe(axes, roughness, n_samples, seed)


def _keep(ctx, inputs, output):
    query_dirs, roughness, light_dirs, _ = inputs
    ctx.save_for_backward(query_dirs, roughness, light_dirs, output[1])


def _backward(ctx, grad_gbar, grad_total):
    query_dirs, roughness, light_dirs, total = ctx.saved_tensors
    refuse_gradients(ctx, "prefilter_light", query_dirs=0, roughness=1, light_dirs=2)
    return None, None, None, lib.prefilter_light_backward(query_dirs, roughness, total, grad_gbar, light_dirs)


register(
    "prefilter_light",
    fake=lambda query_dirs, roughness, light_dirs, light: (
        query_dirs.new_empty(query_dirs.shape),
        query_dirs.new_empty(query_dirs.shape[0]),
    ),
    setup_context=_keep,
    backward=_backward,
)
register(
    "prefilter_light_backward",
    fake=lambda query_dirs, roughness, total, grad_gbar, light_dirs: light_dirs.new_empty(light_dirs.shape),
)
register("sample_ggx_lobe", fake=lambda axes, roughness, n_samples, seed: axes.new_empty(axes.shape[0], n_samples, 3))
