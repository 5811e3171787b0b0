"""Scores a run or an asset's file by the protocol of a published set."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from splitnerf.data.environment import read_environment
from splitnerf.data.frames import layout_of, read_frames
from splitnerf.data.gltf import read_asset
from splitnerf.data.json_files import read_json
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.evaluate.asset import environment_beside
from splitnerf.evaluate.lpips import find_distance
from splitnerf.evaluate.published.common import Delivered, Options
from splitnerf.evaluate.published.values import PROTOCOLS, published
from splitnerf.evaluate.scoring import is_asset


def score_published(target: Path, data: Path, name: str, options: Options, env: Path | None = None) -> dict:
    """Path-traces what a run delivers, its mesh.glb, or a GLB file, and scores it.

    Args:
        target: The run or the file, in the data's world frame.
        data: The folder that was trained on.
        name: One of :data:`splitnerf.evaluate.published.values.PROTOCOLS`.
        options: Paths a pixel, and the folders of lights and truth.
        env: The light of the photos for novel views; None for the environment.exr or .hdr in its folder.

    Returns:
        `protocol`, `scores` by key, `images` with those of each, `notes`, `published` and `spp`.

    Raises:
        InputError: A file cannot be used, or the data are not of the protocol's set.
    """
    protocol = PROTOCOLS[name]
    if layout_of(data) is not protocol.LAYOUT:
        where = protocol.LAYOUT.__name__.rsplit(".", 1)[1]
        raise InputError(f"{data}: does not look like {name}'s data (see {where} in docs/data.md); give their folder")
    path = target if is_asset(target) else target / "mesh.glb"
    if not path.is_file():
        raise InputError(f"{path}: no such asset; train the run to its end, or export it")
    env = environment_beside(path) if env is None else env
    _, origin = read_frames(data, "train", Reading("all"))
    delivered = Delivered(read_asset(path), None if env is None else read_environment(env), origin, options.spp)
    missing = ""
    if any("lpips" in key for key, _, _ in protocol.COLUMNS):
        distance, missing = find_distance()
        options = replace(options, distance=distance)
    scores = protocol.score(delivered, data, options)
    if missing:
        scores.notes.append(f"LPIPS was not computed: {missing}")
    return {
        "protocol": name,
        "scores": scores.means,
        "images": scores.images,
        "notes": scores.notes,
        "published": published(name),
        "spp": options.spp,
    }


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
