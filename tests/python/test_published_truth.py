"""The truth, written in the form of each published set, scores nearly perfectly by the set's protocol; and what is refused."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
import trimesh
from published_scenes import write_set
from scipy.io import savemat

from splitnerf.cli import BAD_INPUT, DONE, main
from splitnerf.data.images import write_image

BEST = {  # layout: what the truth, path traced, must score at least, by key
    "stanford-orb": {"psnr_h": 25, "psnr_l": 32, "view_psnr_l": 32}, "owl": {"psnr_new": 30, "psnr_same": 30, "ssim": 0.9},
    "openillumination": {"psnr": 28}, "tensoir": {"psnr": 30, "albedo_psnr": 30, "view_psnr": 30}, "dtc": {"view_psnr": 30},
    "nerfactor": {"psnr": 30, "albedo_psnr": 30, "view_psnr": 30}, "shiny": {"view_psnr": 30}, "glossy": {}, "neus": {},
}  # fmt: skip
ERRORS = {
    "stanford-orb": {"normals": 0.02, "chamfer": 0.5}, "tensoir": {"normals": 3}, "shiny": {"normals": 4},
    "glossy": {"chamfer": 0.03}, "nerfactor": {"normals": 3}, "dtc": {"chamfer": 0.01}, "neus": {"chamfer": 0.25},
}  # fmt: skip


def arguments_of(layout: str, scene, tmp_path) -> list[str]:
    """The options of the set's command; writes the truth that synth does not write."""
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
    if layout == "dtc":
        return ["--truth", str(root.parent / "models")]
    if layout == "neus":
        for name in ("Points/stl", "ObsMask"):
            (tmp_path / name).mkdir(parents=True)
        dense = trimesh.sample.sample_surface(trimesh.Trimesh(mesh.vertices, mesh.triangles), 20_000, seed=3)[0]
        trimesh.PointCloud(dense).export(tmp_path / "Points/stl/stl007_total.ply")
        volume = {"BB": np.array([[-2.0] * 3, [2.0] * 3]), "Res": 0.5, "ObsMask": np.ones((9, 9, 9), np.uint8)}
        savemat(tmp_path / "ObsMask/ObsMask7_10.mat", volume)
        savemat(tmp_path / "ObsMask/Plane7.mat", {"P": np.array([[0.0], [0], [1], [5]])})
        return ["--truth", str(tmp_path)]
    return []


@pytest.mark.parametrize("layout", BEST)
def test_the_truth_scores_nearly_perfectly_by_the_protocol_of_its_set(layout, tmp_path, capsys):
    relights = layout in ("stanford-orb", "owl", "openillumination", "nerfactor", "tensoir")
    scene = write_set(tmp_path / "s", layout, relights)
    data, name = scene.root, "dtu" if layout == "neus" else layout
    if layout == "neus":
        data = data.rename(data.with_name("scan7"))
        scene.root = data
    asset = next(path for path in (tmp_path / "s").rglob("asset.glb"))
    options = ["--data", str(data), "--protocol", name, "--env", str(data / "light.hdr"), "--spp", "96"]
    options += ["--out", str(tmp_path / "scores.json"), *arguments_of(layout, scene, tmp_path / "truth")]
    capsys.readouterr()
    assert main(["evaluate", str(asset), *options]) == DONE
    shown = capsys.readouterr().out
    scores = json.loads((tmp_path / "scores.json").read_text())["scores"]
    for key, least in BEST[layout].items():
        assert scores[key] > least, (key, scores)
    for key, most in ERRORS.get(layout, {}).items():
        assert scores[key] < most, (key, scores)
    assert ("DiffReg-PBIR" in shown) == (layout == "stanford-orb") and f"scores: {tmp_path / 'scores.json'}" in shown


@pytest.mark.parametrize(("options", "message"), [
    (["--protocol", "owl"], "--protocol needs --data"),
    (["--protocol", "owl", "--data", "D"], "does not look like owl's data"),
    (["--protocol", "shiny", "--data", "D", "--lights", "low"], "--lights does not go with --protocol"),
    (["--protocol", "owl", "--data", "D", "--views", "3"], "--views does not go with --protocol owl"),
    (["--protocol", "owl", "--data", "D", "--downscale", "2"], "--downscale does not go with --protocol"),
    (["--data", "D", "--truth", "D"], "--truth needs --protocol"),
])  # fmt: skip
def test_options_that_do_not_fit(options, message, tmp_path, capsys):
    (tmp_path / "a.glb").write_bytes(b"glTF")
    options = [str(tmp_path) if option == "D" else option for option in options]
    assert main(["evaluate", str(tmp_path / "a.glb"), *options]) == BAD_INPUT
    assert message in capsys.readouterr().err


def test_another_file_is_not_replaced_by_scores(tmp_path, capsys):
    write_image(tmp_path / "a.png", np.zeros((2, 2)))
    options = ["--protocol", "owl", "--data", str(tmp_path), "--out", str(tmp_path / "a.png")]
    assert main(["evaluate", str(tmp_path / "a.glb"), *options]) == BAD_INPUT
    assert "is no earlier result" in capsys.readouterr().err
