"""The truth, written in the form of each published set, scores nearly perfectly by the set's protocol; and what is refused."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
import trimesh
from published_scenes import write_set
from splitnerf.cli import DONE, main

BEST = {  # layout: what the truth, path traced, must score at least, by key
    "stanford-orb": {"psnr_h": 25, "psnr_l": 32, "view_psnr_l": 32},
    "tensoir": {"psnr": 30, "albedo_psnr": 30, "view_psnr": 30},
    "nerfactor": {"psnr": 30, "albedo_psnr": 30, "view_psnr": 30},
    "shiny": {"view_psnr": 30},
}
ERRORS = {
    "stanford-orb": {"normals": 0.02, "chamfer": 0.5},
    "tensoir": {"normals": 3},
    "shiny": {"normals": 4},
    "nerfactor": {"normals": 3},
}


def complete(layout: str, scene) -> None:
    """Writes the truth that synth does not write, and gives views the numbers that the protocol takes."""
    root, mesh = scene.root, scene.renderer.asset
    if layout == "stanford-orb":
        truth = root.parents[1] / "ground_truth" / root.name
        for i, pose in enumerate(scene.test):
            normals = scene.render(scene.lights["studio"], pose)["normal"] @ pose[:3, :3]
            (truth / "surface_normal").mkdir(exist_ok=True, parents=True)
            np.save(truth / f"surface_normal/{i:04d}.npy", normals)
        (truth / "mesh_blender").mkdir()
        trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).export(truth / "mesh_blender/mesh.obj")
    if layout == "nerfactor":  # of its 200 test views two that count, and a validation view
        shutil.copytree(root / "test_000", root / "val_000")
        for old, new in ((0, 49), (1, 199)):
            (root / f"test_{old:03d}").rename(root / f"test_{new:03d}")


@pytest.mark.parametrize("layout", BEST)
def test_the_truth_scores_nearly_perfectly_by_the_protocol_of_its_set(layout, tmp_path, capsys):
    scene = write_set(tmp_path / "s", layout, relights=layout != "shiny")
    data = scene.root
    complete(layout, scene)
    asset = next(path for path in (tmp_path / "s").rglob("asset.glb"))
    options = ["--data", str(data), "--protocol", layout, "--env", str(data / "light.hdr"), "--spp", "96"]
    options += ["--out", str(tmp_path / "scores.json")]
    capsys.readouterr()
    assert main(["evaluate", str(asset), *options]) == DONE
    shown = capsys.readouterr().out
    scores = json.loads((tmp_path / "scores.json").read_text())["scores"]
    for key, least in BEST[layout].items():
        assert scores[key] > least, (key, scores)
    for key, most in ERRORS.get(layout, {}).items():
        assert scores[key] < most, (key, scores)
    assert ("DiffReg-PBIR" in shown) == (layout == "stanford-orb") and f"scores: {tmp_path / 'scores.json'}" in shown
