"""Light that arrives at points of a textured asset, traced on the CPU."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.ops._library import lib, register
from splitnerf.ops.occlusion import MeshScene


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


def incoming_light(
    surface: TexturedSurface,
    environment: Tensor,
    positions: Tensor,
    geometric_normals: Tensor,
    normals: Tensor,
    view_dirs: Tensor,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    *,
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

    Raises:
        ValueError: A shape, dtype or number does not fit.
        IndexError: The scene no longer exists.

    Source: Veach 1997 (multiple importance sampling); Heitz 2018 (visible normals).
    """
    directions, solid_angles, visible, sent = lib.incoming_light(
        surface.scene.handle,
        positions,
        geometric_normals,
        normals,
        view_dirs,
        albedo,
        roughness,
        metallic,
        surface.normals,
        surface.tangents,
        surface.uv,
        surface.albedo_map,
        surface.roughness_metallic_map,
        surface.normal_map,
        environment,
        n_directions,
        max_bounces,
        clamp_indirect,
        seed,
    )
    pdf = torch.where(solid_angles > 0, 1.0 / (n_directions * solid_angles), 0.0)
    return IncomingLight(directions, pdf, visible, sent)


register(
    "incoming_light",
    fake=lambda scene, positions, *rest: (
        positions.new_empty(len(positions), rest[-4], 3),
        positions.new_empty(len(positions), rest[-4]),
        positions.new_empty(len(positions), rest[-4]),
        positions.new_empty(len(positions), rest[-4], 3),
    ),
)
