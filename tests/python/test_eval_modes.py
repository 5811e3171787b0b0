"""A run holds out what it was told to, says so, and its later commands read the data as it did."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh
from blender_data import edit, set_pose
from layout_scenes import COUNT, write_colmap, write_transforms
from splitnerf.cli import BAD_INPUT, DONE
from splitnerf.config import Config
from splitnerf.data.reading import Reading
from tiny_runs import command, train

STEPS = ("--steps", "2")
EAST = np.eye(4, k=3)  # a pose's step along x


def n_views(path) -> int:
    return json.loads(path.read_text())["views"]


@pytest.fixture(scope="module")
def run_on_all(tmp_path_factory):
    root = tmp_path_factory.mktemp("all")
    write_colmap(root / "data", binary=True)
    assert train(root / "data", root / "run", *STEPS, "--eval-mode", "all") == DONE
    return root


def test_a_run_on_all_views_is_evaluated_on_all(run_on_all):
    assert n_views(run_on_all / "run/evaluation.json") == COUNT
    assert Config.read(run_on_all / "run/config.toml").reading == Reading("all")


def test_what_is_held_out_is_said(tmp_path, capsys):
    data = write_transforms(tmp_path / "data")
    assert train(data, tmp_path / "run", *STEPS) == DONE
    said = f"{data}: 14 views to train on, 2 are held out for testing (every 8th; --eval-mode all trains on all)"
    assert capsys.readouterr().err.count(said) == 1
    assert n_views(tmp_path / "run/evaluation.json") == 2
    words = "--data", data, "--eval-mode", "all", "--out", tmp_path / "s.json"
    assert command("evaluate", tmp_path / "run", *words) == DONE
    said = "16 views to train on, no view is held out for testing (all are trained on and evaluated)"
    assert said in capsys.readouterr().err
    assert n_views(tmp_path / "s.json") == COUNT


def test_later_commands_read_the_data_as_the_run_did(run_on_all, tmp_path, capsys):
    run, data = run_on_all / "run", run_on_all / "data"
    assert command("evaluate", run, "--data", data, "--out", tmp_path / "run.json") == DONE
    asset = "evaluate", run / "mesh.glb", "--data", data, "--spp", 1
    assert command(*asset, "--out", tmp_path / "asset.json") == DONE
    assert command(*asset, "--out", tmp_path / "other.json", "--eval-mode", "fraction") == DONE
    assert [n_views(tmp_path / f"{name}.json") for name in ("run", "asset", "other")] == [COUNT, COUNT, 2]
    relit = "relight", run, "--env", run / "environment.hdr", "--data", data, "--spp", 1, "--size", 8, "--out"
    assert command(*relit, tmp_path / "relit") == command(*relit, tmp_path / "fewer", "--eval-mode", "fraction") == DONE
    assert [len(list((tmp_path / name).glob("*.png"))) for name in ("relit", "fewer")] == [COUNT, 2]


def test_a_run_is_not_resumed_on_other_views(run_on_all, capsys):
    run, data = run_on_all / "run", run_on_all / "data"
    assert train(data, run, "--steps", "3", "--resume", "--eval-mode", "fraction") == BAD_INPUT
    assert "was trained on other images" in capsys.readouterr().err
    assert train(data, run, "--steps", "3", "--resume") == DONE
    assert n_views(run / "evaluation.json") == COUNT


def test_a_run_far_from_the_origin_says_where_it_is(tmp_path, capsys):
    """Its meshes keep their details, and cameras of the data still fit them."""
    data = write_transforms(tmp_path / "data")
    for i in range(COUNT):
        edit(data, set_pose(i, lambda pose: (pose + 5e6 * EAST).tolist()), "transforms.json")
    run = tmp_path / "run"
    assert train(data, run, *STEPS) == DONE
    assert "the cameras are far from the origin; results are relative to 5000000 0 0" in capsys.readouterr().err
    stored = json.loads((run / "origin.json").read_text())
    assert stored["origin"] == [5e6, 0, 0] and stored["meaning"]
    vertices = np.asarray(trimesh.load_mesh(run / "mesh.ply").vertices)
    assert np.abs(vertices).max() < 2 and len(np.unique(vertices[:, 0])) > 20
    assert command("export", run, "--out", tmp_path / "asset", "--formats", "ply") == DONE
    assert json.loads((tmp_path / "asset/origin.json").read_text()) == stored
    scores = json.loads((run / "evaluation.json").read_text())["novel_view"]
    assert scores["psnr"] > 8
