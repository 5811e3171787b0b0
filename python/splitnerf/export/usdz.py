"""Writes a textured asset as USDZ, through usd-core (the optional extra `usd`)."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset
from splitnerf.data.images import write_image
from splitnerf.errors import InputError
from splitnerf.export.maps import Maps, encode_maps, y_up
from splitnerf.files import atomic_path


def require_usd() -> None:
    """Raises InputError where usd-core is not installed."""
    try:
        import pxr.Usd  # noqa: F401
    except ImportError:
        raise InputError("--formats usdz: needs usd-core; pip install 'splitnerf[usd]'") from None


def write_usdz(path: str | os.PathLike, asset: Asset, occlusion: np.ndarray | None = None) -> None:
    """Writes one mesh with one UsdPreviewSurface, y up, textures as PNG inside, atomically.

    Args:
        path: The file, with the suffix .usdz.
        asset: The asset, with one material.
        occlusion: [h, w] occlusion in [0, 1], 1 = open, with the size of the roughness-metallic texture; or None.

    Raises:
        InputError: usd-core is not installed.
        RuntimeError: See :func:`splitnerf.export.maps.encode_maps`.
        OSError: The file cannot be written.
    """
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
    surface = _shader(stage, material, "surface", "UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    types, factors = Sdf.ValueTypeNames, asset.materials[0]
    inputs = {"diffuseColor": types.Color3f, "normal": types.Normal3f}
    inputs |= dict.fromkeys(("occlusion", "roughness", "metallic"), types.Float)
    surface.CreateInput("diffuseColor", types.Color3f).Set(Gf.Vec3f(*factors.albedo))
    surface.CreateInput("roughness", types.Float).Set(float(factors.roughness))
    surface.CreateInput("metallic", types.Float).Set(float(factors.metallic))
    coordinates = _shader(stage, material, "uv", "UsdPrimvarReader_float2")
    coordinates.CreateInput("varname", types.String).Set("st")
    for name, pixels, space, uses in (
        ("albedo", maps.albedo, "sRGB", {"diffuseColor": "rgb"}),
        ("orm", maps.orm, "raw", {"occlusion": "r", "roughness": "g", "metallic": "b"}),
        ("normal", maps.normal, "raw", {"normal": "rgb"}),
    ):
        if pixels is None:
            continue
        file = folder / "textures" / f"{name}.png"
        write_image(file, pixels / np.float32(255))
        texture = _shader(stage, material, name, "UsdUVTexture")
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


def _shader(stage: object, material: object, name: str, kind: str) -> object:
    from pxr import UsdShade

    shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild(name))
    shader.CreateIdAttr(kind)
    return shader
