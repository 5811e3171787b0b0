"""Writes a textured asset as OBJ with MTL and PNG files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset
from splitnerf.data.images import write_image
from splitnerf.export.maps import encode_maps, y_up
from splitnerf.files import atomic_path


def write_obj(path: str | os.PathLike, asset: Asset) -> list[Path]:
    """Writes NAME.obj, NAME.mtl and NAME_albedo.png, _roughness.png, _metallic.png, _normal.png beside it, y up.

    The MTL holds the widespread PBR extension: map_Kd (sRGB), map_Pr, map_Pm (linear), norm.

    Args:
        path: The file, with the suffix .obj.
        asset: The asset, with one material.

    Returns:
        The files.

    Raises:
        RuntimeError: See :func:`splitnerf.export.maps.encode_maps`.
        OSError: A file cannot be written.
    """
    path = Path(path)
    maps, material = encode_maps(path, asset, None), asset.materials[0]
    images = {"map_Kd": ("albedo", maps.albedo), "norm": ("normal", maps.normal)}
    if maps.orm is not None:
        images |= {"map_Pr": ("roughness", maps.orm[..., 1]), "map_Pm": ("metallic", maps.orm[..., 2])}
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
