"""Derivatives of integrals over few directions with less noise, by a white light whose integrals are known."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.ops.shading import LightSums, brdf_lut
from splitnerf.refinement.texels import MIN_COSINE

MIN_WHITE = 1e-6  # integral of a white light below which a lobe got no directions


def white_sums(normals: Tensor, view_dirs: Tensor, roughness: Tensor) -> LightSums:
    """The integrals of a light of 1 from everywhere, [n, 1] each, by the table of :func:`splitnerf.ops.shading.brdf_lut`."""
    n_dot_v = (normals * view_dirs).sum(1, keepdim=True).clamp(MIN_COSINE, 1.0)
    at = 2.0 * torch.cat([n_dot_v.sqrt(), roughness.clamp(0.0, 1.0)], dim=1) - 1.0
    table = brdf_lut().permute(2, 0, 1)[None]
    f1, f2, _, dielectric = F.grid_sample(table, at[None, None], align_corners=True)[0, :, 0, :, None]
    return LightSums(specular=f1 + f2, grazing=f2, diffuse=torch.ones_like(f1), dielectric=dielectric)


def centred(sums: LightSums, drawn: LightSums, white: LightSums) -> LightSums:
    """Integrals of light whose derivatives by normal and roughness have less noise; their values stay.

    The derivative is that of the light less its mean over the lobe, by the directions drawn, and that of the mean, by
    the table (a control variate): where a lobe turns or widens, its integral of a white light hardly changes, but the
    sum over a few directions does.
    Source: Greensmith, Bartlett and Baxter 2004 (baselines of score-function derivatives).

    Args:
        sums: Integrals of the light.
        drawn: Integrals of a light of 1 over the same directions.
        white: The same without noise, from :func:`white_sums`.
    """
    of_specular, of_diffuse = (
        (light / one.clamp(min=MIN_WHITE)).detach()
        for light, one in ((sums.specular, drawn.specular), (sums.diffuse, drawn.diffuse))
    )
    means = sums._replace(specular=of_specular, grazing=of_specular, dielectric=of_specular, diffuse=of_diffuse)
    calmer = (exact - one for exact, one in zip(white, drawn))
    return LightSums(*(light + mean * (less - less.detach()) for light, mean, less in zip(sums, means, calmer)))
