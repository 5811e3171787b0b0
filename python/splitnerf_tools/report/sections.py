"""The report's sections: the asset in the 3D view, the test views, the changes by the refinement, the light."""

from __future__ import annotations

import copy
import io
import json
import math
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup
from PIL import Image
from splitnerf.data.asset import Asset
from splitnerf.data.environment import resize_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.gltf.document import Document
from splitnerf.data.images import area_average, linear_to_srgb, over_background
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import psnr
from splitnerf.refinement.level import evidence

from splitnerf_tools.report.embedding import (
    WHITE_PER_MEAN,
    as_halves,
    camera_of,
    data_uri,
    packed,
    photo_uri,
    tonemapped,
    white_of,
)

MOST_BYTES = 4 << 20  # of a GLB within a page
TEXTURE_SIDES = (2048, 1024, 512, 256)  # pixels that are tried, one after the other
MAPS = {
    "rgb": "image",
    "albedo": "albedo",
    "roughness": "roughness",
    "metallic": "metallic",
    "normal": "normals",
    "occlusion_diffuse": "occlusion, diffuse",
    "occlusion_specular": "occlusion, specular",
}
KINDS = {"rgb": "colour", "albedo": "colour", "normal": "normal"}  # of the others: "number"
LARGEST_ERRORS = {"colour": 0.25, "number": 0.5, "normal": 45.0}  # where the scale of error maps ends
MOST_PIXELS = 512  # of a picture's longer side
PICTURES = ("photo", "before", "after")
PAIRS = (("before", "after"), ("photo", "before"), ("photo", "after"))  # that the page compares
ROWS = 128  # of a light within the page


def asset_section(path: Path | None) -> dict | None:
    """The 3D view of a GLB: `packed`, its bytes; `camera`; `note`, what was changed or why nothing is shown; `facts`; `textures`;
    and `files` beside the page. None where `path` is None or no file is there."""
    if path is None or not path.is_file():
        return None
    try:
        asset = read_asset(path)
        content, note = fitted(path, MOST_BYTES)
    except InputError as error:
        return {"packed": None, "camera": None, "note": str(error), "facts": None, "textures": [], "files": []}
    return {
        "packed": content and packed(content),
        "camera": camera_of(asset),
        "note": note,
        "facts": facts_of(asset),
        "textures": textures_of(asset),
        "files": [
            {"name": name, "size": f"{(path.parent / name).stat().st_size / 1e6:.2g} MB"}
            for name in (path.name, "environment.exr", "environment.hdr")
            if (path.parent / name).is_file()
        ],
    }


def facts_of(asset: Asset) -> str:
    """How many faces an asset has, and how large it and its textures are."""
    sizes = {
        "{1} x {0}".format(*texture.shape)
        for material in asset.materials
        for texture in (material.albedo_texture, material.roughness_metallic_texture, material.normal_texture)
        if texture is not None
    }
    used = asset.vertices[asset.triangles.ravel()]
    edges = " x ".join(f"{edge:.3g}" for edge in np.ptp(used, axis=0))
    textures = f"textures of {', '.join(sorted(sizes))} pixels" if sizes else "no textures"
    return f"{len(asset.triangles):,} faces, {textures}; {edges} units wide, deep and high"


def textures_of(asset: Asset) -> list[dict]:
    """The first material's textures: `name` and `picture`."""
    material, maps = asset.materials[0], {}
    if material.albedo_texture is not None:
        maps["albedo"] = linear_to_srgb(np.clip(material.albedo_texture, 0, 1))
    if (both := material.roughness_metallic_texture) is not None:
        maps["roughness"], maps["metallic"] = both[..., :1], both[..., 1:]
    if material.normal_texture is not None:
        maps["normals"] = 0.5 * material.normal_texture + 0.5
    return [
        {"name": name, "picture": photo_uri(np.broadcast_to(small, (*small.shape[:2], 3)))}
        for name, values in maps.items()
        for small in [averaged(np.asarray(values, np.float32))[0]]
    ]


def fitted(path: Path, most_bytes: int) -> tuple[bytes | None, str]:
    """The bytes of a GLB, its textures averaged down as far as `most_bytes` needs (None: even 256 pixels a side are too many), and
    a line about what was changed. Raises InputError where it is no GLB."""
    size = path.stat().st_size
    if size <= most_bytes:
        return path.read_bytes(), ""
    document = Document(path)
    for side in TEXTURE_SIDES:
        content = with_smaller_textures(document, side)
        if len(content) <= most_bytes:
            return content, f"Its textures have at most {side} pixels a side here, as the file has {size / 1e6:.1f} MB."
    return None, f"mesh.glb has {size / 1e6:.1f} MB, too much for this page; splitnerf view shows it."


