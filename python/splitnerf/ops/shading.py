"""Split-sum shading: what it asks the pre-integrated light, and the outgoing radiance.

The operators are differentiable once in every floating input (``view_dirs`` included, the table
excluded); a second derivative raises.

Source: SplitNeRF Eq. (6)-(10), (17); Karis 2013.
"""

from __future__ import annotations

import functools

import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops._library import lib, refuse_gradients, register

FRESNEL_MODES = ("exact", "paper", "code")
QUERIES = ("mean", "reflection")


@functools.lru_cache(maxsize=8)
def _brdf_lut(device: torch.device) -> Tensor:
    with torch.inference_mode(False):  # a first call in inference mode must not make an inference tensor
        return torch.from_numpy(_core.brdf_lut()).to(device)


def brdf_lut(device: torch.device | str = "cpu") -> Tensor:
    """The table of the split sum: [32 roughness, 32 sqrt(n.v), (F1, F2, chi, E_d)] float32, computed once.

    The directional albedo of a specular lobe with Schlick's Fresnel term is ``E = F0 F1 + F2`` (height-correlated Smith
    GGX, ggx_alpha = roughness squared), that of a dielectric of index 1.5 with the exact term is E_d; chi places the
    lobe's mean direction between normal and reflection.
    """
    return _brdf_lut(torch.device(device))


def light_queries(normals: Tensor, view_dirs: Tensor, roughness: Tensor, query: str = "mean") -> tuple[Tensor, Tensor]:
    r"""Where shading looks the pre-integrated light up, for the specular and for the diffuse light at once.

    The specular lobe is looked up at

    .. math::

       d &= \mathrm{normalize}((1 - k)\, n + k\, w_r) \\
       k &= \mathrm{lerp}(1,\ \chi(n \cdot v, \rho),\ \mathrm{smoothstep}(0.3, 0.4, \rho))

    with the mirror direction :math:`w_r` and :math:`\chi` from :func:`brdf_lut`. A normal that faces away from the viewer is
    negated first.

    Args:
        normals: [n, 3] unit.
        view_dirs: [n, 3] unit, from the surface to the camera.
        roughness: [n, 1] perceptual roughness in [0, 1].
        query: The kind of direction: ``mean`` (d above) or ``reflection`` (w_r, the paper's form).

    Returns:
        directions [2 n, 3], unit: those of the lobes, then the normals on the viewer's side.
        roughness [2 n, 1]: the points' own, then 1.
        Differentiable once in normals and roughness.

    Raises:
        ValueError: A shape, dtype or the name of the query does not fit.

    Source: SplitNeRF Eq. (6)-(10).
    """
    if query not in QUERIES:
        raise ValueError(f"light_queries: query must be one of {QUERIES}, got {query!r}")
    return lib.light_queries(normals, view_dirs, roughness, brdf_lut(normals.device), query == "mean")


def split_sum_shade(
    normals: Tensor,
    view_dirs: Tensor,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    specular: Tensor,
    diffuse: Tensor | None,
    occlusion_s: Tensor,
    occlusion_d: Tensor,
    fresnel_mode: str = "exact",
    compensate: bool = False,
    indirect_s: Tensor | None = None,
    indirect_d: Tensor | None = None,
) -> Tensor:
    r"""Outgoing linear radiance of points under the pre-integrated light, in one pass.

    .. math::

       L = (1 - m)(1 - E_d)\, albedo\, \left(o_d\, g(n, 1) + i_d\right)
           + \left[m\, (albedo\, F_1 + F_2) + (1 - m)\, E_d\right] \left(o_s\, g(d, \rho) + i_s\right)

    A metal with Schlick's Fresnel term and a diffuse base under a dielectric of index 1.5 with the exact one are mixed, as the
    path tracer and Blender have it. g(n, 1) is irradiance / pi, so no further pi appears.

    Args:
        normals, view_dirs: [n, 3] unit; a normal that faces away from the viewer is negated.
        albedo: [n, 3] linear, in [0, 1].
        roughness, metallic: [n, 1], in [0, 1].
        specular: [n, 3] radiance g(d, rho); d from :func:`light_queries`. Or, with ``diffuse`` None, [2 n, 3]: what
            the light answers to :func:`light_queries`, g(d, rho) of all points and then g(n, 1) of all.
        diffuse: [n, 3] radiance g(n, 1), or None.
        occlusion_s, occlusion_d: [n, 1] or [n, 3] occlusion factors in [0, 1], 1 = open.
        fresnel_mode: The form of the Fresnel term: ``exact`` (above), ``paper`` or ``code``. The last two mix the
            materials' reflectances, ``F0 = 0.04 (1 - m) + m albedo``, and apply the term twice, as published.
        compensate: Whether to compensate for multiple scattering: each lobe's ``E [1 + F0 (1/(F1 + F2) - 1)]`` with F0
            the albedo of the metal and 0.04 of the dielectric (Turquin 2019), as in Blender's Principled BSDF.
        indirect_s, indirect_d: [n, 3] light i_s and i_d >= 0 that the object itself sends to the points, in the
            normalisation of g, or None for none; no gradient.

    Returns:
        [n, 3] linear radiance.

    Raises:
        ValueError: A shape, dtype or mode does not fit.

    Source: SplitNeRF Eq. (6)-(10), (17), which have no indirect light.
    """
    if fresnel_mode not in FRESNEL_MODES:
        raise ValueError(f"split_sum_shade: fresnel_mode must be one of {FRESNEL_MODES}, got {fresnel_mode!r}")
    return lib.split_sum_shade(
        normals,
        view_dirs,
        albedo,
        roughness,
        metallic,
        specular,
        diffuse,
        occlusion_s,
        occlusion_d,
        brdf_lut(normals.device),
        FRESNEL_MODES.index(fresnel_mode),
        compensate,
        indirect_s,
        indirect_d,
    )


def _keep_query(ctx, inputs, output):
    ctx.save_for_backward(*inputs[:4])
    ctx.mean = inputs[4]


def _queries_backward(ctx, *grads):
    refuse_gradients(ctx, "light_queries", view_dirs=1, lut=3)
    grad_normals, grad_roughness = lib.light_queries_backward(*ctx.saved_tensors, ctx.mean, *grads)
    return grad_normals, None, grad_roughness, None, None


def _keep_shade(ctx, inputs, output):
    ctx.save_for_backward(*inputs[:10], *inputs[12:])
    ctx.options = inputs[10:12]


def _shade_backward(ctx, grad):
    refuse_gradients(ctx, "split_sum_shade", lut=9, indirect_s=12, indirect_d=13)
    *points, indirect_s, indirect_d = ctx.saved_tensors
    grads = list(lib.split_sum_shade_backward(*points, *ctx.options, indirect_s, indirect_d, grad))
    if points[6] is None:
        grads[6] = None
    return *grads, None, None, None, None, None


register(
    "light_queries",
    fake=lambda normals, *rest: (
        normals.new_empty(2 * normals.shape[0], 3),
        normals.new_empty(2 * normals.shape[0], 1),
    ),
    setup_context=_keep_query,
    backward=_queries_backward,
)
register(
    "light_queries_backward",
    fake=lambda normals, view_dirs, roughness, *rest: tuple(t.new_empty(t.shape) for t in (normals, roughness)),
)
register(
    "split_sum_shade",
    fake=lambda normals, *rest: normals.new_empty(normals.shape),
    setup_context=_keep_shade,
    backward=_shade_backward,
)
register(
    "split_sum_shade_backward",
    fake=lambda normals, *rest: tuple(
        normals.new_empty((0, 3) if t is None else t.shape) for t in (normals, *rest[:8])
    ),
)
