"""Shading by sums over directions: the incoming light under the lobes of points, and the reflected radiance.

``monte_carlo_light`` is differentiable once in normals, roughness and radiance, ``shade_sums`` once in all; a gradient
to the rest raises. ``shade_sums`` is the path tracer's BSDF under the light: a metal with Schlick's Fresnel term and a
diffuse base under a dielectric of index 1.5 with the exact one, mixed.

Source: the rendering equation, SplitNeRF Eq. (4)-(6), without the split.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.ops._library import lib, refuse_gradients, register
from splitnerf.ops.shading import brdf_lut


class LightSums(NamedTuple):
    r"""Integrals of incoming light over the lobes of points, [n, 3] each.

    Attributes:
        specular: :math:`\int D V L\, (n \cdot l)\, dl`, the GGX lobe without the Fresnel term.
        grazing: :math:`\int D V L\, (n \cdot l) (1 - v \cdot h)^5\, dl`, with Schlick's factor, so that the lobe reflects
            F0 (specular - grazing) + grazing.
        diffuse: The irradiance over pi.
        dielectric: :math:`\int D V L\, (n \cdot l) F_d\, dl`, with the exact Fresnel factor of a dielectric of index 1.5.
    """

    specular: Tensor
    grazing: Tensor
    diffuse: Tensor
    dielectric: Tensor


def monte_carlo_light(
    normals: Tensor, view_dirs: Tensor, roughness: Tensor, light_dirs: Tensor, pdf: Tensor, radiance: Tensor
) -> LightSums:
    """Estimates the integrals of incoming light over the specular and the diffuse lobe.

    Args:
        normals, view_dirs: [n, 3] unit; a normal that faces away from the viewer is negated.
        roughness: [n, 1] perceptual roughness in [0, 1].
        light_dirs, pdf: [n, k, 3] unit directions and [n, k] densities with which they were drawn, sr^-1; no gradient.
        radiance: [n, k, 3] incoming radiance from the directions, 0 where the ray is blocked.

    Returns:
        LightSums; differentiable in normals, roughness and radiance.

    Raises:
        ValueError: A shape or dtype does not fit.
    """
    return LightSums(*lib.monte_carlo_light(normals, view_dirs, roughness, light_dirs, pdf, radiance).unbind(1))


def summed_light(
    normals: Tensor,
    view_dirs: Tensor,
    roughness: Tensor,
    directions: Tensor,
    solid_angles: Tensor,
    radiance: Tensor,
    visible: Tensor,
    sent: Tensor | None = None,
) -> LightSums:
    """The integrals of :func:`monte_carlo_light` by quadrature over fixed directions that all points share.

    Args:
        normals, view_dirs: [n, 3] unit; a normal that faces away from the viewer is negated.
        roughness: [n, 1] perceptual roughness in [0, 1].
        directions: [k, 3] unit directions.
        solid_angles: [k] solid angles of the directions' cells, sr.
        radiance: [k, 3] radiance of the environment from each direction.
        visible: [n, k] share of the environment's radiance that arrives at each point, in [0, 1].
        sent: [n, k, 3] additional radiance that arrives at each point, or None.

    Returns:
        LightSums; differentiable in normals, roughness and radiance.

    Raises:
        ValueError: A shape or dtype does not fit.
    """
    nothing = normals.new_empty(0, len(directions), 3)
    sums = lib.summed_light(
        normals, view_dirs, roughness, directions, solid_angles, radiance, visible, nothing if sent is None else sent
    )
    return LightSums(*sums.unbind(1))


def shade_sums(
    normals: Tensor,
    view_dirs: Tensor,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    sums: LightSums,
    compensate: bool = False,
) -> Tensor:
    r"""Outgoing linear radiance of points from integrals of incoming light that contain the Fresnel terms.

    .. math::

       L = m\, gain_m \left[albedo\, (specular - grazing) + grazing\right]
           + (1 - m) \left[gain_d\, dielectric + (1 - E_d)\, albedo\, diffuse\right]

    with E_d and the gains of multiple scattering as in :func:`splitnerf.ops.split_sum_shade` in its ``exact`` mode.

    Args:
        normals, view_dirs: [n, 3] unit; a normal that faces away from the viewer is negated.
        albedo: [n, 3] linear, in [0, 1].
        roughness, metallic: [n, 1], in [0, 1].
        sums: The integrals of the light at the points, from :func:`monte_carlo_light` or :func:`summed_light`.
        compensate: Whether to compensate for multiple scattering (Turquin 2019).

    Returns:
        [n, 3] linear radiance.

    Raises:
        ValueError: A shape or dtype does not fit.
    """
    for name, part in zip(LightSums._fields, sums):
        if part.shape != normals.shape:
            raise ValueError(f"shade_sums: {name} must be {list(normals.shape)}, got {list(part.shape)}")
    stacked, table = torch.stack(tuple(sums), 1), brdf_lut(normals.device)
    return lib.shade_sums(normals, view_dirs, albedo, roughness, metallic, stacked, table, compensate, None, None)


def summed_correction(
    normals: Tensor,
    view_dirs: Tensor,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    split: Tensor,
    share: Tensor,
    directions: Tensor,
    solid_angles: Tensor,
    radiance: Tensor,
    visible: Tensor,
    sent: Tensor | None = None,
    compensate: bool = False,
) -> Tensor:
    """What the sum over directions adds to another radiance of points to replace it by a share.

    ``(shade_sums(summed_light(...)) - split) share``

    Args:
        normals, view_dirs, albedo, roughness, metallic, compensate: See :func:`shade_sums`.
        split: [n, 3] linear radiance that is replaced, that of the split sum.
        share: [n] share of the sum in [0, 1]; no gradient.
        directions, solid_angles, radiance, visible, sent: The light, see :func:`summed_light`.

    Returns:
        [n, 3] linear radiance to add. Differentiable once in normals, albedo, roughness, metallic, split and radiance.

    Raises:
        ValueError: A shape or dtype does not fit.

    Source: SplitNeRF Eq. (4)-(6), by quadrature.
    """
    sent = normals.new_empty(0, len(directions), 3) if sent is None else sent
    sums = lib.summed_light(normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent)
    table = brdf_lut(normals.device)
    return lib.shade_sums(normals, view_dirs, albedo, roughness, metallic, sums, table, compensate, split, share)


def _keep(ctx, inputs, output):
    ctx.save_for_backward(*inputs)


def _backward(ctx, grad_sums):
    refuse_gradients(ctx, "monte_carlo_light", view_dirs=1, light_dirs=3, pdf=4)
    normals, roughness, radiance = lib.monte_carlo_light_backward(*ctx.saved_tensors, grad_sums)
    return normals, None, roughness, None, None, radiance


def _shared_backward(ctx, grad_sums):
    refuse_gradients(ctx, "summed_light", view_dirs=1, directions=3, solid_angles=4, visible=6, sent=7)
    normals, roughness, radiance = lib.summed_light_backward(*ctx.saved_tensors, grad_sums)
    return normals, None, roughness, None, None, radiance, None, None


def _keep_summed(ctx, inputs, output):
    ctx.save_for_backward(*inputs[:7], *inputs[8:])
    ctx.compensate = inputs[7]


def _summed_backward(ctx, grad):
    refuse_gradients(ctx, "shade_sums", lut=6, share=9)
    *points, other, share = ctx.saved_tensors
    *grads, grad_other = lib.shade_sums_backward(*points, ctx.compensate, other, share, grad)
    return *grads, None, None, None if other is None else grad_other, None


register(
    "monte_carlo_light",
    fake=lambda normals, *rest: normals.new_empty(normals.shape[0], len(LightSums._fields), 3),
    setup_context=_keep,
    backward=_backward,
)
register(
    "monte_carlo_light_backward",
    fake=lambda normals, view_dirs, roughness, light_dirs, pdf, radiance, grad_sums: (
        normals.new_empty(normals.shape),
        roughness.new_empty(roughness.shape),
        radiance.new_empty(radiance.shape),
    ),
)
register(
    "summed_light",
    fake=lambda normals, *rest: normals.new_empty(normals.shape[0], len(LightSums._fields), 3),
    setup_context=_keep,
    backward=_shared_backward,
)
register(
    "summed_light_backward",
    fake=lambda normals, view_dirs, roughness, directions, solid_angles, radiance, *rest: tuple(
        t.new_empty(t.shape) for t in (normals, roughness, radiance)
    ),
)
register(
    "shade_sums",
    fake=lambda normals, *rest: normals.new_empty(normals.shape),
    setup_context=_keep_summed,
    backward=_summed_backward,
)
register(
    "shade_sums_backward",
    fake=lambda *inputs: (
        *(t.new_empty(t.shape) for t in inputs[:6]),
        inputs[0].new_empty((0, 3) if inputs[8] is None else inputs[8].shape),
    ),
)
