"""A glTF file as an `Asset`."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset, Material, vertex_tangents
from splitnerf.data.gltf.document import Document
from splitnerf.data.gltf.geometry import Part, scene_parts, split_mirrored
from splitnerf.data.gltf.materials import SUPPORTED_EXTENSIONS, TextureSlots, read_material
from splitnerf.errors import InputError, note

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
    unread = set(document.get("extensionsUsed")) - SUPPORTED_EXTENSIONS
    if unread:
        note(f"{path}: uses {', '.join(sorted(unread))}; left out")
    if document.get("animations"):
        note(f"{path}: has animations; drawn as it stands")
    parts = scene_parts(document)
    indices = list(dict.fromkeys(part.material for part in parts))
    materials = {index: read_material(document, index) for index in indices}
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
        name=path.stem,
        vertices=_z_up(np.concatenate([part.vertices for part in parts])),
        triangles=np.concatenate([p.triangles + start for p, start in zip(parts, starts)]).astype(np.int32),
        normals=_z_up(np.concatenate([part.normals for part in parts])),
        material_ids=np.repeat([indices.index(part.material) for part in parts], counts).astype(np.int32),
        materials=[materials[index][0] for index in indices],
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
