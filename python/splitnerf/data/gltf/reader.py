"""A glTF file as an `Asset`; materials have their factors as written, and textures decoded to linear floats."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset, Material, vertex_tangents
from splitnerf.data.gltf.document import BYTES_OF_PIXEL, Document
from splitnerf.data.gltf.geometry import Part, scene_parts, split_mirrored
from splitnerf.data.images import decode_image, srgb_to_linear
from splitnerf.errors import InputError, note

SUPPORTED_EXTENSIONS = frozenset(
    {"KHR_texture_transform", "KHR_mesh_quantization", "KHR_materials_emissive_strength", "EXT_texture_webp"}
)
REPEAT = 10497
LARGEST_FACTOR = 1e9
FARTHEST = 1e12  # coordinates; the tracer's products of two stay finite


def read_asset(path: str | os.PathLike) -> Asset:
    """Reads a glTF 2.0 file, .glb or .gltf with its files beside it: all primitives of its scene as one mesh, y up
    turned to z up, (x, y, z) -> (x, -z, y). Notes on stderr name features that are not drawn (transparency, animation,
    unknown extensions). Raises InputError where the file cannot be read or drawn."""
    path = Path(path)
    document = Document(path)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # the results are checked
            return _read(document)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, MemoryError) as error:
        raise InputError(f"{path}: is not valid glTF ({type(error).__name__}: {error}); export it again") from None


def _read(document: Document) -> Asset:
    path = document.path
    foreign = set(document.get("extensionsRequired")) - SUPPORTED_EXTENSIONS
    if foreign:
        raise InputError(f"{path}: requires {', '.join(sorted(foreign))}, which is not read; export it without")
    unread = {*document.get("extensionsUsed"), *_extensions(document.json)} - SUPPORTED_EXTENSIONS
    if unread:
        note(f"{path}: uses {', '.join(sorted(unread))}; left out")
    if document.get("animations"):
        note(f"{path}: has animations; drawn as it stands")
    parts = scene_parts(document)
    materials = {index: _read_material(document, index) for index in dict.fromkeys(part.material for part in parts)}
    ids = {index: i for i, index in enumerate(materials)}
    uvs = [_uv(path, part, *materials[part.material]) for part in parts]
    with_normal_map = any(material.normal_texture is not None for material, _ in materials.values())
    for i, (part, uv) in enumerate(zip(parts, uvs)):
        if part.tangents is None and materials[part.material][0].normal_texture is not None:
            parts[i], uvs[i] = split_mirrored(part, uv)

    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    counts = [len(part.triangles) for part in parts]
    uv = None
    if any(entry is not None for entry in uvs):
        uv = np.concatenate([np.zeros((len(p.vertices), 2)) if c is None else c for p, c in zip(parts, uvs)])
    colors = None
    if any(part.colors is not None for part in parts):
        colors = np.concatenate([np.ones((len(p.vertices), 3)) if p.colors is None else p.colors for p in parts])
    asset = Asset(
        name=_name_of(document) or path.stem,
        vertices=_z_up(np.concatenate([part.vertices for part in parts])),
        triangles=np.concatenate([p.triangles + start for p, start in zip(parts, starts)]).astype(np.int32),
        normals=_z_up(np.concatenate([part.normals for part in parts])),
        material_ids=np.repeat([ids[part.material] for part in parts], counts).astype(np.int32),
        materials=[material for material, _ in materials.values()],
        uv=None if uv is None else uv.astype(np.float32),
        tangents=_z_up(np.concatenate([_tangents(p, c) for p, c in zip(parts, uvs)])) if with_normal_map else None,
        colors=None if colors is None else colors.astype(np.float32),
    )
    for values in (asset.vertices, asset.normals, asset.uv, asset.tangents):
        if values is not None and not np.isfinite(values).all():
            raise InputError(f"{path}: has NaN or infinite coordinates after its transforms; repair them")
    if np.abs(asset.vertices).max() > FARTHEST:
        raise InputError(f"{path}: has vertices farther than {FARTHEST:g} from the origin; scale it down")
    corners = asset.vertices[asset.triangles]
    if not np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any():
        raise InputError(f"{path}: no triangle has an area; export the mesh again")
    return asset


def _extensions(content: dict) -> set[str]:
    """The names of the extensions that parts of a file have, whether it declares them or not."""
    names, pending = set(), [content]
    while pending:
        value = pending.pop()
        if isinstance(value, dict):
            names |= {*value["extensions"]} if isinstance(value.get("extensions"), dict) else set()
            pending += value.values()
        elif isinstance(value, list):
            pending += value
    return names


def _uv(path: Path, part: Part, material: Material, slots: TextureSlots) -> np.ndarray | None:
    """[n, 2] where the part's material has textures."""
    if slots.uv_set is None:
        return None
    if slots.uv_set not in part.uv:
        raise InputError(
            f"{path}: material '{material.name}' has textures, but a mesh with it has no "
            f"TEXCOORD_{slots.uv_set}; unwrap it and export again"
        )
    return part.uv[slots.uv_set] @ slots.uv_transform[:2, :2].T + slots.uv_transform[:2, 2]