def with_smaller_textures(document: Document, side: int) -> bytes:
    """The bytes of a GLB, textures averaged to at most `side` pixels a side. Raises InputError where a part is damaged."""
    tree = copy.deepcopy(document.json)
    images = {image["bufferView"]: image for image in tree.get("images", []) if "bufferView" in image}
    binary = bytearray()
    for number, view in enumerate(tree.get("bufferViews", [])):
        content = bytes(document.view(number))
        if number in images and (smaller := smaller_image(content, side)):
            content, images[number]["mimeType"] = smaller, "image/png"
        view |= {"buffer": 0, "byteOffset": len(binary), "byteLength": len(content)}
        binary += content + bytes(-len(content) % 4)
    tree["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def smaller_image(content: bytes, side: int) -> bytes | None:
    """An encoded image as a PNG of at most `side` pixels a side, by averages of whole blocks; None where it is so already."""
    with Image.open(io.BytesIO(content)) as image:
        factor = math.ceil(max(image.size) / side)
        if factor == 1:
            return None
        file = io.BytesIO()
        image.reduce(factor).save(file, "PNG", optimize=True)
    return file.getvalue()


def comparison(left: str, right: str, kind: str) -> dict:
    """The page's data to compare two pictures, by their names."""
    return {"left": left, "right": right, "kind": kind, "largest": LARGEST_ERRORS[kind]}


def views_section(views: Sequence[Mapping], albedo_scale: Sequence[float] | None) -> dict:
    """The template's contents for the views of :func:`splitnerf_tools.report.write_report`; `albedo_scale` is the factor [3] of the
    predicted albedo under which it is scored, and shown here; None for 1."""
    maps = [
        key
        for key in MAPS
        if any(view[side].get(key) is not None for view in views for side in ("truth", "prediction"))
    ]
    return {
        "maps": [MAPS[key] for key in maps],
        "pairs": [
            comparison(f"truth {key}", key, KINDS.get(key, "number"))
            | {"name": MAPS[key]}
            | ({"sides": ["photo", "render"]} if key == "rgb" else {})
            for key in maps
        ],
        "sides": ["truth", "render"],
        "views": [
            _view(view, maps, np.ones(3) if albedo_scale is None else np.asarray(albedo_scale)) for view in views
        ],
        "scale": None if albedo_scale is None else ", ".join(f"{factor:.3g}" for factor in albedo_scale),
    }


def _view(view: Mapping, keys: Sequence[str], scale: np.ndarray) -> dict:
    truth = {key: value for key, value in view["truth"].items() if value is not None}
    prediction = {key: value for key, value in view["prediction"].items() if value is not None}
    score = None
    if "rgb" in truth and "rgb" in prediction:
        whites = [over_background(m["rgb"], m["alpha"]) if "alpha" in m else m["rgb"] for m in (prediction, truth)]
        score = f"{psnr(*whites):.2f} dB"
    if "albedo" in prediction:
        prediction["albedo"] = prediction["albedo"] * scale
    rows = [
        {
            "name": name,
            "cells": [_map_picture(maps, key) if key in maps else None for key in keys],
            "keys": [f"{prefix}{k}" for k in keys],
        }
        for name, prefix, maps in (("truth", "truth ", truth), ("render", "", prediction))
    ]
    return {"name": view["name"], "score": score, "rows": rows}


def _map_picture(maps: Mapping, key: str) -> Markup:
    """One map as a transparent PNG: linear colours encoded, normals mapped from [-1, 1] to [0, 1]."""
    values = np.asarray(maps[key], dtype=np.float32)
    values = np.nan_to_num(values[..., None] if values.ndim == 2 else values)
    alpha = np.asarray(maps.get("alpha", np.ones(values.shape[:2])), dtype=np.float32)
    if key == "normal" and "normal_mask" in maps:
        alpha = alpha * maps["normal_mask"]
    values, alpha = averaged(values, alpha)
    if key == "albedo":
        values = linear_to_srgb(np.clip(values, 0, 1))
    elif key == "normal":
        values = values * 0.5 + 0.5
    values = np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values
    return data_uri(np.concatenate([values, alpha[..., None]], axis=2))


def averaged(values: np.ndarray, alpha: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """A map [H, W, C] and its coverage [H, W] (None: 1), averaged down, by coverage, to at most 512 pixels a side."""
    alpha = np.ones(values.shape[:2], np.float32) if alpha is None else alpha
    factor = math.ceil(max(values.shape[:2]) / MOST_PIXELS)
    factor = min(factor, *values.shape[:2])
    if factor == 1:
        return values, alpha
    coverage = area_average(alpha, factor)
    return area_average(values * alpha[..., None], factor) / np.maximum(coverage, 1e-6)[..., None], coverage


def refinement_section(page: Mapping) -> dict:
    """The contents of the section for the template.

    Args:
        page: `views`, each with `name`, `pictures` (photo, before and after, [H, W, 3] sRGB on white), and `coverage` (mean squared
            errors before and after); `summary`, the scores' part of the refinement; `lights`, linear maps [h, w, 3], go to the lights.
    """
    views, summary, rows = page["views"], page["summary"], []
    scores = np.array([[psnr(view["pictures"][i], view["pictures"][0]) for i in (1, 2)] for view in views])
    for view, (before, after) in zip(views, scores):
        rows.append((f"{view['name']}: colours, PSNR on white", f"{before:.2f} dB", f"{after:.2f} dB"))
    rows.append(("these views: colours, mean PSNR", *(f"{value:.2f} dB" for value in scores.mean(0))))
    coverage = np.mean([view["coverage"] for view in views], axis=0)
    rows.append(("these views: coverage, mean squared error", *(f"{value:.2g}" for value in coverage)))
    if summary["outline_error"]:
        rows.append(
            ("all photos: coverage at the outline, mean squared error", *(f"{v:.2g}" for v in summary["outline_error"]))
        )
    name = "all photos: colours inside the outline, PSNR before the first and the last step"
    rows.append((name, *(f"{v:.2f} dB" for v in summary["photos_psnr"])))
    best = f"step {summary['delivered']} is delivered" if summary["delivered"] else "no step helped, none is delivered"
    best += "; a smeared lamp was made compact first" if summary["lamp"] else ""
    name = f"photos held out: colours inside the outline, PSNR at the start and as delivered; {best}"
    rows.append((name, *(f"{v:.2f} dB" for v in summary["held_out_psnr"])))
    return {
        "pictures": PICTURES,
        "pairs": [comparison(*pair, "colour") | {"name": " | ".join(pair), "sides": pair} for pair in PAIRS],
        "views": [
            {
                "name": view["name"],
                "score": "{:.2f} → {:.2f} dB".format(*score),
                "cells": [data_uri(averaged(p)[0]) for p in view["pictures"]],
            }
            for view, score in zip(views, scores)
        ],
        "rows": rows,
        "steps": summary["steps"],
        "seconds": f"{summary['seconds']:.0f}",
        "saturated": f"{100 * summary['saturated']:.1f} %",
        "evidence": evidence(summary["level"], summary["tint"]),
    }


def embedded_light(name: str, radiance: np.ndarray) -> dict:
    """A light [h, w, 3] for the page: a picture at its own exposure, and 256 x 128 texels as packed halves."""
    radiance = np.nan_to_num(np.asarray(radiance, np.float32))
    width, height, content = as_halves(small := resize_environment(radiance, ROWS, 2 * ROWS))
    white = white_of(radiance)
    return {
        "name": name,
        "white": white,
        "picture": tonemapped(small, white),
        "width": width,
        "height": height,
        "packed": packed(content),
    }


def panels_section(panels: Sequence[Mapping]) -> dict | None:
    """The light as trained, by roughness, all under one exposure; see :func:`splitnerf_tools.report.write_report`."""
    if not panels:
        return None
    white = white_of(min(panels, key=lambda panel: panel["roughness"])["g"])
    columns = [
        {
            "name": f"ρ = {panel['roughness']:g}",
            "g": tonemapped(panel["g"], white),
            "g_bar": None if panel.get("g_bar") is None else tonemapped(panel["g_bar"], white),
        }
        for panel in panels
    ]
    return {"columns": columns, "note": f"White is a radiance of {white:.3g}, {WHITE_PER_MEAN} times the mean."}
