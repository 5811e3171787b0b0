"""Hollow stays hollow: what training makes of cavities that no outline shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from splitnerf.cli import DONE, main
from splitnerf.config import preset
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import write_image
from splitnerf.evaluate.scoring import read_evaluation
from splitnerf.training.loop import train
from splitnerf_tools.demo.scene import build_environment


def photographed(folder: Path, shape: str, *options: str) -> Path:
    """A data set of a built-in shape under the demo's light."""
    light, data = folder / "light.exr", folder / "data"
    write_image(light, build_environment())
    assert main(["synth", "--shape", shape, "--light", str(light), "--out", str(data), *options]) == DONE
    return data


def first_surface(mesh: trimesh.Trimesh) -> float:
    """The height of the first surface that a ray down the middle meets."""
    low, high = mesh.bounds
    above = [*(0.5 * (low + high) + 1e-3)[:2], high[2] + 1]
    return mesh.ray.intersects_location([above], [[0.0, 0.0, -1.0]])[0][:, 2].max()


def test_the_floor_of_a_bowl_stands_where_it_is(tmp_path):
    """At 60 pixels, after 250 steps: within a tenth of the depth. A run that starts from a sphere has a lid there."""
    data = photographed(tmp_path, "bowl", "--size", "60", "--train", "40", "--test", "1", "--spp", "16")
    photos = load_dataset(data, "train")
    config = preset("cpu").replace({"run.steps": 250, "run.preview_every": 1.0})
    (run := tmp_path / "run").mkdir()
    trained = train(photos, config, run)
    truth = trimesh.load(data / "mesh.ply", force="mesh").apply_transform(np.asarray(photos.box_from_world))
    floor, rim = first_surface(truth), truth.bounds[1, 2]
    heights = torch.linspace(1.4, -1.4, 1401)
    middle = truth.bounds.mean(0) + 1e-3
    points = torch.stack([torch.full_like(heights, middle[0]), torch.full_like(heights, middle[1]), heights], 1)
    with torch.no_grad():
        inside = trained.model.sdf_field.sdf(points) < 0
    assert abs(float(heights[inside][0]) - floor) < 0.1 * (rim - floor)


@pytest.mark.slow
@pytest.mark.parametrize("shape, material", [("bowl", "matte"), ("mask", "glossy"), ("plinth", "matte")])
def test_two_minutes_make_a_hollow_shape(shape, material, tmp_path):
    images = ("--size", "120", "--train", "60", "--test", "2", "--spp", "32")
    data = photographed(tmp_path, shape, "--material", material, *images)
    assert main(["train", str(data), "--out", str(tmp_path / "run"), "--set", "run.steps=2500", "--no-refine"]) == DONE
    assert read_evaluation(tmp_path / "run")["f_score"] > 0.9
