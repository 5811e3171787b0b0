"""Scores a run or an asset's file by the protocol of a published set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

from splitnerf.data.asset import check_place
from splitnerf.data.environment import read_environment
from splitnerf.data.frames import layout_of, read_frames
from splitnerf.data.gltf import read_asset
from splitnerf.data.json_files import read_json
from splitnerf.data.layouts import transforms, view_folders
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.evaluate.lpips import find_distance
from splitnerf.evaluate.published import views
from splitnerf.evaluate.published.common import Delivered, Options, Scores
from splitnerf.evaluate.scoring import environment_beside, is_asset

Column = tuple[str, str, str]  # key, title, format


class Protocol(NamedTuple):
    """The rules of a published set.

    Attributes:
        layout: The layout that its data have, a module of :mod:`splitnerf.data.layouts`.
        columns: The columns of its table, the headline first.
        score: Path-traces an asset and compares it with the data in a folder. Raises InputError with one line where these do
            not hold what the protocol needs.
    """

    layout: ModuleType
    columns: tuple[Column, ...]
    score: Callable[[Delivered, Path, Options], Scores]


def _similarity(prefix: str, title: str) -> tuple[Column, ...]:
    forms = ("psnr", "{:.2f}"), ("ssim", "{:.3f}"), ("lpips", "{:.3f}")
    return tuple((f"{prefix}{key}", f"{title}, {key.upper()}", form) for key, form in forms)


RELIT, ALBEDO, NOVEL = _similarity("", "relit"), _similarity("albedo_", "albedo"), _similarity("view_", "novel")
NORMALS: Column = ("normals", "normals, degrees", "{:.2f}")
PROTOCOLS = {
    "nerfactor": Protocol(view_folders, (*RELIT, *ALBEDO, NOVEL[0], NORMALS), views.nerfactor),
    "shiny": Protocol(transforms, (*NOVEL, NORMALS), views.shiny),
}
# What the SplitNeRF paper (Zarzar and Ghanem) reports by its own choice of views, that of `--lights low`.
PUBLISHED = (
    {"method": "SplitNeRF, mip-map light", "psnr": 27.81, "ssim": 0.944, "lpips": 0.058},
    {"method": "SplitNeRF", "psnr": 27.31, "ssim": 0.941, "lpips": 0.061}
    | {"albedo_psnr": 25.29, "albedo_ssim": 0.924, "albedo_lpips": 0.108},
)
SOURCE = (
    "published: the SplitNeRF paper, collected by this project in November 2026; mean of the four scenes, 20 test views under 8 "
    "low-frequency probes, one factor per channel on the images"
)


def score_published(target: Path, data: Path, name: str, options: Options, env: Path | None = None) -> dict:
    """Path-traces what a run delivers, its mesh.glb, or a GLB file, in the data's world frame, and scores it by one of
    :data:`PROTOCOLS`. `env` is the light of the photos; None for the environment.exr or .hdr in the file's folder.

    Returns:
        `protocol`, `scores` by key (None where the data hold no truth), `images` with those of each, `notes` and `spp`.

    Raises:
        InputError: A file cannot be used, or the data are not of the protocol's set.
    """
    protocol = PROTOCOLS[name]
    if layout_of(data) is not protocol.layout:
        where = protocol.layout.__name__.rsplit(".", 1)[1]
        raise InputError(f"{data}: does not look like {name}'s data (see {where} in docs/data.md); give their folder")
    path = target if is_asset(target) else target / "mesh.glb"
    if not path.is_file():
        raise InputError(f"{path}: no such asset; train the run to its end, or export it")
    env = environment_beside(path) if env is None else env
    _, origin = read_frames(data, "train", Reading("all"))
    check_place(path.parent, origin)
    delivered = Delivered(read_asset(path), None if env is None else read_environment(env), origin, options.spp)
    distance, missing = find_distance()
    scores = protocol.score(delivered, data, replace(options, distance=distance))
    return {
        "protocol": name,
        "scores": {key: _mean(scores.images, key) for key, _, _ in protocol.columns},
        "images": scores.images,
        "notes": scores.notes + ([f"LPIPS was not computed: {missing}"] if missing else []),
        "spp": options.spp,
    }


def table_of_lights(evaluation: dict, label: str) -> str:
    """The scores of an evaluation with `--lights low` above those that were published so, and where they are from."""
    parts = ("", evaluation["relight"]), ("albedo_", evaluation["albedo"] or {})
    ours = {f"{prefix}{key}": scores.get(key) for prefix, scores in parts for key in ("psnr", "ssim", "lpips")}
    return f"{table((*RELIT, *ALBEDO), {'method': label} | ours, *PUBLISHED)}\n{SOURCE}"


def table(columns: Sequence[Column], *rows: dict) -> str:
    """Scores as lines of text, each with its `method`, without empty columns."""
    columns = [column for column in columns if any(row.get(column[0]) is not None for row in rows)]
    cells = [["", *(title for _, title, _ in columns)]]
    for row in rows:
        values = (row.get(key) for key, _, _ in columns)
        cells.append([row["method"], *("-" if x is None else f.format(x) for x, (_, _, f) in zip(values, columns))])
    widths = [max(len(line[i]) for line in cells) for i in range(len(cells[0]))]
    padded = [[cell.rjust(width) for cell, width in zip(line, widths)] for line in cells]
    return "\n".join("  ".join([line[0].ljust(widths[0]), *rest[1:]]).rstrip() for line, rest in zip(cells, padded))


def holds_published(path: Path) -> bool:
    """Whether a file holds scores by a protocol."""
    try:
        content = read_json(path, "protocol")
    except InputError:
        return False
    return content.get("protocol") in PROTOCOLS and isinstance(content.get("scores"), dict)


def published_path(target: Path, name: str) -> Path:
    """The file of a protocol's scores: in the run's folder, or next to the asset's file."""
    return target.with_name(f"{target.stem}_{name}.json") if is_asset(target) else target / f"{name}.json"


def _mean(images: list[dict], key: str) -> float | None:
    values = [image[key] for image in images if image.get(key) is not None]
    return float(np.mean(values)) if values else None
