"""glTF's metallic-roughness materials: factors as written, textures decoded to linear floats."""

from __future__ import annotations

import math

import numpy as np

from splitnerf.data.asset import Material
from splitnerf.data.gltf.document import BYTES_OF_PIXEL, Document
from splitnerf.data.images import decode_image, srgb_to_linear
from splitnerf.errors import InputError, note

SUPPORTED_EXTENSIONS = frozenset(
    {"KHR_texture_transform", "KHR_mesh_quantization", "KHR_materials_emissive_strength", "EXT_texture_webp"}
)
REPEAT = 10497
LARGEST_FACTOR = 1e9


def read_material(document: Document, index: int | None) -> tuple[Material, TextureSlots]:
    """Reads one material, alpha and occlusion left out, and where its textures lie; index None means glTF's default material (white, rough,
    metallic). Raises InputError where an image cannot be read, or the textures need more than one set of coordinates.
    """
    if index is None:
        note(f"{document.path}: a mesh has no material; drawn as glTF's default, white, roughness 1, metallic 1")
        return Material(name="default", metallic=1.0), TextureSlots(document, "default")
    source = document.json["materials"][index]
    name = source.get("name", f"material {index}")
    pbr = source.get("pbrMetallicRoughness", {})
    if source.get("alphaMode", "OPAQUE") != "OPAQUE":
        note(f"{document.path}: material '{name}' is transparent (alphaMode {source['alphaMode']}); drawn opaque")
    slots = TextureSlots(document, name)
    # Each texture takes its last form before the next one is read: a large one has several forms in memory at a time.
    albedo, emission = (
        None if pixels is None else srgb_to_linear(pixels)
        for pixels in map(slots.read, (pbr.get("baseColorTexture"), source.get("emissiveTexture")))
    )
    orm = slots.read(pbr.get("metallicRoughnessTexture"))
    roughness_metallic = None if orm is None else np.ascontiguousarray(orm[..., 1:3])
    del orm
    normal = slots.read(source.get("normalTexture"))
    if normal is not None:
        scale = _finite(document, name, source["normalTexture"].get("scale", 1.0), 1)[0]
        normal *= 2
        normal -= 1
        normal[..., :2] *= scale
    emissive = _unit(document, name, source.get("emissiveFactor", (0.0, 0.0, 0.0)), 3)
    strength = source.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    strength = max(0.0, _finite(document, name, strength, 1)[0])
    material = Material(
        name=name,
        albedo=tuple(_unit(document, name, pbr.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[:3], 3)),
        roughness=_unit(document, name, pbr.get("roughnessFactor", 1.0), 1)[0],
        metallic=_unit(document, name, pbr.get("metallicFactor", 1.0), 1)[0],
        emission=tuple(strength * channel for channel in emissive),
        albedo_texture=albedo,
        roughness_metallic_texture=roughness_metallic,
        normal_texture=normal,
        emission_texture=emission,
    )
    return material, slots


class TextureSlots:
    """Reads a material's textures and checks that all of them use the same coordinates: TEXCOORD_N for N `uv_set` (None: there is
    no texture), times `uv_transform` [3, 3] on (u, v, 1), of KHR_texture_transform."""

    def __init__(self, document: Document, name: str):
        self.document, self.name = document, name
        self.uv_set: int | None = None
        self.uv_transform = np.eye(3)

    def read(self, info: dict | None) -> np.ndarray | None:
        """[h, w, 3] float32 as stored, or None without a texture."""
        if info is None:
            return None
        document = self.document
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        uv_set, matrix = transform.get("texCoord", info.get("texCoord", 0)), _uv_matrix(transform)
        if self.uv_set is not None and (uv_set != self.uv_set or not np.allclose(matrix, self.uv_transform)):
            raise InputError(
                f"{document.path}: the textures of material '{self.name}' have different coordinates; "
                "bake them to one set"
            )
        self.uv_set, self.uv_transform = uv_set, matrix
        texture = document.json["textures"][info["index"]]
        sampler = document.json["samplers"][texture["sampler"]] if "sampler" in texture else {}
        if sampler.get("wrapS", REPEAT) != REPEAT or sampler.get("wrapT", REPEAT) != REPEAT:
            note(f"{document.path}: a texture of material '{self.name}' is clamped or mirrored; drawn repeated")
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        if "source" not in texture and "source" not in webp:
            kinds = ", ".join(texture.get("extensions", {})) or "no image"
            raise InputError(
                f"{document.path}: a texture of material '{self.name}' comes as {kinds}; export it with PNG or JPEG"
            )
        data, image = document.image(texture.get("source", webp.get("source")))
        pixels = decode_image(data, image)
        document.spend(pixels.size, BYTES_OF_PIXEL)
        if not np.isfinite(pixels).all():
            raise InputError(f"{image}: has NaN or infinite pixels; clean it and export again")
        return pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)


def _uv_matrix(transform: dict) -> np.ndarray:
    """translation * rotation * scale as in the extension's text; angles turn counter-clockwise, v downward."""
    angle = transform.get("rotation", 0.0)
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([*transform.get("scale", (1, 1)), 1.0])
    matrix[:2, 2] = transform.get("offset", (0.0, 0.0))
    return matrix


def _finite(document: Document, name: str, values, count: int) -> list[float]:
    values = np.asarray(values, dtype=np.float64).reshape(-1)
    if len(values) != count or not (np.abs(values) <= LARGEST_FACTOR).all():
        raise InputError(f"{document.path}: material '{name}' has a factor that is no usable number; repair it")
    return values.tolist()


def _unit(document: Document, name: str, values, count: int) -> list[float]:
    factors = _finite(document, name, values, count)
    if min(factors) < 0 or max(factors) > 1:
        note(f"{document.path}: material '{name}' has a factor outside [0, 1]; clipped")
    return np.clip(factors, 0, 1).tolist()
