"""A textured metallic-roughness mesh in the program's own conventions, wherever it came from."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Material:
    """One glTF metallic-roughness material: each quantity is its factor times its texture.

    Textures are float32 with the top row first, sampled bilinearly at `Asset.uv`, and repeat.

    Attributes:
        name: The material's name in the file.
        albedo: (3,) linear factor in [0, 1].
        roughness: Perceptual factor in [0, 1].
        metallic: Factor in [0, 1].
        emission: (3,) linear radiance factor >= 0.
        albedo_texture: [h, w, 3] linear in [0, 1] (decoded from sRGB), or None.
        roughness_metallic_texture: [h, w, 2], in [0, 1], (roughness, metallic), or None.
        normal_texture: [h, w, 3] tangent-space normals in [-1, 1], the scale applied, y along the bitangent, or None.
        emission_texture: [h, w, 3] linear, or None.
    """

    name: str = "material"
    albedo: tuple[float, float, float] = (1.0, 1.0, 1.0)
    roughness: float = 1.0
    metallic: float = 0.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    albedo_texture: np.ndarray | None = None
    roughness_metallic_texture: np.ndarray | None = None
    normal_texture: np.ndarray | None = None
    emission_texture: np.ndarray | None = None


@dataclass
class Asset:
    """A triangle mesh with materials, in a world with z up.

    Attributes:
        name: The asset's name.
        vertices: [n, 3] float32.
        triangles: [m, 3] int32, counter-clockwise seen from outside.
        normals: [n, 3] float32 unit shading normals.
        uv: [n, 2] float32 texture coordinates, (0, 0) the top left corner of the texture as in glTF, or None.
        tangents: [n, 4] float32, unit tangent along +u and the sign of the bitangent, sign * cross(normal, tangent);
            or None where no material has a normal texture.
        colors: [n, 3] float32 linear factors on albedo, or None.
        materials: At least one.
        material_ids: [m] int32, the material of each triangle.
    """

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    material_ids: np.ndarray
    materials: list[Material] = field(default_factory=lambda: [Material()])
    uv: np.ndarray | None = None
    tangents: np.ndarray | None = None
    colors: np.ndarray | None = None
