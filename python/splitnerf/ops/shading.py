"""Shading: by the split sum, and by sums over directions.

The split sum asks the pre-integrated light where :func:`light_queries` says; :func:`split_sum_shade` makes radiance of the answers.
The sums hold the incoming light under the lobes of points; :func:`shade_sums` is the path tracer's BSDF under that light: a
metal with Schlick's Fresnel term and a diffuse base under a dielectric of index 1.5 with the exact one, mixed.

Source: SplitNeRF Eq. (4)-(10), (17); Karis 2013.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops._library import front, lib, register

FRESNEL_MODES = ("exact", "paper")
QUERIES = ("mean", "reflection")
SHADED = "normals view_dirs albedo roughness metallic specular diffuse occlusion_s occlusion_d".split()


@functools.lru_cache(maxsize=8)
def brdf_lut(device: torch.device | str = "cpu") -> Tensor:
    """The table of the split sum: [32 roughness, 32 sqrt(n.v), (F1, F2, chi, E_d)] float32, computed once.

    The directional albedo of a specular lobe with Schlick's Fresnel term is ``E = F0 F1 + F2`` (height-correlated Smith
    GGX, ggx_alpha = roughness squared), that of a dielectric of index 1.5 with the exact term is E_d; chi places the
    lobe's mean direction between normal and reflection.
    """
    with torch.inference_mode(False):  # a first call in inference mode must not make an inference tensor
        return torch.from_numpy(_core.brdf_lut()).to(device)


@front(n_rows=2, normals=1, view_dirs=1, roughness=1)
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

    Source: SplitNeRF Eq. (6)-(10).
    """
    if query not in QUERIES:
        raise ValueError(f"light_queries: query must be one of {QUERIES}, got {query!r}")
    return lib.light_queries(normals, view_dirs, roughness, brdf_lut(normals.device), query == "mean")


