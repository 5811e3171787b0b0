"""Primitives of a glTF scene as triangles in the file's world, y up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import trimesh

from splitnerf.data.gltf.document import BYTES_OF_VALUE, Document
from splitnerf.errors import InputError, note, note_once

TRIANGLES, STRIP, FAN = 4, 5, 6
MANY_NODES = 20000  # seconds of work, more or less
VALUES_OF_CALL = 2048  # that the work for a node, or for a primitive that it places, counts as
BYTES_OF_CORNER = 150  # that a corner of a triangle takes where the file has no normals


@dataclass
class Part:
    """One primitive as placed by one node, in the file's world: vertices, normals [n, 3] float64, triangles [m, 3],
    tangents [n, 4] or None, linear colors [n, 3] or None, TEXCOORD_N [n, 2] by N, and the material's index, None for
    glTF's default."""

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    tangents: np.ndarray | None
    colors: np.ndarray | None
    uv: dict[int, np.ndarray]
    material: int | None


def scene_parts(document: Document) -> list[Part]:
    """All triangles of the file's scene, instances repeated. Raises InputError where geometry is damaged, or
    a node contains itself."""
    nodes, meshes = document.get("nodes"), document.get("meshes")
    placed = sum(len(meshes[node["mesh"]]["primitives"]) for node in nodes if "mesh" in node)
    document.spend(VALUES_OF_CALL * (len(nodes) + placed), 1)
    matrices = _world_matrices(document)
    parts, others = [], False
    if len(matrices) > MANY_NODES:
        note(f"{document.path}: has {len(matrices)} nodes, which takes a while; join its meshes")
    for index, matrix in matrices.items():
        node = nodes[index]
        if "mesh" not in node:
            continue
        mesh = meshes[node["mesh"]]
        label = f"{document.path}: mesh '{mesh.get('name', node['mesh'])}'"
        for primitive in mesh["primitives"]:
            if primitive.get("mode", TRIANGLES) not in (TRIANGLES, STRIP, FAN):
                others = True
                continue
            if primitive.get("targets"):
                note_once(f"{label} has morph targets; drawn in its base shape")
            placement = matrix[None]
            if "skin" in node:
                note_once(f"{label} has a skin; drawn in its rest pose")
                placement = _skin_matrices(document, label, node["skin"], primitive["attributes"], matrices)
            part = _read_part(document, label, primitive, placement)
            if part is not None:
                parts.append(part)
    if others and parts:
        note(f"{document.path}: has points or lines; left out")
    if not parts:
        raise InputError(f"{document.path}: has no triangles{', only points or lines' * others}; export a mesh")
    return parts


def scene_roots(content: dict) -> list[int]:
    """The nodes at the root of a file's default scene, or of all nodes where the file has no scene."""
    if content.get("scenes"):
        return content["scenes"][content.get("scene", 0)].get("nodes", [])
    nodes = content.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    return [index for index in range(len(nodes)) if index not in children]


def split_mirrored(part: Part, uv: np.ndarray) -> tuple[Part, np.ndarray]:
    """Doubles the vertices where texture coordinates [n, 2] meet their mirror image: the two sides have no tangent
    space in common (MikkTSpace parts them too)."""
    texels = uv[part.triangles]
    edges = texels[:, 1:] - texels[:, :1]
    side = edges[:, 0, 0] * edges[:, 1, 1] < edges[:, 0, 1] * edges[:, 1, 0]
    corners, triangles = np.unique(2 * part.triangles + side[:, None], return_inverse=True)
    source = corners // 2
    if len(np.unique(source)) == len(source):
        return part, uv
    split = replace(
        part,
        vertices=part.vertices[source],
        triangles=triangles.reshape(-1, 3),
        normals=part.normals[source],
        colors=None if part.colors is None else part.colors[source],
        uv={},
    )
    return split, uv[source]


def _world_matrices(document: Document) -> dict[int, np.ndarray]:
    """[4, 4] of every node of the default scene, or of all nodes where the file has no scene."""
    nodes, roots = document.get("nodes"), scene_roots(document.json)
    matrices: dict[int, np.ndarray] = {}
    pending = [(root, np.eye(4)) for root in reversed(roots)]
    while pending:
        index, parent = pending.pop()
        if index in matrices:
            raise InputError(f"{document.path}: damaged, node {index} stands in the scene twice; export it again")
        matrix = parent @ _local_matrix(nodes[index])
        if not np.isfinite(matrix).all():
            raise InputError(f"{document.path}: the transform of node {index} has NaN or infinite entries; repair it")
        matrices[index] = matrix
        pending += [(child, matrix) for child in reversed(nodes[index].get("children", []))]
    return matrices


def _local_matrix(node: dict) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    if "rotation" in node:
        x, y, z, w = node["rotation"]
        matrix = trimesh.transformations.quaternion_matrix([w, x, y, z])
    matrix[:3, :3] *= np.array(node.get("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _skin_matrices(
    document: Document, label: str, skin: int, attributes: dict, matrices: dict[int, np.ndarray]
) -> np.ndarray:
    """[n, 4, 4] weighted means of joint * inverse bind matrix for each vertex; the node's own matrix does not count."""
    joints = document.json["skins"][skin]["joints"]
    document.spend(16 * len(joints), BYTES_OF_VALUE)
    missing = [joint for joint in joints if joint not in matrices]
    if missing or "JOINTS_0" not in attributes or "WEIGHTS_0" not in attributes:
        raise InputError(f"{label} has a skin without joints or weights; apply it and export again")
    placed = np.stack([matrices[joint] for joint in joints])
    if "inverseBindMatrices" in document.json["skins"][skin]:
        inverse = document.array(document.json["skins"][skin]["inverseBindMatrices"])
        placed = placed @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)[: len(joints)]
    sets = [n for n in range(8) if f"JOINTS_{n}" in attributes and f"WEIGHTS_{n}" in attributes]
    which = np.concatenate([document.array(attributes[f"JOINTS_{n}"]) for n in sets], axis=1)
    weights = np.concatenate([document.array(attributes[f"WEIGHTS_{n}"]) for n in sets], axis=1)
    total = weights.sum(axis=1, keepdims=True)
    if not (total > 0).all() or which.max() >= len(joints):
        raise InputError(f"{label} has vertices without weights or joints out of range; apply its skin first")
    blended = np.zeros((len(which), 4, 4))
    for column in range(which.shape[1]):
        blended += (weights[:, column] / total[:, 0])[:, None, None] * placed[which[:, column]]
    return blended


