"""The radiance field of a whole photographed place: object, table and room in one hash grid over contracted space."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from splitnerf.ops import HashGrid, HashGridSpec
from torch import Tensor, nn
from torch.nn import functional as F

FIRST_CELLS = 16  # along an edge of the coarsest level
FINE = dict(n_levels=10, n_features=2, base_resolution=FIRST_CELLS, log2_table_size=17), 640  # the finest level's cells
COARSE = dict(n_levels=5, n_features=2, base_resolution=FIRST_CELLS, log2_table_size=15), 160
WIDTH, FEATURES = 32, 15
CORE = 0.7  # distance from a ray's point next to the origin within which its samples stand evenly, scene units
NEAR, FAR = 0.1, 300.0  # distances from the camera, scene units
FULL_GRADIENT = 1.5  # distance from the camera from which samples have their whole gradient
FIRST_LOG = -2.5  # of the density at the start, per scene unit: light passes the whole place
LARGEST_LOG = 11.0  # of a density
LEAST_WEIGHT = 1e-4  # of a sample whose colour is asked
BLUR = 0.01  # weight that every interval of the first search keeps


class Rendered(NamedTuple):
    """The rendering of n rays with k samples each."""

    colour: Tensor | None  # [n, 3] sRGB; None where it was not asked for
    weights: Tensor  # [n, k] shares of the colour; they sum to 1
    distances: Tensor  # [n, k] from the camera, scene units, the middles of the samples
    edges: Tensor  # [n, k + 1] the samples' limits in [0, 1], the rays' own measure
    first_weights: Tensor  # [n, m] those of the first search
    first_edges: Tensor  # [n, m + 1] those of the first search


def contracted(positions: Tensor) -> Tensor:
    """Points [..., 3] of all space in the ball of radius 2; those within 1 of the origin stay (mip-NeRF 360, Eq. (10))."""
    length = positions.norm(dim=-1, keepdim=True).clamp(min=1.0)
    return positions * ((2.0 - 1.0 / length) / length)


class RadianceField(nn.Module):
    """Density and colour everywhere, and a coarse density that tells where on a ray to look.

    The last sample of a ray is opaque, so that what is endlessly far has its place in the field too.

    Source: hash grid: Mueller et al. 2022; the search by a coarse density: mip-NeRF 360 (Barron et al. 2022).
    """

    def __init__(self) -> None:
        super().__init__()
        self.fine, self.coarse = (
            HashGrid(HashGridSpec(**shape, growth=math.exp(math.log(cells / FIRST_CELLS) / (shape["n_levels"] - 1))))
            for shape, cells in (FINE, COARSE)
        )
        self.trunk = nn.Sequential(
            nn.Linear(self.fine.spec.n_outputs, WIDTH), nn.ReLU(True), nn.Linear(WIDTH, 1 + FEATURES)
        )
        self.first = nn.Sequential(nn.Linear(self.coarse.spec.n_outputs, 16), nn.ReLU(True), nn.Linear(16, 1))
        self.head = nn.Sequential(
            nn.Linear(FEATURES + 9, WIDTH), nn.ReLU(True), nn.Linear(WIDTH, WIDTH), nn.ReLU(True), nn.Linear(WIDTH, 3)
        )

    def render(
        self,
        rays_o: Tensor,
        rays_d: Tensor,
        n_first: int,
        n: int,
        jitter: bool = False,
        hidden: Callable[[Tensor], Tensor] | None = None,
        coloured: bool = True,
    ) -> Rendered:
        """Renders rays.

        Args:
            rays_o, rays_d: [n, 3] origins (scene units) and unit directions.
            n_first, n: The numbers of samples of the first search and of the second one.
            jitter: Whether the samples stand at random places within their intervals.
            hidden: Tells of points [..., 3] whether they are left out; None: none is.
        """
        measure = RayMeasure(rays_o, rays_d)
        edges = torch.linspace(0, 1, n_first + 1, device=rays_o.device).expand(len(rays_o), -1)
        if jitter:
            shift = (torch.rand_like(edges[:, 1:-1]) - 0.5) / n_first
            edges = torch.cat([edges[:, :1], edges[:, 1:-1] + shift, edges[:, -1:]], dim=1)
        points = measure.points(edges)
        first_out = self.first(self._encoded(self.coarse, points))[..., 0]
        first_density = self._without(first_out + FIRST_LOG, points, hidden)
        first = self._weights(first_density, measure.distances(edges))
        finer = resampled(edges, first.detach(), n, jitter)
        points, distances = measure.points(finer), measure.distances(finer)
        middles = measure.distances(0.5 * (finer[:, 1:] + finer[:, :-1]))
        out = with_less_gradient(self.trunk(self._encoded(self.fine, points)), middles)
        weights = self._weights(self._without(out[..., 0] + FIRST_LOG, points, hidden), distances)
        colour = self._colour(weights, out[..., 1:], rays_d) if coloured else None
        return Rendered(colour, weights, middles, finer, first, edges)

    def _colour(self, weights: Tensor, features: Tensor, rays_d: Tensor) -> Tensor:
        """[n, 3] the sums of the samples' colours; those of samples [n, k] that hardly count are not asked."""
        ray, sample = (~(weights.detach() <= LEAST_WEIGHT)).nonzero(as_tuple=True)  # NaN too
        colours = torch.sigmoid(self.head(torch.cat([features[ray, sample], harmonics(rays_d)[ray]], dim=-1)))
        return torch.zeros_like(rays_d).index_add(0, ray, weights[ray, sample, None] * colours)

    @staticmethod
    def _without(log_density: Tensor, points: Tensor, hidden: Callable[[Tensor], Tensor] | None) -> Tensor:
        return log_density if hidden is None else log_density.masked_fill(hidden(points), -math.inf)

    @staticmethod
    def _encoded(grid: HashGrid, points: Tensor) -> Tensor:
        unit = (contracted(points) * 0.25 + 0.5).reshape(-1, 3)
        return grid(unit).view(*points.shape[:-1], -1)

    @staticmethod
    def _weights(log_density: Tensor, distances: Tensor) -> Tensor:
        """The samples' shares [n, k] by their log densities [n, k] and limits [n, k + 1]."""
        depth = log_density.clamp(max=LARGEST_LOG).exp() * distances.diff(dim=1)
        before = F.pad(depth[:, :-1].cumsum(1), (1, 0))
        alpha = torch.cat([-torch.expm1(-depth[:, :-1]), torch.ones_like(depth[:, -1:])], dim=1)
        return torch.exp(-before) * alpha


