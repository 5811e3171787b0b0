"""Shared by the writers of textured files: the change of axes, and an asset's textures in 8 bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from splitnerf.data.asset import Asset
from splitnerf.data.images import linear_to_srgb, to_uint8

BAND = 1 << 20  # texels encoded at a time


@dataclass(frozen=True)
class Maps:
    """An asset's textures in the encoding of files, uint8; None where the asset has only a factor.

    Attributes:
        albedo: [h, w, 3] sRGB.
        orm: [h, w, 3] linear: occlusion (1 where there is none), roughness, metallic.
        normal: [h, w, 3], (n + 1) / 2.
    """

    albedo: np.ndarray | None
    orm: np.ndarray | None
    normal: np.ndarray | None


def encode_maps(path: object, asset: Asset, occlusion: np.ndarray | None) -> Maps:
    """The textures of an asset's one material.

    Args:
        path: The file to be written, for messages.
        asset: The asset, with uv if it has textures.
        occlusion: [h, w] occlusion in [0, 1], 1 = open, with the size of the roughness texture; or None.

    Raises:
        RuntimeError: The asset has several materials, textures without uv, or something is not finite or of wrong size.
    """
    n, material = len(asset.vertices), asset.materials[0]
    if len(asset.materials) != 1:
        raise RuntimeError(f"{path}: has {len(asset.materials)} materials, one is supported")
    per_vertex = {"vertices": 3, "normals": 3, "uv": 2, "tangents": 4}
    for name, width in per_vertex.items():
        values = getattr(asset, name)
        if values is not None and (values.shape != (n, width) or not np.isfinite(values).all()):
            raise RuntimeError(f"{path}: {name} must be finite [{n}, {width}], got {list(values.shape)}")
    if len(asset.triangles) == 0 or asset.triangles.min() < 0 or asset.triangles.max() >= n:
        raise RuntimeError(f"{path}: degenerate or empty mesh, nothing written")
    albedo, roughness_metallic, normal = (
        material.albedo_texture,
        material.roughness_metallic_texture,
        material.normal_texture,
    )
    for texture in (albedo, roughness_metallic, normal, occlusion):
        if texture is not None and (asset.uv is None or not np.isfinite(texture).all()):
            raise RuntimeError(f"{path}: textures must be finite and the mesh have texture coordinates")
    orm = None
    if roughness_metallic is not None:
        open_share = np.broadcast_to(np.float32(1), roughness_metallic.shape[:2]) if occlusion is None else occlusion
        orm = encoded(lambda *bands: np.dstack(bands), open_share, roughness_metallic)
    return Maps(
        albedo=None if albedo is None else encoded(linear_to_srgb, albedo),
        orm=orm,
        normal=None if normal is None else encoded(lambda band: 0.5 * band + 0.5, normal),
    )


def encoded(encode: Callable[..., np.ndarray], *maps: np.ndarray) -> np.ndarray:
    """[h, w, 3] uint8: `encode` of maps [h, w] or [h, w, c], called for some rows at a time."""
    height, width = maps[0].shape[:2]
    pixels, rows = np.empty((height, width, 3), np.uint8), max(1, BAND // width)
    for band in (slice(start, start + rows) for start in range(0, height, rows)):
        pixels[band] = to_uint8(encode(*(values[band] for values in maps)))
    return pixels


def y_up(vectors: np.ndarray) -> np.ndarray:
    """Vectors [n, 3] in glTF's axes, from the program's axes: (x, y, z) -> (x, z, -y)."""
    return np.column_stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]])
