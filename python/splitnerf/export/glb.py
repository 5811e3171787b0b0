"""Writes a textured asset as binary glTF 2.0."""

from __future__ import annotations

import os

import numpy as np
import trimesh
from PIL import Image
from trimesh.exchange.gltf import export_glb
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

from splitnerf.data.asset import Asset
from splitnerf.export.maps import encode_maps, y_up
from splitnerf.files import atomic_path

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


def write_glb(path: str | os.PathLike, asset: Asset, occlusion: np.ndarray | None = None) -> None:
    """Writes one mesh with one metallic-roughness material, y up, textures as PNG inside, atomically.

    Args:
        path: The file, with the suffix .glb.
        asset, occlusion: See :func:`glb_content`.

    Raises:
        RuntimeError: See :func:`splitnerf.export.maps.encode_maps`.
        OSError: The file cannot be written.
    """
    content = glb_content(asset, occlusion, path)
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def glb_content(
    asset: Asset,
    occlusion: np.ndarray | None = None,
    path: str | os.PathLike = "the asset",
    *,
    filtering: int | None = None,
) -> bytes:
    """The bytes of a GLB with one mesh and one metallic-roughness material, y up, textures as PNG inside.

    Occlusion, roughness and metallic share one image, as glTF proposes. Without textures there are the factors alone.

    Args:
        asset: The asset, with one material.
        occlusion: [h, w] occlusion in [0, 1], 1 = open, with the size of the roughness-metallic texture; or None.
        path: The name of the file in messages.
        filtering: glTF's number of the textures' filter; None leaves it to the viewer.

    Raises:
        RuntimeError: See :func:`splitnerf.export.maps.encode_maps`.
    """
    maps, material = encode_maps(path, asset, occlusion), asset.materials[0]
    images = [None if pixels is None else Image.fromarray(pixels) for pixels in (maps.albedo, maps.orm, maps.normal)]
    pbr = PBRMaterial(
        name=material.name,
        roughnessFactor=float(material.roughness),
        metallicFactor=float(material.metallic),
        baseColorTexture=images[0],
        metallicRoughnessTexture=images[1],
        normalTexture=images[2],
    )
    mesh = trimesh.Trimesh(
        y_up(asset.vertices),
        asset.triangles,
        vertex_normals=y_up(asset.normals),
        visual=TextureVisuals(uv=None if asset.uv is None else asset.uv * [1, -1] + [0, 1], material=pbr),
        process=False,
    )
    if asset.tangents is not None:
        tangents = np.column_stack([y_up(asset.tangents[:, :3]), asset.tangents[:, 3]])
        mesh.vertex_attributes["_TANGENT"] = tangents.astype(np.float32)
    if asset.colors is not None:
        mesh.vertex_attributes["_COLOR_0"] = asset.colors.astype(np.float32)

    def finish(tree: dict) -> None:
        """Adds to the file what trimesh omits: exact factors, the names of attributes, one image for two uses, filters,
        buffer targets."""
        tree["asset"]["generator"] = "SplitNeRF"
        primitive = tree["meshes"][0]["primitives"][0]
        attributes, pbr = primitive["attributes"], tree["materials"][0]["pbrMetallicRoughness"]
        pbr["baseColorFactor"] = [*map(float, material.albedo), 1.0]  # trimesh would round it to 8 bit
        for name in ("_TANGENT", "_COLOR_0"):
            if name in attributes:
                attributes[name[1:]] = attributes.pop(name)
        if filtering is not None:
            tree["samplers"] = [{"minFilter": filtering, "magFilter": filtering}]
            tree["textures"] = [texture | {"sampler": 0} for texture in tree["textures"]]
        if occlusion is not None:
            tree["materials"][0]["occlusionTexture"] = {"index": pbr["metallicRoughnessTexture"]["index"]}
        for accessor in (primitive["indices"], *attributes.values()):
            target = ELEMENT_ARRAY_BUFFER if accessor == primitive["indices"] else ARRAY_BUFFER
            tree["bufferViews"][tree["accessors"][accessor]["bufferView"]]["target"] = target

    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name=asset.name, geom_name=asset.name)
    return export_glb(scene, include_normals=True, tree_postprocessor=finish)
