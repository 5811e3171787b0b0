"""From sums over incoming light to outgoing light, in the material model of the split sum."""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops import LightSums, split_sum_shade


def radiance_of_sums(
    normals: Tensor,
    view_dirs: Tensor,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    sums: LightSums,
    *,
    compensate: bool,
) -> Tensor:
    """Outgoing radiance [n, 3]: Schlick's Fresnel term inside the sums, energy compensation, and the diffuse share
    that the specular lobe leaves.

    Args:
        normals, view_dirs: [n, 3] unit.
        albedo: [n, 3]. roughness, metallic: [n, 1].
        sums: Of the light at the points.
        compensate: Multiple scattering, as in :func:`splitnerf.ops.split_sum_shade`.

    Source: SplitNeRF Eq. (4)-(6).
    """

    def shade(specular: float, diffuse: float, compensate: bool) -> Tensor:
        one = torch.ones_like(albedo)
        return split_sum_shade(
            normals, view_dirs, albedo, roughness, metallic, specular * one, diffuse * one, one, one, "exact", compensate
        )

    f0 = _core.DIELECTRIC_F0 * (1.0 - metallic) + metallic * albedo
    gain = shade(1.0, 0.0, True) / shade(1.0, 0.0, False) if compensate else 1.0
    return gain * (f0 * (sums.specular - sums.grazing) + sums.grazing) + shade(0.0, 1.0, compensate) * sums.diffuse
