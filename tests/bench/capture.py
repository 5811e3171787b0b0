"""Data that `splitnerf prepare` would make if a part of the truth were known, to find what limits an asset from
photographs.

    python tests/bench/capture.py CAPTURE DATA OUT {cameras,masks,exposures,all}

CAPTURE holds photos/ and truth/ (cameras.json, masks/); DATA is the output of `splitnerf prepare CAPTURE/photos`, whose
features and matches are used again. OUT gets data in which the named part is the truth; the later steps are those of
prepare.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from splitnerf_tools.capture.photographs import find_photographs
from splitnerf_tools.capture.photometry import Exposures
from splitnerf_tools.capture.poses import Lens, Reconstruction, reconstruct
from splitnerf_tools.capture.prepare import PrepareSettings, exposures_of, write_data
from splitnerf_tools.capture.world import settle

PARTS = ("cameras", "masks", "exposures")


def true_lens(truth: dict) -> Lens:
    """The lens of cameras.json."""
    return Lens(*(truth[key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2")))


def similarity(of: np.ndarray, to: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """s, R, t for which s R x + t carries points [n, 3] nearest to others. Source: Umeyama 1991."""
    centred, target = of - of.mean(0), to - to.mean(0)
    u, d, v = np.linalg.svd(target.T @ centred)
    signs = np.array([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(v))])
    rotation = (u * signs) @ v
    scale = (d * signs).sum() / (centred**2).sum()
    return scale, rotation, to.mean(0) - scale * rotation @ of.mean(0)


def with_true_cameras(found: Reconstruction, truth: dict, poses: dict[str, np.ndarray]) -> Reconstruction:
    """A reconstruction with the true cameras, in their frame; its sparse points are carried along."""
    true = np.stack([poses[name] for name in found.names])
    scale, rotation, shift = similarity(found.poses[:, :3, 3], true[:, :3, 3])
    points = scale * found.points @ rotation.T + shift
    return replace(found, poses=true, lenses=[true_lens(truth)] * len(true), points=points)


def true_exposures(names: list[str], truth: dict, exposures: dict[str, float]) -> Exposures:
    """The true exposures and vignetting."""
    gains = np.array([exposures[name] for name in names])
    vignetting = (truth["vignette"]["a"], truth["vignette"]["b"])
    return Exposures(gains / np.exp(np.log(gains).mean()), vignetting, 0.0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("part", choices=(*PARTS, "all"))
    args = parser.parse_args()
    true = PARTS if args.part == "all" else (args.part,)
    truth = json.loads((args.capture / "truth" / "cameras.json").read_text())
    frames = {Path(frame["file_path"]).stem: frame for frame in truth["frames"]}
    photos = find_photographs(args.capture / "photos")
    found = reconstruct(photos, args.data / "work" / "photos", args.data / "work", 0, lambda step, share: None)
    if "cameras" in true:
        found = with_true_cameras(found, truth, {name: np.array(f["transform_matrix"]) for name, f in frames.items()})
    world, by_name = settle(found, 0), {photo.name: photo for photo in photos}
    exposures = exposures_of(world.scene, by_name, lambda step, share: None)
    if "exposures" in true:
        exposures = true_exposures(found.names, truth, {name: frame["exposure"] for name, frame in frames.items()})
    settings = PrepareSettings(masks=args.capture / "truth" / "masks" if "masks" in true else None)
    args.out.mkdir(parents=True)
    shares = write_data(world, exposures, by_name, args.out, settings, lambda step, share: None)
    print(f"{args.out}: {len(found.names)} photos, true {', '.join(true)}; masks cover {shares.mean():.1%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