@front(**dict.fromkeys(SHADED, 1), indirect_s=1, indirect_d=1)
def split_sum_shade(
    normals: Tensor,
    view_dirs: Tensor,
    *,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    specular: Tensor,
    diffuse: Tensor | None = None,
    occlusion_s: Tensor | None = None,
    occlusion_d: Tensor | None = None,
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
        occlusion_s, occlusion_d: [n, 1] or [n, 3] occlusion factors in [0, 1], 1 = open; None: open everywhere.
        fresnel_mode: The form of the Fresnel term: ``exact`` (above) or ``paper``, which mixes the materials' reflectances,
            ``F0 = 0.04 (1 - m) + m albedo``, and applies the term twice, as published.
        compensate: Whether to compensate for multiple scattering: each lobe's ``E [1 + F0 (1/(F1 + F2) - 1)]`` with F0
            the albedo of the metal and 0.04 of the dielectric (Turquin 2019), as in Blender's Principled BSDF.
        indirect_s, indirect_d: [n, 3] light i_s and i_d >= 0 that the object itself sends to the points, in the
            normalisation of g, or None for none; no gradient.

    Returns:
        [n, 3] linear radiance.

    Source: SplitNeRF Eq. (6)-(10), (17), which have no indirect light.
    """
    if fresnel_mode not in FRESNEL_MODES:
        raise ValueError(f"split_sum_shade: fresnel_mode must be one of {FRESNEL_MODES}, got {fresnel_mode!r}")
    if occlusion_s is None:
        occlusion_s = torch.ones_like(roughness if occlusion_d is None else occlusion_d)
    if occlusion_d is None:
        occlusion_d = torch.ones_like(occlusion_s)
    points = normals, view_dirs, albedo, roughness, metallic
    light = specular, diffuse, occlusion_s, occlusion_d
    options = brdf_lut(normals.device), FRESNEL_MODES.index(fresnel_mode), compensate
    return lib.split_sum_shade(*points, *light, *options, indirect_s, indirect_d)


register(
    "light_queries",
    fake=lambda normals, *rest: (normals.new_empty(2 * len(normals), 3), normals.new_empty(2 * len(normals), 1)),
    gradients="normals roughness",
)
register("split_sum_shade", fake=lambda normals, *rest: normals.new_empty(normals.shape), gradients=" ".join(SHADED))


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


@front(normals=1, view_dirs=1, roughness=1, light_dirs=2, pdf=1, radiance=2)
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
    """
    return LightSums(*lib.monte_carlo_light(normals, view_dirs, roughness, light_dirs, pdf, radiance).unbind(1))


@front(normals=1, view_dirs=1, roughness=1, visible=1, sent=2)
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
    """
    nothing = normals.new_empty(0, len(directions), 3)
    sums = lib.summed_light(
        normals, view_dirs, roughness, directions, solid_angles, radiance, visible, nothing if sent is None else sent
    )
    return LightSums(*sums.unbind(1))


@front(normals=1, view_dirs=1, albedo=1, roughness=1, metallic=1, sums=1)
def shade_sums(
    normals: Tensor,
    view_dirs: Tensor,
    *,
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

    with E_d and the gains of multiple scattering as in :func:`splitnerf.ops.shading.split_sum_shade` in its ``exact`` mode.

    Args:
        normals, view_dirs: [n, 3] unit; a normal that faces away from the viewer is negated.
        albedo: [n, 3] linear, in [0, 1].
        roughness, metallic: [n, 1], in [0, 1].
        sums: The integrals of the light at the points, from :func:`monte_carlo_light` or :func:`summed_light`.
        compensate: Whether to compensate for multiple scattering (Turquin 2019).

    Returns:
        [n, 3] linear radiance.
    """
    for name, part in zip(LightSums._fields, sums):
        if part.shape != normals.shape:
            raise ValueError(f"shade_sums: {name} must be {list(normals.shape)}, got {list(part.shape)}")
    stacked, table = torch.stack(tuple(sums), 1), brdf_lut(normals.device)
    return lib.shade_sums(normals, view_dirs, albedo, roughness, metallic, stacked, table, compensate, None, None)


@front(normals=1, view_dirs=1, albedo=1, roughness=1, metallic=1, split=1, share=0, visible=1, sent=2)
def summed_correction(
    normals: Tensor,
    view_dirs: Tensor,
    *,
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

    Source: SplitNeRF Eq. (4)-(6), by quadrature.
    """
    sent = normals.new_empty(0, len(directions), 3) if sent is None else sent
    sums = lib.summed_light(normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent)
    table = brdf_lut(normals.device)
    return lib.shade_sums(normals, view_dirs, albedo, roughness, metallic, sums, table, compensate, split, share)


def _fake_sums(normals, *rest):
    return normals.new_empty(normals.shape[0], len(LightSums._fields), 3)


register("monte_carlo_light", fake=_fake_sums, gradients="normals roughness radiance")
register("summed_light", fake=_fake_sums, gradients="normals roughness radiance")
register(
    "shade_sums",
    fake=lambda normals, *rest: normals.new_empty(normals.shape),
    gradients="normals view_dirs albedo roughness metallic sums other",
)


@front()
def linear_to_srgb(linear: Tensor) -> Tensor:
    """Encodes linear values of any shape. Values below 0 count as 0; values above 1 are not clipped. Differentiable
    once.

    The slope is finite everywhere; at 0 it is 12.92.

    Source: IEC 61966-2-1.
    """
    return lib.linear_to_srgb(linear)


@front()
def srgb_to_linear(srgb: Tensor) -> Tensor:
    """Decodes sRGB values >= 0 of any shape. Values above 1 are not clipped. No gradient.

    Source: IEC 61966-2-1.
    """
    return lib.srgb_to_linear(srgb)


register("linear_to_srgb", fake=lambda linear: linear.new_empty(linear.shape), gradients="linear")
register("srgb_to_linear", fake=lambda srgb: srgb.new_empty(srgb.shape))
