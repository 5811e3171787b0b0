"""How well uncertainty.exr tells the errors: deciles of the predicted deviation, and the true error in each.

    python tests/bench/calibration.py RUN SCENE

RUN is a run's folder with mesh.glb and uncertainty.exr; SCENE a dataset with the truth as asset.glb. Truth is taken at the
nearest points of its surface. Both are averaged over the map's patches, two pixels wide: photos say nothing of finer parts.
The albedo has one factor per channel (median of the ratios), as light and albedo share one.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr
from swap import Canvas

from splitnerf.data.dataset import load_dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import read_image
from splitnerf.refinement.texels import AssetTexels
from splitnerf.refinement.uncertainty import Information, patch_width
from splitnerf.refinement.unknowns import GAMMA

N_PARTS = 10


def true_errors(own: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """[k] absolute errors: albedo^(1/2.2) (root mean square of the channels), roughness, metallic, the normal's angle."""
    factor = np.median(truth["albedo"] / np.maximum(own["albedo"], 1e-3), axis=0)
    albedo = (np.clip(own["albedo"] * factor, 0, 1) ** (1 / GAMMA) - np.clip(truth["albedo"], 0, 1) ** (1 / GAMMA)) ** 2
    normals = [x["normals"] / np.maximum(np.linalg.norm(x["normals"], axis=1, keepdims=True), 1e-9) for x in (own, truth)]
    return {
        "albedo": np.sqrt(albedo.mean(1)), "roughness": np.abs(own["roughness"] - truth["roughness"])[:, 0],
        "metallic": np.abs(own["metallic"] - truth["metallic"])[:, 0],
        "normals": np.arccos(np.clip((normals[0] * normals[1]).sum(1), -1, 1)),
    }  # fmt: skip


def means(values: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """[patches, c] means of values [k, c] over patches [k]."""
    sums = np.stack([np.bincount(patch, column) for column in values.T.astype(np.float64)], axis=1)
    return sums / np.bincount(patch)[:, None]


def root_mean_squares(values: np.ndarray, parts: list[np.ndarray]) -> str:
    """The root mean square of values [k] in each part, as cells of a table; a part is an array of numbers of values."""
    return " | ".join(f"{np.sqrt(np.square(values[part]).mean()):.3f}" for part in parts)


def rows_of(name: str, predicted: np.ndarray, error: np.ndarray) -> list[str]:
    """Two rows of the table: prediction and error in each part of the patches, which are sorted by prediction."""
    parts = np.array_split(np.argsort(predicted, kind="stable"), N_PARTS)
    return [
        f"| {name}, predicted | {root_mean_squares(predicted, parts)} | |",
        f"| {name}, true | {root_mean_squares(error, parts)} | {spearmanr(predicted, error).statistic:.2f} |",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("scene", type=Path)
    args = parser.parse_args()
    asset = read_asset(args.run / "mesh.glb")
    texels = AssetTexels(asset)
    patch = Information(texels, patch_width(load_dataset(args.scene, "train", 1), texels), 0).patch_of.numpy()
    canvas = Canvas(asset, read_asset(args.scene / "asset.glb"), texels.size)
    own, truth = ({part: means(found[part], patch) for part in found} for found in (canvas.own, canvas.others))
    predicted = means(read_image(args.run / "uncertainty.exr").reshape(-1, 4)[texels.index], patch)
    print(f"| | {' | '.join(f'{i + 1}' for i in range(N_PARTS))} | rank correlation |")
    print("|---" * (N_PARTS + 2) + "|")
    for i, (name, error) in enumerate(true_errors(own, truth).items()):
        print(*rows_of(name, predicted[:, i], error), sep="\n")


if __name__ == "__main__":
    main()
