"""Writes a textured asset as binary glTF 2.0, as OBJ with MTL and PNG files, and as USDZ through usd-core (the optional extra
`usd`); all y up, with textures of 8 bit, atomically."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image
from trimesh.exchange.gltf import export_glb
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

from splitnerf.data.asset import Asset
from splitnerf.data.images import linear_to_srgb, to_uint8, write_image
from splitnerf.errors import InputError
from splitnerf.files import atomic_path

BAND = 1 << 20  # texels encoded at a time
Maps = list[np.ndarray | None]  # of :func:`encode_maps`
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


def write_glb(path: str | os.PathLike, asset: Asset, occlusion: np.ndarray | None = None) -> None:
    """Writes the file of :func:`glb_content` atomically. Raises RuntimeError as that does, and OSError where writing fails."""
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
    """The bytes of a GLB with one mesh and one metallic-roughness material, y up, textures as PNG inside, all called by the asset's
    name: NAME and NAME_basecolor, NAME_orm, NAME_normal. Raises RuntimeError, see :func:`encode_maps`.

    Occlusion, roughness and metallic share one image, as glTF proposes. Without textures there are the factors alone.

    Args:
        asset: The asset, with one material.
        occlusion: [h, w] occlusion in [0, 1], 1 = open, with the size of the roughness-metallic texture; or None.
        path: The name of the file in messages.
        filtering: glTF's number of the textures' filter; None leaves it to the viewer.
    """
    maps, material = encode_maps(path, asset, occlusion), asset.materials[0]
    images = [None if pixels is None else Image.fromarray(pixels) for pixels in maps]
    pbr = PBRMaterial(
        name=asset.name,
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
        for kind, texture in (
            ("basecolor", pbr.get("baseColorTexture")),
            ("orm", pbr.get("metallicRoughnessTexture")),
            ("normal", tree["materials"][0].get("normalTexture")),
        ):
            if texture is not None:
                tree["images"][tree["textures"][texture["index"]]["source"]]["name"] = f"{asset.name}_{kind}"
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


def write_obj(path: str | os.PathLike, asset: Asset) -> list[Path]:
    """Writes NAME.obj, NAME.mtl and NAME_albedo.png, _roughness.png, _metallic.png, _normal.png beside it, y up, and returns the
    files. The MTL holds the widespread PBR extension: map_Kd (sRGB), map_Pr, map_Pm (linear), norm. Raises RuntimeError, see
    :func:`encode_maps`, and OSError where a file cannot be written."""
    path = Path(path)
    (albedo, orm, normal), material = encode_maps(path, asset, None), asset.materials[0]
    images = {"map_Kd": ("albedo", albedo), "norm": ("normal", normal)}
    if orm is not None:
        images |= {"map_Pr": ("roughness", orm[..., 1]), "map_Pm": ("metallic", orm[..., 2])}
    lines = [f"newmtl {asset.name}", "Kd " + " ".join(f"{c:.6g}" for c in material.albedo)]
    lines += [f"Pr {material.roughness:.6g}", f"Pm {material.metallic:.6g}", "illum 2"]
    written = [path, path.with_suffix(".mtl")]
    for key, (name, pixels) in images.items():
        if pixels is not None:
            written.append(path.with_name(f"{path.stem}_{name}.png"))
            write_image(written[-1], pixels / np.float32(255))
            lines.append(f"{key} {written[-1].name}")
    with atomic_path(written[1]) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="surrogateescape")

    corners = asset.triangles + 1
    blocks = [("v", y_up(asset.vertices)), ("vn", y_up(asset.normals))]
    if asset.uv is not None:
        blocks.append(("vt", asset.uv * [1, -1] + [0, 1]))
    text = [f"mtllib {written[1].name}", f"o {asset.name}", f"usemtl {asset.name}"]
    for key, rows in blocks:
        text += [key + " " + " ".join(f"{x:.7g}" for x in row) for row in rows.tolist()]
    corner = "{0}//{0}" if asset.uv is None else "{0}/{0}/{0}"
    text += ["f " + " ".join(corner.format(i) for i in row) for row in corners.tolist()]
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(text) + "\n", encoding="utf-8", errors="surrogateescape")
    return written


def require_usd() -> None:
    """Raises InputError where usd-core is not installed."""
    try:
        import pxr.Usd  # noqa: F401
    except ImportError:
        raise InputError("--formats usdz: needs usd-core; pip install 'splitnerf[usd]'") from None


def write_usdz(path: str | os.PathLike, asset: Asset, occlusion: np.ndarray | None = None) -> None:
    """Writes one mesh with one UsdPreviewSurface, y up, textures as PNG inside, atomically; arguments as for :func:`glb_content`.
    Raises InputError where usd-core is not installed, RuntimeError, see :func:`encode_maps`, and OSError where writing fails."""
    require_usd()
    from pxr import Sdf, Usd, UsdUtils

    maps = encode_maps(path, asset, occlusion)
    with tempfile.TemporaryDirectory() as folder:
        stage_file = Path(folder) / "asset.usdc"
        stage = Usd.Stage.CreateNew(str(stage_file))
        _fill(stage, asset, maps, Path(folder))
        stage.Save()
        package = Path(folder) / "asset.usdz"
        if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(stage_file)), str(package)):
            raise OSError(f"{path}: the package could not be written in {folder}")
        with atomic_path(path) as temporary:
            temporary.write_bytes(package.read_bytes())


def _fill(stage: object, asset: Asset, maps: Maps, folder: Path) -> None:
    """The stage's prims, and the textures as PNG files in the folder."""
    from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade, Vt

    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/" + Tf.MakeValidIdentifier(asset.name))
    stage.SetDefaultPrim(root.GetPrim())
    Usd.ModelAPI(root.GetPrim()).SetKind("component")

    points = y_up(asset.vertices).astype(np.float32)
    mesh = UsdGeom.Mesh.Define(stage, root.GetPath().AppendChild("mesh"))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(asset.triangles), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(asset.triangles, np.int32).reshape(-1)))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(y_up(asset.normals).astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr([Gf.Vec3f(*points.min(axis=0).tolist()), Gf.Vec3f(*points.max(axis=0).tolist())])
    if asset.uv is not None:
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
        st.Set(Vt.Vec2fArray.FromNumpy((asset.uv * [1, -1] + [0, 1]).astype(np.float32)))

    material = UsdShade.Material.Define(stage, root.GetPath().AppendChild("material"))

    def shader(name: str, kind: str) -> UsdShade.Shader:
        made = UsdShade.Shader.Define(stage, material.GetPath().AppendChild(name))
        made.CreateIdAttr(kind)
        return made

    surface = shader("surface", "UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    types, factors = Sdf.ValueTypeNames, asset.materials[0]
    inputs = {"diffuseColor": types.Color3f, "normal": types.Normal3f}
    inputs |= dict.fromkeys(("occlusion", "roughness", "metallic"), types.Float)
    surface.CreateInput("diffuseColor", types.Color3f).Set(Gf.Vec3f(*factors.albedo))
    surface.CreateInput("roughness", types.Float).Set(float(factors.roughness))
    surface.CreateInput("metallic", types.Float).Set(float(factors.metallic))
    coordinates = shader("uv", "UsdPrimvarReader_float2")
    coordinates.CreateInput("varname", types.String).Set("st")
    kinds = (
        ("albedo", "sRGB", {"diffuseColor": "rgb"}),
        ("orm", "raw", {"occlusion": "r", "roughness": "g", "metallic": "b"}),
        ("normal", "raw", {"normal": "rgb"}),
    )
    for (name, space, uses), pixels in zip(kinds, maps):
        if pixels is None:
            continue
        file = folder / "textures" / f"{name}.png"
        write_image(file, pixels / np.float32(255))
        texture = shader(name, "UsdUVTexture")
        texture.CreateInput("file", types.Asset).Set(f"./textures/{name}.png")
        texture.CreateInput("sourceColorSpace", types.Token).Set(space)
        texture.CreateInput("st", types.Float2).ConnectToSource(coordinates.ConnectableAPI(), "result")
        if name == "normal":
            texture.CreateInput("scale", types.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
            texture.CreateInput("bias", types.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))
        for use, channels in uses.items():
            texture.CreateOutput(channels, types.Float3 if channels == "rgb" else types.Float)
            surface.CreateInput(use, inputs[use]).ConnectToSource(texture.ConnectableAPI(), channels)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def encode_maps(path: object, asset: Asset, occlusion: np.ndarray | None) -> Maps:
    """The textures of an asset's one material in the encoding of files, [h, w, 3] uint8, None where it has only a factor: albedo in
    sRGB; occlusion (1 where there is none), roughness, metallic, linear; and (normal + 1) / 2. Raises RuntimeError, which names
    `path`, where there are several materials or textures without uv, or something is not finite or of wrong size."""
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
    albedo, roughness_metallic = material.albedo_texture, material.roughness_metallic_texture
    normal = material.normal_texture
    for texture in (albedo, roughness_metallic, normal, occlusion):
        if texture is not None and (asset.uv is None or not np.isfinite(texture).all()):
            raise RuntimeError(f"{path}: textures must be finite and the mesh have texture coordinates")
    orm = None
    if roughness_metallic is not None:
        open_share = np.broadcast_to(np.float32(1), roughness_metallic.shape[:2]) if occlusion is None else occlusion
        orm = encoded(lambda *bands: np.dstack(bands), open_share, roughness_metallic)
    albedo = None if albedo is None else encoded(linear_to_srgb, albedo)
    return [albedo, orm, None if normal is None else encoded(lambda band: 0.5 * band + 0.5, normal)]


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
