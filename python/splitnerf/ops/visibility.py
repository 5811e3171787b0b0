"""Visibility bits cached on a mesh: occlusion factors and one bounce of light without tracing rays in a training step.

The bits are traced on the CPU (:func:`splitnerf.ops.visibility_bits`, :meth:`splitnerf.ops.VisibilityCache.trace`); the
lookups run on the device that :meth:`splitnerf.ops.VisibilityCache.to` copied them to.

No operator here has a gradient; a backward pass raises.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from splitnerf.ops._library import lib, register
from splitnerf.ops.occlusion import MeshScene

GRID_LEVELS = 4  # levels of the search; the last has 8 times the radius of the first
RADIUS_IN_SPACINGS = 1.5


def visibility_bits(
    scene: MeshScene,
    positions: Tensor,
    normals: Tensor,
    directions: Tensor,
    offset: float = 0.0125,
    *,
    with_hits: bool = False,
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

    Raises:
        ValueError: A shape, dtype or count does not fit.
        IndexError: The scene no longer exists.
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

    def n_bytes(self) -> int:
        """The memory of all its tensors."""
        tensors = (self.vertices, self.normals, self.directions, self.bits, self.hits, self.starts, self.order)
        return sum(t.numel() * t.element_size() for t in tensors)


def cached_occlusion(
    cache: VisibilityCache,
    positions: Tensor,
    normals: Tensor,
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
        lobe_dirs: [n, 3] float32 unit axes d of the specular lobe (:func:`splitnerf.ops.light_queries`).
        roughness: [n, 1] float32 perceptual roughness in [0, 1].
        light: [k, 3] float32 mean radiance L_i of the environment over the cell of each of the cache's directions.
        radiance: [m, 3] float32 radiance that the mesh sends out, or None. A hit past the last row sends nothing.

    Returns:
        o_d, o_s [n, 3] in [0, 1], 1 = open; i_d, i_s [n, 3] or None, in the normalisation of g (irradiance / pi).

    Raises:
        ValueError: A shape or dtype does not fit.

    Source: SplitNeRF Eq. (12)-(15) as sums over fixed directions.
    """
    hits = cache.hits if radiance is not None else cache.hits[:, :0]
    o_d, o_s, i_d, i_s = lib.cached_occlusion(
        positions,
        normals,
        lobe_dirs,
        roughness,
        cache.vertices,
        cache.normals,
        cache.starts,
        cache.order,
        cache.radius,
        cache.bits,
        hits,
        cache.vertices[:0] if radiance is None else radiance,
        cache.directions,
        light,
    )
    return (o_d, o_s, None, None) if radiance is None else (o_d, o_s, i_d, i_s)


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

    Raises:
        ValueError: A shape or dtype does not fit.
    """
    hits = cache.hits if radiance is not None else cache.hits[:, :0]
    visible, arriving = lib.cached_visibility(
        positions,
        normals,
        cache.vertices,
        cache.normals,
        cache.starts,
        cache.order,
        cache.radius,
        cache.bits,
        hits,
        cache.vertices[:0] if radiance is None else radiance,
        cache.directions,
    )
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