def _read_part(document: Document, label: str, primitive: dict, placement: np.ndarray) -> Part | None:
    """Reads a primitive and places it; [1 | n, 4, 4] matrices. None where it has no triangle."""
    attributes = primitive["attributes"]
    if "POSITION" not in attributes:
        raise InputError(f"{label} has no positions; export it again")
    count = document.json["accessors"][attributes["POSITION"]]["count"]
    known = ("POSITION", "NORMAL", "TANGENT", "COLOR_0")
    names = [name for name in attributes if name in known or name.startswith("TEXCOORD_")]
    arrays = {name: document.array(attributes[name]).astype(np.float64) for name in names}
    for name, values in arrays.items():
        if len(values) != count:
            raise InputError(f"{label} has {len(values)} values of {name} for {count} vertices; export it again")
        if not np.isfinite(values).all():
            raise InputError(f"{label} has NaN or infinite values in {name}; clean it and export again")
    indices = document.array(primitive["indices"]).reshape(-1) if "indices" in primitive else np.arange(count)
    if len(indices) and (indices.min() < 0 or indices.max() >= count):
        raise InputError(f"{label} has vertex indices out of range, {indices.max()} of {count}; export it again")
    triangles = _triangles(label, indices, primitive.get("mode", TRIANGLES))
    if len(triangles) == 0:
        return None
    if "NORMAL" not in arrays:  # then glTF prescribes flat shading and ignores the file's tangents
        document.spend(triangles.size, BYTES_OF_CORNER)
        arrays = {name: values[triangles.reshape(-1)] for name, values in arrays.items() if name != "TANGENT"}
        placement = placement if len(placement) == 1 else placement[triangles.reshape(-1)]
        triangles = np.arange(triangles.size).reshape(-1, 3)

    linear = placement[:, :3, :3]
    volume = np.linalg.det(linear)
    if (volume == 0).any():
        note_once(f"{label} is scaled to nothing by a node; left out")
        return None
    vertices = (linear @ arrays["POSITION"][:, :, None])[:, :, 0] + placement[:, :3, 3]
    mirrored = bool((volume < 0).mean() > 0.5)
    triangles = triangles[:, ::-1] if mirrored else triangles
    if "NORMAL" in arrays:
        normals = (np.linalg.inv(linear).transpose(0, 2, 1) @ arrays["NORMAL"][:, :, None])[:, :, 0]
        normals = _unit_or_geometric(label, normals, vertices, triangles)
    else:
        normals = np.repeat(_unit(_crosses(vertices, triangles)), 3, axis=0)
    tangents = None
    if "TANGENT" in arrays:
        along = (linear @ arrays["TANGENT"][:, :3, None])[:, :, 0]
        along = _unit(along - normals * (along * normals).sum(axis=1, keepdims=True))
        tangents = np.column_stack([along, np.where(arrays["TANGENT"][:, 3] < 0, -1.0, 1.0) * (-1) ** mirrored])
    colors = np.clip(arrays["COLOR_0"][:, :3], 0, 1) if "COLOR_0" in arrays else None
    if colors is not None and (colors != arrays["COLOR_0"][:, :3]).any():
        note_once(f"{label} has vertex colours outside [0, 1]; clipped")
    uv = {int(name[9:]): values[:, :2] for name, values in arrays.items() if name.startswith("TEXCOORD_")}
    return Part(vertices, triangles, normals, tangents, colors, uv, primitive.get("material"))


def _triangles(label: str, indices: np.ndarray, mode: int) -> np.ndarray:
    """[m, 3] from a list, a strip or a fan."""
    if mode == TRIANGLES:
        if len(indices) % 3:
            raise InputError(f"{label} has {len(indices)} indices, not three a triangle; export it again")
        return indices.reshape(-1, 3)
    first, second, third = indices[:-2], indices[1:-1], indices[2:]
    if mode == FAN:
        return np.stack([second, third, np.broadcast_to(indices[:1], second.shape)], axis=1)
    odd = np.arange(len(first)) % 2 == 1
    return np.stack([first, np.where(odd, third, second), np.where(odd, second, third)], axis=1)


def _crosses(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    u, v = b - a, c - a  # np.cross takes ten times as long for few
    return u[:, [1, 2, 0]] * v[:, [2, 0, 1]] - u[:, [2, 0, 1]] * v[:, [1, 2, 0]]


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors; z where a vector has no length."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 0, vectors / np.where(lengths > 0, lengths, 1.0), [0.0, 0.0, 1.0])


def _unit_or_geometric(label: str, normals: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(normals, axis=1)
    used = np.unique(triangles)
    if not (lengths[used] > 0).all():
        note(f"{label} has normals of length 0; replaced by those of its triangles")
        crosses = _crosses(vertices, triangles)
        sums = np.zeros_like(vertices)
        for corner in range(3):
            np.add.at(sums, triangles[:, corner], crosses)
        normals = np.where((lengths > 0)[:, None], normals, sums)
    return _unit(normals)
