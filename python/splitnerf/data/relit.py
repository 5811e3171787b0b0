"""Test views under other lights: which maps the data hold truth for, and the images, read one at a time.

The truth of map M is `r_N_relit_M.png` beside `r_N.png`, or `rgba_M.png` in a view folder: sRGB, straight alpha. The
map itself is `relight_M.hdr` (or .exr) in the data's folder, or M or relight_M with either suffix in a folder of maps.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.dataset import Dataset
from splitnerf.data.images import HDR_SUFFIXES
from splitnerf.data.layouts import view_folders
from splitnerf.data.pixels import averaged_codes, decoded
from splitnerf.data.truth import read_map
from splitnerf.errors import InputError

PREFIX = "relight_"
PROTOCOLS = {"low": (8, 20), "high": (7, 20)}
"""Maps and test views of the published protocols: low-frequency probes (NeRFactor's), and high-frequency maps."""


def relit_path(image_path: Path, name: str) -> Path:
    """Where the view of `image_path` under map `name` lies."""
    stem = image_path.stem if image_path.name == view_folders.PHOTO else f"{image_path.stem}_relit"
    return image_path.with_name(f"{stem}_{name}.png")


def read_relit(dataset: Dataset, index: int, name: str) -> np.ndarray:
    """Reads one view under another light.

    Args:
        dataset: The split.
        index: The view.
        name: The map.

    Returns:
        [H, W, 4] float32, sRGB in [0, 1], straight alpha, at the dataset's downscale.

    Raises:
        InputError: The image is missing, unreadable, has no alpha or another size than the view's.
    """
    path = relit_path(dataset.image_paths[index], name)
    pixels = read_map(dataset, index, path, 4)
    if pixels is None:
        raise InputError(f"{path}: no such image, the truth of {dataset.frame_names[index]} under {name}; add it")
    return dataset.padded(decoded(averaged_codes(pixels[..., :4], dataset.downscale)))


def map_files(folder: Path, *, prefixed: bool = False) -> dict[str, Path]:
    """The environment maps of a folder by name.

    Args:
        folder: Holds .hdr and .exr files; of two with the same name the .exr counts.
        prefixed: Whether only files that start with `relight_` count, as in a dataset's folder.

    Returns:
        Paths by name, the prefix `relight_` and the suffix taken away, sorted.
    """
    found = {}
    for path in sorted(folder.iterdir(), key=lambda path: (path.suffix.lower() != ".exr", path.name), reverse=True):
        if path.suffix.lower() in HDR_SUFFIXES and (path.name.startswith(PREFIX) or not prefixed):
            found[path.stem.removeprefix(PREFIX)] = path
    return dict(sorted(found.items()))


def relight_maps(dataset: Dataset, folder: Path | None = None, protocol: str | None = None) -> dict[str, Path]:
    """The maps to relight with.

    Args:
        dataset: The test split.
        folder: A folder of maps; None for those in the dataset's folder.
        protocol: "low" or "high" demands the number of maps and views in `PROTOCOLS` and truth for each of them; with
            None the maps count that have truth images.

    Returns:
        Files by name; empty where the data hold no truth of the kind.

    Raises:
        InputError: The folder is missing, none of its maps has truth, or it does not fit the protocol.
    """
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give --maps a folder of .hdr or .exr maps")
    files = map_files(dataset.root, prefixed=True) if folder is None else map_files(folder)
    if protocol is not None:
        n_maps, n_views = PROTOCOLS[protocol]
        if len(files) != n_maps:
            found = f"{folder or dataset.root}: holds {len(files)} maps"
            raise InputError(f"{found}, --lights {protocol} needs {n_maps}; give another --maps")
        if len(dataset) < n_views:
            found = f"{dataset.root}: has {len(dataset)} test views"
            raise InputError(f"{found}, --lights {protocol} needs {n_views}; leave --lights out")
        return files
    kept = {n: f for n, f in files.items() if any(relit_path(image, n).is_file() for image in dataset.image_paths)}
    if folder is not None and not kept:
        example = relit_path(dataset.image_paths[0], next(iter(files), "NAME"))
        raise InputError(f"{folder}: no map has truth images such as {example.name} in {dataset.root}; check the names")
    return kept
