"""Gauss-Newton steps of all texels: equations from the photos, summed over batches, and a prior that joins texels."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.refinement.conjugate_gradients import conjugate_gradients
from splitnerf.refinement.texels import TexelPairs
from splitnerf.refinement.unknowns import GLOSS

EDGE = 0.05  # length of the differences between neighbours from which on they count as an edge
APART = 0.3  # distance of roughness or metallic to the usual one from which on that pulls less


class Prior(NamedTuple):
    """The prior of the unknowns where photos determine them poorly, in units of each unknown's mean curvature.

    Attributes:
        pairs: Texels that are neighbours.
        smooth: [n] weight of the differences between the steps of neighbours.
        flat: [n] weight of the differences d between the values of neighbours; their cost is log(1 + (d / EDGE)^2), so
            that small differences are smoothed and edges are kept (Black and Anandan 1996).
        groups: Numbers of unknowns, in order, that have their edges in common.
        anchor: [n] weight of the distance to the start.
        like: [2] weights of the distances d of roughness and metallic to the usual ones; their cost is log(1 + (d / APART)^2).
    """

    pairs: TexelPairs
    smooth: Tensor
    flat: Tensor
    groups: tuple[int, ...]
    anchor: Tensor
    like: Tensor

    def flatness(self, unknowns: Tensor) -> Tensor:
        """[k, n] the weights by which squared differences have the gradient of their cost at unknowns [m, n]."""
        squared = (self.pairs.differences(unknowns) / EDGE).square().split(self.groups, dim=1)
        lengths = torch.cat([part.sum(1, keepdim=True).expand_as(part) for part in squared], dim=1)
        return self.flat / (1.0 + lengths)


class NormalEquations:
    """Sums J^T W J and J^T W r of texels, m of them with n unknowns each; texels are joined by the prior alone.

    A pixel's value depends on the four texels around each of its points. Each texel gets its bilinear share of the
    whole sums, so that the curvature is never below the true one: steps fall short rather than overshoot.

    Derivatives are estimates, and their squares hold the variance of their noise. That shortens the steps of unknowns
    that a photo determines poorly. (Scaled down to the products of a pixel's two rays, roughness and metallic drifted.)

    `start` [m, n] are the unknowns at the start; `keep`, in [0, 1), is the share of the sums that is kept after a step. They are carried to the
    new unknowns as if the photos were linear functions of them.
    """

    def __init__(self, start: Tensor, prior: Prior, keep: float):
        self.start, self.prior, self.keep = start, prior, keep
        self.curvature = start.new_zeros(*start.shape, start.shape[1])
        self.gradient = torch.zeros_like(start)

    def add(self, texels: Tensor, shares: Tensor, jacobian: Tensor, weights: Tensor, residual: Tensor) -> None:
        """Adds b observations: the texels [b, 4] around each point with their bilinear shares, the derivatives [b, 3, n] of its colours by the
        unknowns there, the weights [b, 3] of the squared errors, and predicted minus observed colours [b, 3], whose noise is independent
        of the derivatives'."""
        weighted = jacobian * weights[..., None]
        gradient = torch.einsum("bcn,bc->bn", weighted, residual)
        curvature = torch.einsum("bcn,bck->bnk", weighted, jacobian).flatten(1)
        at, share = texels.flatten(), shares.reshape(-1, 1)
        self.gradient.index_add_(0, at, gradient.repeat_interleave(4, 0) * share)
        self.curvature.flatten(1).index_add_(0, at, curvature.repeat_interleave(4, 0) * share)

    def _differences(self, values: Tensor, weights: Tensor) -> Tensor:
        """Gradient of half the weighted squared differences of neighbours."""
        return self.prior.pairs.adjoint(self.prior.pairs.differences(values) * weights)

    @torch.no_grad()
    def step(self, unknowns: Tensor, usual: Tensor | None, n_iterations: int = 20) -> Tensor:
        """The Gauss-Newton step [m, n] from unknowns [m, n]; the prior's costs by iteratively reweighted least squares (Nocedal and
        Wright 2006, section 10.3). `usual` [m, 2] are roughness and metallic that texels are drawn to; NaN or None: to none."""
        prior = self.prior
        typical = self.curvature.diagonal(dim1=1, dim2=2).mean(0)  # of each unknown
        flat = prior.flatness(unknowns) * typical
        smooth = flat + prior.smooth * typical
        anchor, unlike, pull = prior.anchor * typical, torch.zeros_like(unknowns), torch.zeros_like(unknowns)
        if usual is not None:
            unlike[:, GLOSS] = torch.where(usual.isnan(), 0.0, unknowns[:, GLOSS] - usual)
            weights = prior.like * typical[GLOSS] / (1.0 + (unlike[:, GLOSS] / APART).square())
            pull[:, GLOSS] = torch.where(usual.isnan(), 0.0, weights)
        system = self.curvature + torch.diag_embed(anchor + pull + 1e-12)
        inverses = torch.linalg.inv(system + torch.diag_embed(prior.pairs.sums(smooth)))
        down = self.gradient + anchor * (unknowns - self.start) + pull * unlike + self._differences(unknowns, flat)
        return conjugate_gradients(
            lambda x: torch.einsum("mnk,mk->mn", system, x) + self._differences(x, smooth),
            lambda x: torch.einsum("mnk,mk->mn", inverses, x),
            -down,
            n_iterations,
        )

    @torch.no_grad()
    def move(self, step: Tensor) -> None:
        """Carries the sums along a step [m, n] that was taken, and lets older observations fade."""
        self.gradient = self.keep * (self.gradient + torch.einsum("mnk,mk->mn", self.curvature, step))
        self.curvature *= self.keep
