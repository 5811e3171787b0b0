"""Occlusion factors: the interface of all kinds of occlusion, and the paper's network."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import torch
from torch import Tensor, nn

from splitnerf.fields.heads import relu_mlp
from splitnerf.fields.light import EvaluatedLight
from splitnerf.ops import MeshScene, VisibilityCache


class OcclusionQuery(NamedTuple):
    """The points of a lookup of occlusion factors; each kind of occlusion reads the values that it needs.

    Attributes:
        inputs: [n, columns] each, the inputs of the occlusion head, n_inputs columns together.
        positions: [n, 3] positions on the surface, scene units.
        normals: [n, 3] unit normals, on the viewer's side.
        lobe_dirs: [n, 3] unit axes of the specular lobe.
        roughness: [n, 1] perceptual roughness in [0, 1].
    """

    inputs: Sequence[Tensor]
    positions: Tensor
    normals: Tensor
    lobe_dirs: Tensor
    roughness: Tensor


class MaterialsAt(Protocol):
    """Materials of a surface."""

    def __call__(self, positions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """positions [n, 3], scene units -> albedo [n, 3] linear, roughness [n, 1] perceptual and metallic [n, 1], all
        in [0, 1]."""


class Reflect(Protocol):
    """Reflection at points of a surface."""

    def __call__(
        self, normals: Tensor, view_dirs: Tensor, materials: Sequence[Tensor], light_s: Tensor, light_d: Tensor
    ) -> Tensor:
        """The radiance [n, 3] that points reflect towards ``view_dirs`` [n, 3].

        Args:
            normals, view_dirs: [n, 3] unit.
            materials: The values of :class:`MaterialsAt` at the points.
            light_s, light_d: [n, 3] light that arrives, in the normalisation of g(d, rho) and g(n, 1).
        """


class RaySegments(NamedTuple):
    """Segments of rays, each on one surface, and the segment of each point.

    Attributes:
        representatives: [k] int64, the point that represents each segment.
        segment: [n] int64, the segment of each point.
    """

    representatives: Tensor
    segment: Tensor


class Occlusion(NamedTuple):
    """The share of the environment's light that arrives at points, and the light that arrives from the object itself.

    Attributes:
        diffuse, specular: The factors o_d and o_s, [n, 1] or [n, 3] in [0, 1], 1 = open.
        indirect_diffuse, indirect_specular: [n, 3] linear light from the object, in the normalisation of g(n, 1) and
            g(d, rho); or None.
    """

    diffuse: Tensor
    specular: Tensor
    indirect_diffuse: Tensor | None = None
    indirect_specular: Tensor | None = None


class TracedBits(NamedTuple):
    """The traced visibility of a mesh's vertices.

    Attributes:
        cache: The visibility bits. ``hits`` are numbers of emitters.
        is_unoccluded: Whether the mesh blocks so little that it counts as convex.
        emitters: The vertices that rays hit, each with the direction that it is hit from; None without indirect light.
    """

    cache: VisibilityCache
    is_unoccluded: bool
    emitters: Emitters | None

    def to(self, device: torch.device | str) -> TracedBits:
        """A copy on a device; tensors that already are there are not copied."""
        emitters = None if self.emitters is None else self.emitters.to(device)
        return TracedBits(self.cache.to(device), self.is_unoccluded, emitters)


class Emitters(NamedTuple):
    """The mesh's vertices as they are seen: one row for each vertex and direction in which rays hit it.

    Attributes:
        vertices: [p] int64, the vertex.
        directions: [p] int64, the traced direction that hits it; it is seen from the opposite direction.
        mirrored: [p] int64, the emitter that the vertex sees in the mirror direction, -1 where that is open.
        facing: [p, 1] bool, whether it is seen from the outside.
    """

    vertices: Tensor
    directions: Tensor
    mirrored: Tensor
    facing: Tensor

    def to(self, device: torch.device | str) -> Emitters:
        """A copy on a device."""
        return Emitters(*(part.to(device) for part in self))


class OcclusionModel(nn.Module, abc.ABC):
    """The interface of all kinds of occlusion. Before the first mesh, and without occlusion, all factors are 1.

    The way of a mesh: :meth:`aim` chooses directions, :meth:`trace` computes the bits that the kind keeps, :meth:`use`
    stores them, and calls read them.

    Args:
        n_channels: 1 averages the factors over the colour channels, 3 keeps them.

    Attributes:
        needs_mesh: Whether the factors of this kind depend on meshes.
        ready: Whether a mesh is in use.
        is_unoccluded: Whether the mesh in use counts as convex: all factors are 1 without a lookup.
        turns: [m, 3, 3] rotations from the mesh's world to the light's, over which the light that weighs the factors is
            averaged: that of a turntable is another one in each photo. None: the light stands still.
    """

    needs_mesh = True
    is_unoccluded = False
    turns: Tensor | None = None

    def __init__(self, n_channels: int):
        super().__init__()
        self.n_channels, self.ready = n_channels, False

    def forward(self, query: OcclusionQuery, segments: RaySegments | None = None) -> Occlusion:
        """The factors at surface points; no gradient flows into the geometry.

        Args:
            query: The points.
            segments: The ray segments of the points, where one lookup may serve a whole segment; None: one lookup each.
        """
        if not self.ready or self.is_unoccluded:
            ones = torch.ones_like(query.roughness).expand(-1, self.n_channels)
            return Occlusion(ones, ones)
        return self.answer(OcclusionQuery(query.inputs, *(part.detach() for part in query[1:])), segments)

    @abc.abstractmethod
    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        """The factors of :meth:`forward` where they are not all 1."""

    def aim(self, light: EvaluatedLight) -> None:
        """Chooses the directions in which the next mesh is traced: those that this light comes from."""

    def trace(self, scene: MeshScene, vertices: Tensor, faces: Tensor) -> TracedBits | None:
        """The visibility of a mesh that this kind keeps, on the CPU; None where it keeps none.

        The method changes nothing in the module, so that another thread may call it.

        Args:
            scene: The mesh, ready to be traced.
            vertices: [n, 3], scene units, on the CPU.
            faces: [m, 3] int32.
        """
        return None

    def use(self, traced: TracedBits | None) -> None:
        """Switches to this mesh."""
        self.ready = self.needs_mesh

    def set_light(self, light: EvaluatedLight) -> None:
        """Stores the light that weighs the factors, where they do not come from a network."""

    def cached_light(self) -> dict[str, Tensor | None]:
        """The stored light that weighs the factors, and the stored radiance of the mesh.

        A checkpoint needs them in addition to the mesh, so that a resumed run has the same bits.
        """
        return {}

    def restore_light(self, cached: dict[str, Tensor | None]) -> None:
        """Restores the result of :meth:`cached_light`, on a mesh with the same vertices."""

    def restore_aims(self, cached: dict[str, Tensor | None]) -> None:
        """Restores the directions in which a mesh is traced from :meth:`cached_light`."""

    def refresh(self, light: EvaluatedLight, materials: MaterialsAt, reflect: Reflect) -> None:
        """Shades the cached mesh again, if any.

        Args:
            light: The evaluated light.
            materials: The materials of the mesh.
            reflect: The light that points with materials reflect.
        """


class NoOcclusion(OcclusionModel):
    """No occlusion: all factors are 1 (``occlusion.kind = off``)."""

    needs_mesh = False

    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        raise AssertionError("is never ready")


class OcclusionHead(OcclusionModel):
    """Occlusion factors o_d and o_s of a point, 1 = open, predicted by a network.

    With ``directional`` the specular factor also depends on the lobe's axis and width. Without it the head is the
    paper's, which depends on position alone. The output biases start at +2, mostly open; this choice is ours.

    Source: SplitNeRF Eq. (12)-(15).
    """

    def __init__(self, n_inputs: int, width: int, n_layers: int, n_channels: int, directional: bool):
        super().__init__(n_channels)
        self.directional = directional
        self.net = relu_mlp(n_inputs + (10 if directional else 0), width, n_layers, 2 * n_channels)
        with torch.no_grad():
            self.net[-1].bias.fill_(2.0)  # mostly open

    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        """The factors o_d and o_s, [n, n_channels] each, for every point; segments are not used."""
        features = list(query.inputs)
        if self.directional:
            x, y, z = query.lobe_dirs.unbind(-1)
            products = torch.stack([x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1, z * z * z], dim=-1)
            features += [query.lobe_dirs, products, query.roughness]
        out = torch.sigmoid(self.net(torch.cat(features, dim=-1)))
        return Occlusion(out[:, : self.n_channels], out[:, self.n_channels :])
