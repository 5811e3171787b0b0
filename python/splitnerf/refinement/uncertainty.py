"""How far each part of a texture is settled by the photos: an information matrix for each patch of the surface.

The two rays of a pixel estimate its derivatives independently. The product of one ray's derivatives with the other's is the
information without the noise of the tracing (in expectation); a square would hold the noise's variance, and everything
would look known.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset
from splitnerf.data.lens import pixel_width
from splitnerf.refinement.texels import AssetTexels
from splitnerf.refinement.unknowns import MAX_TILT, N_UNKNOWNS, per_unknown

PATCH_PIXELS = 2.0  # width of a patch, in pixels of the photos
N_EVEN = 50.0  # pixels of a patch by which what the fit leaves there is drawn to what it leaves anywhere
LEAST_SHARE = 0.1  # of what the fit leaves anywhere: no patch counts as explained better
QUANTISATION = 1.0 / (255.0**2 * 12.0)  # variance of a value rounded to 8 bits
# Standard deviations before any photo: a number is anywhere between 0 and 1, a tilt anywhere in its range.
UNINFORMED = per_unknown(12**-0.5, 12**-0.5, MAX_TILT * 3**-0.5)


UNKNOWN = torch.cat([UNINFORMED[[0, 3, 4]], UNINFORMED[5:].norm(keepdim=True)]) * 0.5**0.5
"""[4] deviations, in the order of the map, from which a value counts as unknown: more than half of its variance before any
photo is left."""


class Uncertainty(NamedTuple):
    """What the photos leave open, texel by texel.

    Attributes:
        map: [h, w, 4] float32 standard deviations of albedo^(1/2.2) (root mean square of the channels), roughness, metallic,
            and the normal (radians).
        noise: Variance of a pixel's value around the fit, in sRGB units.
        saturated: The share of the covered pixels' values that the photos clip.
    """

    map: np.ndarray
    noise: float
    saturated: float


class Information:
    """Sums over pixels, for each patch of texels: J^T W J of a pixel's three values by a patch's unknowns, and squared errors.

    A patch is a square of a chart about as wide as PATCH_PIXELS pixels: photos say nothing of single finer texels.

    Args:
        texels: The texels, m of them.
        width: The edge of a patch in texels.
        n_pixels: The number of the photos' covered pixels.
    """

    def __init__(self, texels: AssetTexels, width: int, n_pixels: int):
        row, column = np.divmod(texels.index, texels.size)
        _, patch = np.unique(np.stack([row // width, column // width, texels.chart]), axis=1, return_inverse=True)
        self.patch_of = torch.from_numpy(patch.reshape(-1).astype(np.int64))
        n = int(self.patch_of.max()) + 1 if len(self.patch_of) else 0
        self.n_pixels = n_pixels
        self.sums, self.n_seen = torch.zeros(n, N_UNKNOWNS**2), 0
        self.errors = torch.zeros(n, 2)  # sums of squared errors, and of pixels

    def add(self, texels: Tensor, shares: Tensor, jacobian: Tensor, weights: Tensor, errors: Tensor) -> None:
        """Adds b pixels, each by two rays in turn; errors [b] are squared, without noise, other arguments as for
        `NormalEquations.add`. Half of a pixel counts for the patch of each ray."""
        one, other = jacobian.view(-1, 2, 3, N_UNKNOWNS).unbind(1)
        product = torch.einsum("bcn,bc,bck->bnk", one, weights[::2], other)
        product = (0.25 * (product + product.transpose(1, 2))).flatten(1).repeat_interleave(2, 0)
        patch = self.patch_of[texels.gather(1, shares.argmax(1, keepdim=True))[:, 0]]
        self.sums.index_add_(0, patch, product)
        of_pixels = 0.5 * torch.stack([errors, torch.ones_like(errors)], dim=1)
        self.errors.index_add_(0, patch, of_pixels.repeat_interleave(2, 0))
        self.n_seen += len(one)

    def uneven(self) -> Tensor:
        """[patches] the errors that the fit leaves in a patch, as shares of those that it leaves in all; 1 where it
        leaves none. The errors are those before all steps, the first ones too."""
        error, n = self.errors.unbind(1)
        mean = error.sum() / n.sum().clamp(min=1.0)
        if mean <= 0:
            return torch.ones_like(error)
        return ((error / mean + N_EVEN) / (n + N_EVEN)).clamp(min=LEAST_SHARE)

    def covariance(self, left_over: float) -> Tensor:
        """[patches, n, n] the covariance of each patch's unknowns, all else given.

        What the fit leaves unexplained counts as noise that the pixels of a patch share within a photo, and that photos do
        not share. Where it leaves more than elsewhere, the model is wrong (details finer than a pixel, say), and less is known.

        Args:
            left_over: The variance of a pixel's value around the fit, without that of its rounding.
        """
        noise = (left_over * self.uneven() + QUANTISATION)[:, None]
        share = self.n_pixels / max(self.n_seen, 1) / PATCH_PIXELS**2
        values, vectors = torch.linalg.eigh(share * self.sums.view(-1, N_UNKNOWNS, N_UNKNOWNS))
        informed = vectors @ ((values.clamp(min=0.0) / noise)[..., None] * vectors.transpose(1, 2))
        return torch.linalg.inv(informed + torch.diag(UNINFORMED**-2))

    def deviations(self, left_over: float) -> Tensor:
        """[m, 4] standard deviations of the texels, see :class:`Uncertainty`."""
        variances = self.covariance(left_over).diagonal(dim1=1, dim2=2)
        albedo, roughness, metallic, tilt = variances.split([3, 1, 1, 2], dim=1)
        of_patch = torch.cat([albedo.mean(1, keepdim=True), roughness, metallic, tilt.sum(1, keepdim=True)], dim=1).sqrt()
        return of_patch[self.patch_of]


def patch_width(dataset: Dataset, texels: AssetTexels) -> int:
    """The edge of a patch in texels."""
    asset = texels.asset
    a, b, c = (asset.vertices[asset.triangles[:, i]].astype(np.float64) for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    pixel = pixel_width(dataset.world_poses, dataset.intrinsics, asset.vertices.mean(0))
    return max(1, round(PATCH_PIXELS * pixel / np.sqrt(area / max(len(texels.index), 1))))


def uncertainty_of(information: Information, texels: AssetTexels, error: float, saturated: float) -> Uncertainty:
    """The map of what the photos leave open.

    Args:
        information: What was gathered of the photos.
        texels: The texels of it.
        error: The mean squared error that the fit leaves, without the noise of the tracing, in sRGB units.
        saturated: The share of the photos' values that are clipped.
    """
    return Uncertainty(texels.spread(information.deviations(error)).numpy(), error + QUANTISATION, saturated)


def painted_with(asset: Asset, deviations: np.ndarray) -> Asset:
    """The asset with the map of :class:`Uncertainty` in place of its albedo (three values) and roughness (the normal's), so
    that a renderer's maps show what is unsettled of each point."""
    material = replace(
        asset.materials[0], albedo_texture=np.ascontiguousarray(deviations[..., :3], np.float32),
        roughness_metallic_texture=np.dstack([deviations[..., 3], np.zeros_like(deviations[..., 3])]).astype(np.float32),
    )  # fmt: skip
    return replace(asset, materials=[material])
