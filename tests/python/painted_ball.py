"""A ball with a colour and a roughness per side, its light, and photos that the path tracer makes of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
import trimesh
from blender_data import look_at
from splitnerf.data.asset import Asset, Material, vertex_tangents
from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import turn_environment
from splitnerf.data.images import linear_to_srgb
from splitnerf.export.textured import unwrap
from splitnerf.refinement.texels import AssetTexels
from splitnerf.render.path_traced import AssetRenderer

SIZE = 64  # texels
PHOTO = 40  # pixels
FOCAL = 60.0


def textured(mesh: trimesh.Trimesh, size: int = SIZE) -> Asset:
    """A mesh with smooth normals and plain textures."""
    normals = np.asarray(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).vertex_normals, np.float32)
    origins, faces, uv = unwrap(np.float32(mesh.vertices), np.asarray(mesh.faces), size)
    vertices, normals = np.float32(mesh.vertices)[origins], normals[origins]
    material = Material(
        roughness=1.0,
        metallic=1.0,
        albedo_texture=np.full((size, size, 3), 0.4, np.float32),
        roughness_metallic_texture=np.tile(np.float32([0.5, 0.0]), (size, size, 1)),
        normal_texture=np.tile(np.float32([0, 0, 1]), (size, size, 1)),
    )
    tangents = vertex_tangents(vertices, faces, normals, uv)
    ids = np.zeros(len(faces), np.int32)
    return Asset("ball", vertices, faces.astype(np.int32), normals, ids, [material], uv=uv, tangents=tangents)


def with_textures(asset: Asset, **textures: np.ndarray) -> Asset:
    return replace(asset, materials=[replace(asset.materials[0], **textures)])


def orange(asset: Asset) -> Asset:
    """Another asset with saturated colours, and normals whose green channel shows when it is flipped."""
    size = asset.materials[0].normal_texture.shape[:2]
    values = {"albedo": (0.8, 0.4, 0.1), "roughness_metallic": (0.4, 0.0), "normal": (0.0, 0.4, 0.84**0.5)}
    return with_textures(asset, **{f"{k}_texture": np.full((*size, len(x)), x, np.float32) for k, x in values.items()})


def lamps() -> np.ndarray:
    """A grey sky with a warm and a blue lamp; no turn looks like another."""
    light = sky(32)
    light[10:16, 4:10] = (1, 4, 14)
    return light


def sky(height: int = 16) -> np.ndarray:
    """A bright lamp over a gradient."""
    map_ = np.full((height, 2 * height, 3), 0.5, np.float32) * np.linspace(1.5, 0.5, height)[:, None, None]
    map_[3:5, 6:9] = (12.0, 11.0, 9.0)
    return map_.astype(np.float32)


def looking(azimuth: float, elevation: float, distance: float = 3.4) -> np.ndarray:
    """[4, 4] camera-to-world of a camera that looks at the origin, OpenGL axes."""
    back = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    return look_at(distance * back, np.zeros(3)).astype(np.float32)


def bare(mesh: trimesh.Trimesh, *materials: Material) -> Asset:
    """A mesh without texture coordinates."""
    vertices, faces, normals = np.float32(mesh.vertices), np.int32(mesh.faces), np.float32(mesh.vertex_normals)
    return Asset("bare", vertices, faces, normals, np.zeros(len(faces), np.int32), list(materials))


def photos(
    asset: Asset, environment: np.ndarray, n=10, spp=128, turns: np.ndarray | None = None, sharpness=1
) -> Dataset:
    """The asset seen from all around, as photos, of `sharpness` times as many pixels along an edge; with `turns` [n, 3, 3] under
    a light that is turned in each."""
    renderer = AssetRenderer(asset)
    poses = np.stack([looking(2.4 * i, np.arcsin(1.6 * (i + 0.5) / n - 0.8)) for i in range(n)])
    size = PHOTO * sharpness
    lens, images = (FOCAL * sharpness, FOCAL * sharpness, size / 2, size / 2), []
    for i, pose in enumerate(poses):
        light = environment if turns is None else turn_environment(environment, turns[i])
        maps = renderer.render(light, pose, lens, size, size, spp=spp, seed=i)
        straight = maps["radiance"] / np.maximum(maps["alpha"], 1e-6)[..., None]
        images.append(np.dstack([linear_to_srgb(straight).clip(0, 1), maps["alpha"]]))
    names, lenses = [str(i) for i in range(n)], np.tile(np.float32(lens), (n, 1))
    seen, paths = np.stack(images).astype(np.float32), [Path(name) for name in names]
    return Dataset("ball", Path(), "train", 1, seen, poses, lenses, names, paths, np.eye(4), light_turns=turns)


def heights(texels: AssetTexels) -> torch.Tensor:
    """[m, 1] z of the covered texels."""
    return torch.from_numpy(texels.positions)[:, 2:]