def _tangents(part: Part, uv: np.ndarray | None) -> np.ndarray:
    """[n, 4]: the file's, else from the texture coordinates, which glTF prescribes."""
    if part.tangents is not None:
        return part.tangents
    if uv is None:
        uv = np.zeros((len(part.vertices), 2))
    return vertex_tangents(part.vertices, part.triangles, part.normals, uv)


def _z_up(vectors: np.ndarray) -> np.ndarray:
    """[n, 3 | 4] of the file, a fourth component kept."""
    return np.column_stack([vectors[:, 0], -vectors[:, 2], vectors[:, 1], *vectors.T[3:]]).astype(np.float32)


def _read_material(document: Document, index: int | None) -> tuple[Material, TextureSlots]:
    """One material without alpha and occlusion, and where its textures lie; index None means glTF's default (white, rough,
    metallic). Raises InputError where an image cannot be read, or the textures need more than one set of coordinates."""
    if index is None:
        note(f"{document.path}: a mesh has no material; drawn as glTF's default, white, roughness 1, metallic 1")
        return Material(name="default", metallic=1.0), TextureSlots(document, "default")
    source = document.json["materials"][index]
    name = source.get("name", f"material {index}")
    pbr = source.get("pbrMetallicRoughness", {})
    if not pbr and "KHR_materials_pbrSpecularGlossiness" in source.get("extensions", {}):
        note(f"{document.path}: the colours of '{name}', specular and glossiness, are not read; drawn as white metal")
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
    emissive = _factors(document, name, source.get("emissiveFactor", (0.0, 0.0, 0.0)), 3)
    strength = source.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    strength = max(0.0, _finite(document, name, strength, 1)[0])
    material = Material(
        name=name,
        albedo=tuple(_factors(document, name, pbr.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[:3], 3)),
        roughness=_factors(document, name, pbr.get("roughnessFactor", 1.0), 1)[0],
        metallic=_factors(document, name, pbr.get("metallicFactor", 1.0), 1)[0],
        emission=tuple(strength * channel for channel in emissive),
        albedo_texture=albedo,
        roughness_metallic_texture=roughness_metallic,
        normal_texture=normal,
        emission_texture=emission,
    )
    return material, slots


def _name_of(document: Document) -> str:
    """The name of the one mesh of a file; empty where it has several, or no name."""
    meshes = document.json["meshes"]
    name = meshes[0].get("name", "") if len(meshes) == 1 else ""
    return name if isinstance(name, str) else ""


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
        pixels = decode_image(data, image, lambda n_values: document.spend(n_values, BYTES_OF_PIXEL))
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


def _factors(document: Document, name: str, values, count: int) -> list[float]:
    factors = _finite(document, name, values, count)
    if min(factors) < 0 or max(factors) > 1:
        note(f"{document.path}: material '{name}' has a factor outside [0, 1]; clipped")
    return np.clip(factors, 0, 1).tolist()
