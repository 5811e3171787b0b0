"""Occlusion factors: what every kind of them answers, and the paper's network."""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor, nn

from splitnerf.fields.heads import relu_mlp
from splitnerf.fields.light import EvaluatedLight
from splitnerf.ops import MeshScene, VisibilityCache


class OcclusionQuery(NamedTuple):
    """Points whose occlusion factors are asked for; each kind reads what it needs.

    Attributes:
        inputs: [n, n_inputs], what the heads read.
        positions: [n, 3] on the surface.
        normals: [n, 3] unit, out of the surface.
        lobe_dirs: [n, 3] unit, axis of the specular lobe.
        roughness: [n, 1].
    """

    inputs: Tensor
    positions: Tensor
    normals: Tensor
    lobe_dirs: Tensor
    roughness: Tensor


class RaySegments(NamedTuple):
    """Stretches of rays, each on one surface, and which points are on which.

    Attributes:
        leaders: [k] int64, the point of each segment that speaks for it.
        segment: [n] int64, the segment of each point.
    """

    leaders: Tensor
    segment: Tensor


class Occlusion(NamedTuple):
    """Which share of the light arrives, and what arrives from the object itself.

    Attributes:
        diffuse, specular: o_d and o_s, [n, 1] or [n, 3], 1 = open.
        indirect_diffuse, indirect_specular: [n, 3] linear, in the normalisation of g(n, 1) and g(d, rho), or None.
    """

    diffuse: Tensor
    specular: Tensor
    indirect_diffuse: Tensor | None = None
    indirect_specular: Tensor | None = None


class TracedBits(NamedTuple):
    """What the vertices of a mesh see.

    Attributes:
        cache: The bits, on the CPU.
        is_unoccluded: Whether hardly anything is blocked: the surface is convex, near enough.
    """

    cache: VisibilityCache
    is_unoccluded: bool


class OcclusionModel(nn.Module, abc.ABC):
    """What every kind of occlusion answers. Before its first mesh everything is open: all factors are 1.

    A mesh goes one way: :meth:`trace` computes from it what the kind keeps, :meth:`use` takes that over, and calls read it.

    Args:
        n_channels: 1 averages the factors over the colour channels, 3 keeps them.

    Attributes:
        needs_mesh: Whether meshes change what this kind answers.
        ready: Whether the first mesh was taken over.
        is_unoccluded: Whether the mesh in use is convex, near enough: nothing is looked up, all factors are 1.
    """

    needs_mesh = True
    is_unoccluded = False

    def __init__(self, n_channels: int):
        super().__init__()
        self.n_channels, self.ready = n_channels, False

    def forward(self, query: OcclusionQuery, segments: RaySegments | None = None) -> Occlusion:
        """The factors at surface points; the geometry gets no gradient.

        Args:
            query: The points.
            segments: The stretches of rays that the points are on, where one answer may serve a whole stretch.
        """
        if not self.ready or self.is_unoccluded:
            ones = torch.ones_like(query.roughness).expand(-1, self.n_channels)
            return Occlusion(ones, ones)
        return self.answer(OcclusionQuery(query.inputs, *(part.detach() for part in query[1:])), segments)

    @abc.abstractmethod
    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        """:meth:`forward` with a mesh."""

    def trace(self, scene: MeshScene, vertices: Tensor, faces: Tensor) -> TracedBits | None:
        """What this kind keeps of a mesh, on the CPU; None where that is nothing. Another thread may call it: nothing changes here.

        Args:
            scene: The mesh below.
            vertices: [n, 3], scene units, on the CPU.
            faces: [m, 3].
        """
        return None

    def use(self, traced: TracedBits | None) -> None:
        """Answers from this mesh from now on."""
        self.ready = self.needs_mesh

    def set_light(self, light: EvaluatedLight) -> None:
        """Takes the light that weighs the factors, where they do not come from a network."""

    def cached_light(self) -> dict[str, Tensor | None]:
        """The light that weighs the factors and the light that the mesh sends, where they are kept: what a checkpoint needs
        beside the mesh to go on with the same bits."""
        return {}

    def restore_light(self, cached: dict[str, Tensor | None]) -> None:
        """Puts back what :meth:`cached_light` returned, on a mesh like that of then."""

    def refresh(self, shade: Callable[[Tensor, Tensor], Tensor]) -> None:
        """Shades the cached mesh anew, where one is: ``shade(positions, normals)`` is its radiance [n, 3] along the normals."""


class NoOcclusion(OcclusionModel):
    """Everything is open (``occlusion = off``)."""

    needs_mesh = False

    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        raise AssertionError("is never ready")


class OcclusionHead(OcclusionModel):
    """Occlusion factors o_d and o_s of a point, 1 = open, predicted by a network.

    With ``directional`` the specular factor also reads the lobe's axis and width, so that it is a
    function of the reflection; without it the head is the paper's, which depends on position alone. The biases start at +2,
    mostly open: that is ours.

    Source: SplitNeRF Eq. (12)-(15).
    """

    def __init__(self, n_inputs: int, width: int, n_layers: int, n_channels: int, directional: bool):
        super().__init__(n_channels)
        self.directional = directional
        self.net = relu_mlp(n_inputs + (10 if directional else 0), width, n_layers, 2 * n_channels)
        with torch.no_grad():
            self.net[-1].bias.fill_(2.0)  # mostly open

    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        """o_d and o_s, [n, n_channels] each, of every point by itself."""
        features = query.inputs
        if self.directional:
            x, y, z = query.lobe_dirs.unbind(-1)
            products = torch.stack([x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1, z * z * z], dim=-1)
            features = torch.cat([features, query.lobe_dirs, products, query.roughness], dim=-1)
        out = torch.sigmoid(self.net(features))
        return Occlusion(out[:, : self.n_channels], out[:, self.n_channels :])
