"""Meshes that rays are traced in: occlusion factors, visibility bits cached on a mesh, and the light that arrives at an asset.

Rays are traced on the CPU. ``occlusion_factors`` copies tensors of another device there, and the results back; lookups of
cached visibility run on the device that :meth:`VisibilityCache.to` copied it to.

No operator here has a gradient; a backward pass raises.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops._library import front, lib, register


class MeshScene:
    """A triangle mesh ready to be traced; the operators take its ``handle``.

    The acceleration structure lives as long as the object. A changed mesh needs a new object.

    Args:
        vertices: [n, 3] float32, scene units.
        faces: [m, 3] integers.

    Raises:
        TypeError: The faces are no integers.
        ValueError: The mesh is empty, an index is out of range or a vertex is not finite.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        faces = np.asarray(faces)
        if faces.size and not np.issubdtype(faces.dtype, np.integer):
            raise TypeError(f"MeshScene: faces must be integers, got {faces.dtype}")
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):  # the cast below would wrap them
            raise ValueError(
                f"MeshScene: faces refer to vertices from {faces.min()} to {faces.max()} of {len(vertices)}"
            )
        self._scene = _core.Scene(
            np.ascontiguousarray(vertices, dtype=np.float32), np.ascontiguousarray(faces, dtype=np.int32)
        )
        self.handle: int = self._scene.handle
        self._size = len(vertices), len(faces)

    def __repr__(self) -> str:
        return "MeshScene({} vertices, {} faces)".format(*self._size)

    def trace_closest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The nearest hits of rays.

        Args:
            origins, directions: [n, 3] float32.

        Returns:
            triangle [n] int64, -1 for a miss, and barycentric coordinates u, v [n] of its second and third corner.
        """
        return self._scene.trace_closest(origins, directions)

    def is_open(self, origins: Tensor, directions: Tensor, t_far: float = math.inf) -> Tensor:
        """Whether each ray meets no triangle.

        Args:
            origins, directions: [n, 3] float32 on the CPU. Neighbours in the arrays should be neighbours in space, since
                rays are traced in packets of 16.
            t_far: The length of the rays in multiples of ``directions``.

        Returns:
            [n] bool, True where the ray is open.
        """
        rays = (x.contiguous().numpy() for x in (origins, directions))
        return torch.from_numpy(self._scene.trace_visibility(*rays, t_far))


@front(positions=1, normals=1, lobe_dirs=1, roughness=1)
def occlusion_factors(
    scene: MeshScene,
    positions: Tensor,
    normals: Tensor,
    *,
    lobe_dirs: Tensor,
    roughness: Tensor,
    environment: Tensor,
    n_diffuse_rays: int = 64,
    n_specular_rays: int = 64,
    offset: float = 0.0125,
    seed: int = 0,
    n_channels: int = 1,
) -> tuple[Tensor, Tensor]:
    r"""The shares of the diffuse and of the specular light that reach points without meeting the mesh.

    .. math:: o_d = \frac{\sum_i L_i V_i}{\sum_i L_i}

    over cosine-weighted directions about the normal; o_s is the same ratio over directions of the lobe
    :math:`D(w) (w \cdot d)^+` about ``lobe_dirs``. Each point is sampled, traced and summed by itself, so that
    no [points, rays] array exists. Where the light is black, the factors are the shares of open directions.

    Args:
        scene: The mesh.
        positions, normals: [n, 3] positions (scene units) and unit normals.
        lobe_dirs: [n, 3] unit axes of the specular lobe (:func:`splitnerf.ops.shading.light_queries`).
        roughness: [n, 1] perceptual roughness in [0, 1].
        environment: [height, width, 3] radiance, equirectangular (z up, centre column along +x).
        n_diffuse_rays, n_specular_rays: The numbers of rays per point.
        offset: The distance of a ray's start from its point along the normal, scene units.
        seed: The seed of the random shift that each point's lattice of rays gets.
        n_channels: 1 averages the factors over the colour channels, 3 keeps them.

    Returns:
        o_d and o_s, [n, n_channels] in [0, 1], 1 = open.

    Source: SplitNeRF Eq. (14), (15), with the specular lobe about the reflection.
    """
    if n_channels not in (1, 3):
        raise ValueError(f"occlusion_factors: n_channels must be 1 or 3, got {n_channels}")
    o_d, o_s = lib.occlusion_factors(
        scene.handle,
        *(x.cpu() for x in (positions, normals, lobe_dirs, roughness, environment)),
        n_diffuse_rays,
        n_specular_rays,
        offset,
        seed,
    )
    o_d, o_s = o_d.to(positions.device), o_s.to(positions.device)
    return (o_d, o_s) if n_channels == 3 else (o_d.mean(-1, keepdim=True), o_s.mean(-1, keepdim=True))


register(
    "occlusion_factors",
    fake=lambda scene, positions, *rest: (positions.new_empty(positions.shape), positions.new_empty(positions.shape)),
)


GRID_LEVELS = 4  # levels of the search; the last has 8 times the radius of the first
RADIUS_IN_SPACINGS = 1.5


@front()
def visibility_bits(
    scene: MeshScene, positions: Tensor, normals: Tensor, directions: Tensor, offset: float, *, with_hits: bool = False
) -> tuple[Tensor, Tensor]:
    """Traces the same directions from every vertex of a mesh and records whether each ray is blocked.

    Args:
        scene: The mesh.
        positions, normals: [n, 3] float32 vertices of the mesh (scene units) and their unit normals.
        directions: [k, 3] float32 unit directions; k is a multiple of 32.
        offset: The distance of a ray's start from its vertex along the normal, scene units.
        with_hits: Whether to record the vertices that were hit.

    Returns:
        bits: [n, 2, k / 32] int32; bit j of word i belongs to direction 32 i + j. Row 0 marks the open directions,
            row 1 the blocked ones. Directions below the vertex's own horizon are not traced and are marked in neither.
        hits: [n, k] int32, the vertex with the largest barycentric weight of the triangle that was hit, -1 where the
            direction is not blocked; [n, 0] without ``with_hits``.
    """
    return lib.visibility_bits(scene.handle, positions, normals, directions, offset, with_hits)


@dataclass(frozen=True)
class VisibilityCache:
    """The input of :func:`cached_occlusion`: the vertices, hash grids to find them, and the visibility of each.

    Attributes:
        vertices, normals: [n, 3] float32 vertices (scene units) and their unit normals.
        directions: [k, 3] float32 unit directions.
        bits, hits: The results of :func:`visibility_bits`; hits may be other numbers, those of rows of a radiance.
        radius: The radius of the first search for vertices around a point, 1.5 sqrt(area / n), scene units.
        starts, order: Hash grids over the vertices; the search of level l has the radius ``radius * 2^l``.
    """

    vertices: Tensor
    normals: Tensor
    directions: Tensor
    bits: Tensor
    hits: Tensor
    radius: float
    starts: Tensor
    order: Tensor

    @staticmethod
    def trace(
        scene: MeshScene,
        vertices: Tensor,
        normals: Tensor,
        area: float,
        directions: Tensor,
        *,
        offset: float = 0.0125,
        with_hits: bool = False,
    ) -> VisibilityCache:
        """Traces the cache of a mesh with the given surface area (scene units squared); see :func:`visibility_bits`."""
        bits, hits = visibility_bits(scene, vertices, normals, directions, offset, with_hits=with_hits)
        radius = RADIUS_IN_SPACINGS * (area / len(vertices)) ** 0.5
        return VisibilityCache(
            vertices, normals, directions, bits, hits, radius, *lib.vertex_grids(vertices, radius, GRID_LEVELS)
        )

    def to(self, device: torch.device | str) -> VisibilityCache:
        """A copy on a device; the cache itself where it already is on that device."""
        moved = (getattr(self, field.name) for field in fields(self))
        return VisibilityCache(*(x.to(device) if isinstance(x, Tensor) else x for x in moved))

    def arguments(self, radiance: Tensor | None) -> tuple:
        """The arguments that the operators take for a cache, with the radiance [m, 3] of what is hit, or None."""
        hits, sent = (self.hits[:, :0], self.vertices[:0]) if radiance is None else (self.hits, radiance)
        grids = self.vertices, self.normals, self.starts, self.order, self.radius
        return *grids, self.bits, hits, sent, self.directions


@front(positions=1, normals=1, lobe_dirs=1, roughness=1)
def cached_occlusion(
    cache: VisibilityCache,
    positions: Tensor,
    normals: Tensor,
    *,
    lobe_dirs: Tensor,
    roughness: Tensor,
    light: Tensor,
    radiance: Tensor | None = None,
) -> tuple[Tensor, Tensor, Tensor | None, Tensor | None]:
    r"""Occlusion factors of points, and the light that the mesh itself sends to them, from the cached bits.

    V_i is the open share of direction i among the vertices around the point, weighted by distance and by agreement of
    normals. A vertex does not count for directions below its own horizon; if no vertex counts, V_i = 1. Then

    .. math:: o_d = \frac{\sum_i V_i L_i\, (w_i \cdot n)^+}{\sum_i L_i\, (w_i \cdot n)^+}

    o_s is the same ratio with :math:`D(w_i, d) (w_i \cdot d)^+ [w_i \cdot n > 0]` in place of the cosine, where D is at least
    about two directions wide.

    With ``radiance``, C_i is its row that ``hits`` names for direction i:

    .. math:: i_d = \frac{\sum_i (1 - V_i)\, C_i\, (w_i \cdot n)^+}{\sum_i (w_i \cdot n)^+}

    and i_s is the same mean over the lobe. They are added to o_d g(n, 1) and o_s g(d, rho).

    Where no vertex is near, or all near vertices are open in all directions above the horizon, the factors are exactly
    1 and the added light is 0. Where the light is black, the factors are the shares of open directions. Input that is
    not finite gives NaN.

    Args:
        cache: The mesh's bits; with hits where ``radiance`` is given.
        positions, normals: [n, 3] float32 positions (scene units) and unit normals n.
        lobe_dirs: [n, 3] float32 unit axes d of the specular lobe (:func:`splitnerf.ops.shading.light_queries`).
        roughness: [n, 1] float32 perceptual roughness in [0, 1].
        light: [k, 3] float32 mean radiance L_i of the environment over the cell of each of the cache's directions.
        radiance: [m, 3] float32 radiance that the mesh sends out, or None. A hit past the last row sends nothing.

    Returns:
        o_d, o_s [n, 3] in [0, 1], 1 = open; i_d, i_s [n, 3] or None, in the normalisation of g (irradiance / pi).

    Source: SplitNeRF Eq. (12)-(15) as sums over fixed directions.
    """
    points = positions, normals, lobe_dirs, roughness
    o_d, o_s, i_d, i_s = lib.cached_occlusion(*points, *cache.arguments(radiance), light)
    return (o_d, o_s, None, None) if radiance is None else (o_d, o_s, i_d, i_s)


@front(positions=1, normals=1)
def cached_visibility(
    cache: VisibilityCache, positions: Tensor, normals: Tensor, radiance: Tensor | None = None
) -> tuple[Tensor, Tensor | None]:
    """The visibility of each of the cache's k directions from points, and the light that the mesh sends from there.

    The incoming light is ``visible[..., None] * light + arriving``.

    Args:
        cache, positions, normals, radiance: See :func:`cached_occlusion`.

    Returns:
        visible: [n, k] open shares V_i in [0, 1]; 1 where no vertex counts.
        arriving: [n, k, 3] light (1 - V_i) C_i from the mesh, 0 below the horizon; None without ``radiance``.
    """
    visible, arriving = lib.cached_visibility(positions, normals, *cache.arguments(radiance))
    return visible, (None if radiance is None else arriving)


def _fake_bits(scene, positions, normals, directions, offset, with_hits):
    n, k = positions.shape[0], directions.shape[0]
    shapes = ((n, 2, k // 32), (n, k if with_hits else 0))
    return tuple(positions.new_empty(shape, dtype=torch.int32) for shape in shapes)


def _fake_grids(vertices, radius, n_levels):
    n = vertices.shape[0]
    shapes = ((n_levels, (1 << max(0, int(n) - 1).bit_length()) + 1), (n_levels, n))
    return tuple(vertices.new_empty(shape, dtype=torch.int32) for shape in shapes)


def _fake_occlusion(positions, *rest):
    n = positions.shape[0]
    sizes = (n, n) + (n if rest[9].shape[1] else 0,) * 2  # rest[9]: hits
    return tuple(positions.new_empty(size, 3) for size in sizes)


def _fake_visibility(positions, *rest):
    n, k = positions.shape[0], rest[9].shape[0]
    return positions.new_empty(n, k), positions.new_empty(n if rest[7].shape[1] else 0, k, 3)  # rest[7]: hits


register("visibility_bits", fake=_fake_bits)
register("vertex_grids", fake=_fake_grids)
register("cached_occlusion", fake=_fake_occlusion)
register("cached_visibility", fake=_fake_visibility)


class TexturedSurface(NamedTuple):
    """The surface of a mesh with one material, as the path tracer reads it.

    Attributes:
        scene: The mesh.
        normals, tangents, uv: [n_vertices, 3], [n_vertices, 4] and [n_vertices, 2] float32, see
            ``splitnerf.data.asset.Asset``.
        albedo_map: [h, w, 3] linear, in [0, 1].
        roughness_metallic_map: [h, w, 2] in [0, 1].
        normal_map: [h, w, 3] tangent-space normals.
    """

    scene: MeshScene
    normals: Tensor
    tangents: Tensor
    uv: Tensor
    albedo_map: Tensor
    roughness_metallic_map: Tensor
    normal_map: Tensor


class IncomingLight(NamedTuple):
    """Directions of n points and what comes from them.

    Attributes:
        directions: [n, k, 3] unit.
        pdf: [n, k] density of all k directions together, sr^-1 (balance heuristic); 0 where a direction does not count.
        visible: [n, k] 1 where the environment is seen, else 0.
        sent: [n, k, 3] linear radiance that the asset sends from there.
    """

    directions: Tensor
    pdf: Tensor
    visible: Tensor
    sent: Tensor


@front(positions=1, geometric_normals=1, normals=1, view_dirs=1, albedo=1, roughness=1, metallic=1)
def incoming_light(
    surface: TexturedSurface,
    environment: Tensor,
    positions: Tensor,
    *,
    geometric_normals: Tensor,
    normals: Tensor,
    view_dirs: Tensor,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    n_directions: int,
    max_bounces: int = 3,
    clamp_indirect: float = 0.0,
    seed: int = 0,
) -> IncomingLight:
    """Draws directions for points of an asset, by the environment and by the material, and traces them. No gradient.

    Args:
        surface: The asset.
        environment: [h, w, 3] linear radiance >= 0, equirectangular (z up, centre column along +x).
        positions: [n, 3] points of the surface, scene units.
        geometric_normals, normals: [n, 3] unit normals of the triangles and of the shading, on the viewer's side.
        view_dirs: [n, 3] unit, towards the viewer.
        albedo, roughness, metallic: [n, 3], [n, 1], [n, 1] in [0, 1].
        n_directions: The number k of directions per point, at least 2.
        max_bounces: The largest number of scattering events of the light that the asset itself sends.
        clamp_indirect: The largest channel of one contribution to that light; 0 does not clamp.
        seed: The seed of the random numbers; equal seeds give equal results.

    Returns:
        IncomingLight. The mean of f(direction) radiance / pdf over the k directions estimates the reflected light.

    Source: Veach 1997 (multiple importance sampling); Heitz 2018 (visible normals).
    """
    points = positions, geometric_normals, normals, view_dirs, albedo, roughness, metallic
    numbers = n_directions, max_bounces, clamp_indirect, seed
    found = lib.incoming_light(surface.scene.handle, *points, *surface[1:], environment, *numbers)
    directions, solid_angles, visible, sent = found
    pdf = torch.where(solid_angles > 0, 1.0 / (n_directions * solid_angles), 0.0)
    return IncomingLight(directions, pdf, visible, sent)


def _fake_incoming(scene, positions, *rest):
    n, k = positions.shape[0], rest[-4]  # the number of directions
    return tuple(positions.new_empty(n, k, *own) for own in ((3,), (), (), (3,)))


register("incoming_light", fake=_fake_incoming)
