"""Gauss-Newton steps of all texels: what the photos say of each, gathered over batches, and a prior that joins them."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class Prior(NamedTuple):
    """What holds the unknowns where photos say little, in units of each unknown's mean curvature.

    Attributes:
        pairs: [k, 2] int64, texels that are neighbours.
        smooth: [n] weight of the differences between the steps of neighbours.
        anchor: [n] weight of the distance to the start.
    """

    pairs: Tensor
    smooth: Tensor
    anchor: Tensor


class NormalEquations:
    """Sums J^T W J and J^T W r of texels, m of them with n unknowns each; texels are joined by the prior alone.

    A pixel's value depends on the four texels around each of its points. Each texel gets its bilinear share of the whole
    sums, so that the curvature is never below the true one: steps fall short rather than overshoot.

    Derivatives are estimates, and their squares hold the variance of their noise. That shortens the steps of what a photo
    says little about. (Scaled down to what the products of a pixel's two rays say, roughness and metallic drifted.)

    Args:
        start: [m, n] unknowns at the start.
        prior: The prior.
        keep: The share of the sums that outlives a step, in [0, 1). They are carried to the new unknowns as if the photos
            were linear functions of them.
    """

    def __init__(self, start: Tensor, prior: Prior, keep: float):
        self.start, self.prior, self.keep = start, prior, keep
        self.curvature = start.new_zeros(*start.shape, start.shape[1])
        self.gradient = torch.zeros_like(start)

    def add(self, texels: Tensor, shares: Tensor, jacobian: Tensor, weights: Tensor, residual: Tensor) -> None:
        """Adds observations, b in all.

        Args:
            texels: [b, 4] int64 the texels around each point.
            shares: [b, 4] bilinear.
            jacobian: [b, 3, n] derivatives of the colours by the unknowns at the point.
            weights: [b, 3] of the squared errors.
            residual: [b, 3] predicted minus observed colours, its noise independent of the Jacobian's.
        """
        weighted = jacobian * weights[..., None]
        gradient = torch.einsum("bcn,bc->bn", weighted, residual)
        curvature = torch.einsum("bcn,bck->bnk", weighted, jacobian).flatten(1)
        at, share = texels.flatten(), shares.reshape(-1, 1)
        self.gradient.index_add_(0, at, gradient.repeat_interleave(4, 0) * share)
        self.curvature.flatten(1).index_add_(0, at, curvature.repeat_interleave(4, 0) * share)

    def _differences(self, values: Tensor, weights: Tensor) -> Tensor:
        """Gradient of half the weighted squared differences of neighbours."""
        i, j = self.prior.pairs.unbind(1)
        apart = (values[i] - values[j]) * weights
        return torch.zeros_like(values).index_add_(0, i, apart).index_add_(0, j, -apart)

    @torch.no_grad()
    def step(self, unknowns: Tensor, n_iterations: int = 20) -> Tensor:
        """The Gauss-Newton step [m, n] from unknowns [m, n], by conjugate gradients with each texel's inverse before.

        Source: Nocedal and Wright 2006, section 10.3 and Algorithm 5.3.
        """
        typical = self.curvature.diagonal(dim1=1, dim2=2).mean(0)  # of each unknown
        smooth, anchor = self.prior.smooth * typical, self.prior.anchor * typical
        system = self.curvature + torch.diag(anchor + 1e-12)
        n_neighbours = torch.bincount(self.prior.pairs.flatten(), minlength=len(unknowns))
        before = torch.linalg.inv(system + torch.diag_embed(n_neighbours[:, None] * smooth))

        def product(x: Tensor) -> Tensor:
            return torch.einsum("mnk,mk->mn", system, x) + self._differences(x, smooth)

        step = torch.zeros_like(unknowns)
        rest = -(self.gradient + anchor * (unknowns - self.start))
        towards = along = torch.einsum("mnk,mk->mn", before, rest)
        size = (rest * towards).sum()
        for _ in range(n_iterations):
            image = product(along)
            length = size / (along * image).sum().clamp(min=1e-30)
            step = step + length * along
            rest = rest - length * image
            towards = torch.einsum("mnk,mk->mn", before, rest)
            size, old = (rest * towards).sum(), size
            along = towards + (size / old.clamp(min=1e-30)) * along
        return step

    @torch.no_grad()
    def move(self, step: Tensor) -> None:
        """Carries the sums along a step [m, n] that was taken, and lets older observations fade."""
        self.gradient = self.keep * (self.gradient + torch.einsum("mnk,mk->mn", self.curvature, step))
        self.curvature *= self.keep