def with_less_gradient(values: Tensor, distances: Tensor) -> Tensor:
    """Values [n, k, c] whose gradients fall with the square of their samples' distance [n, k] from the camera: near it, points have
    more samples, and fog would form there. Source: Philip and Deschaintre 2023 (Floaters No More), Eq. (5)."""
    share = (distances / FULL_GRADIENT).square().clamp(max=1)[..., None]
    return values * share + (values * (1 - share)).detach()


class RayMeasure:
    """A measure of rays [n, 3] from 0 at the near limit to 1 at the far one: t = t0 + CORE sinh(...), where t0 is the distance of
    the point next to the origin. Its steps are even near the origin and grow with the distance from it."""

    def __init__(self, rays_o: Tensor, rays_d: Tensor):
        self.rays_o, self.rays_d = rays_o, rays_d
        self.nearest = -(rays_o * rays_d).sum(1, keepdim=True).clamp(max=0)
        self.low, self.high = (torch.asinh((t - self.nearest) / CORE) for t in (NEAR, FAR))

    def distances(self, u: Tensor) -> Tensor:
        """Distances [n, k] from the camera of values u [n, k] in [0, 1]."""
        return self.nearest + CORE * torch.sinh(self.low + u * (self.high - self.low))

    def points(self, edges: Tensor) -> Tensor:
        """[n, k, 3] the middles of intervals with these limits [n, k + 1]."""
        t = self.distances(0.5 * (edges[:, 1:] + edges[:, :-1]))
        return self.rays_o[:, None] + t[..., None] * self.rays_d[:, None]


def resampled(edges: Tensor, weights: Tensor, n: int, jitter: bool) -> Tensor:
    """[rays, n + 1] limits that part the weights [rays, m] between limits [rays, m + 1] into equal shares."""
    wide = F.pad(weights[:, None], (1, 1), mode="replicate")
    wide = F.max_pool1d(wide, 2, 1)
    wide = 0.5 * (wide[..., 1:] + wide[..., :-1])[:, 0] + BLUR / weights.shape[1]
    cumulative = F.pad(wide.cumsum(1), (1, 0))
    cumulative = cumulative / cumulative[:, -1:]
    u = torch.linspace(0, 1, n + 1, device=edges.device).expand(len(edges), -1).contiguous()
    if jitter:
        u = (u + (torch.rand_like(u) - 0.5) / n).clamp(0, 1)
        u[:, 0], u[:, -1] = 0, 1
    above = torch.searchsorted(cumulative, u, right=True).clamp(1, weights.shape[1])
    c0, c1 = cumulative.gather(1, above - 1), cumulative.gather(1, above)
    e0, e1 = edges.gather(1, above - 1), edges.gather(1, above)
    return e0 + (e1 - e0) * ((u - c0) / (c1 - c0).clamp(min=1e-9)).clamp(0, 1)


def harmonics(d: Tensor) -> Tensor:
    """[n, 9] the polynomials of the real spherical harmonics up to degree 2 at unit directions [n, 3], without factors."""
    x, y, z = d.unbind(1)
    return torch.stack([torch.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], dim=1)


def search_loss(rendered: Rendered) -> Tensor:
    """What the samples' weights exceed those of the first search on the intervals that they overlap (mip-NeRF 360, Eq. (13))."""
    cumulative = F.pad(rendered.first_weights.cumsum(1), (1, 0))
    first, n = rendered.first_edges.contiguous(), rendered.first_weights.shape[1]
    low = torch.searchsorted(first, rendered.edges[:, :-1].contiguous(), right=True).sub(1).clamp(0, n)
    high = torch.searchsorted(first, rendered.edges[:, 1:].contiguous()).clamp(0, n)
    bound = cumulative.gather(1, high) - cumulative.gather(1, low)
    w = rendered.weights.detach()
    return ((w - bound).clamp(min=0).square() / (w + 1e-7)).sum(1).mean()


def spread_loss(rendered: Rendered) -> Tensor:
    """How far apart on a ray its weights stand: the mean distance of two, in the rays' measure (mip-NeRF 360, Eq. (15))."""
    w, edges = rendered.weights, rendered.edges
    middles, widths = 0.5 * (edges[:, 1:] + edges[:, :-1]), edges.diff(dim=1)
    weight_before = w.cumsum(1) - w
    moment_before = (w * middles).cumsum(1) - w * middles
    pairs = 2 * (w * (middles * weight_before - moment_before)).sum(1)
    return (pairs + (w.square() * widths).sum(1) / 3).mean()
