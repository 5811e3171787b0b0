"""Scenes drawn at random, with what goes wrong in photographs: each ends in an asset or in one clear line."""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from splitnerf.cli import main
from splitnerf.data.asset import Asset, Material
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import read_image, read_radiance, write_image
from splitnerf.export.writers import write_glb
from splitnerf_tools.synth.rendering import SynthSettings, synthesise
from splitnerf_tools.synth.shapes import MATERIALS, SHAPES, shape_asset
from splitnerf_tools.synth.writer import LAYOUTS
from tiny_runs import SMALL, as_options, lines_of

PARTS = {
    "ball": lambda draw: trimesh.creation.icosphere(2, draw.uniform(0.01, 1)),
    "box": lambda draw: trimesh.creation.box(draw.uniform(0.002, 2, 3)),
    "needle": lambda draw: trimesh.creation.cylinder(draw.uniform(0.001, 0.05), draw.uniform(0.1, 2)),
    "ring": lambda draw: trimesh.creation.torus(draw.uniform(0.3, 1), draw.uniform(0.01, 0.25)),
    "sheet": lambda draw: trimesh.Trimesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0.3], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]]),
}
LIGHTS = {
    "even": lambda draw, rows: np.ones((rows, 2 * rows, 3)),
    "dark": lambda draw, rows: np.full((rows, 2 * rows, 3), 1e-7),
    "noise": lambda draw, rows: draw.random((rows, 2 * rows, 3)) ** 8,
    "colour": lambda draw, rows: np.ones((rows, 2 * rows, 3)) * draw.random(3) ** 3,
    "lamp": lambda draw, rows: (
        0.01
        + 1e4 * (np.arange(2 * rows * rows) == draw.integers(2 * rows * rows)).reshape(rows, 2 * rows, 1) * np.ones(3)
    ),
}
FAULTS = ["none"] * 10 + "black photo, white photos, no masks, swapped cameras, one place, far away, tiny".split(", ")


@dataclass
class Drawn:
    """A scene: what its seed says, and its data."""

    words: str
    data: Path


def random_scene(seed: int, folder: Path) -> Drawn:
    """Draws a shape, materials, a light, sizes, the number of views and a fault, and renders the data."""
    draw = np.random.default_rng(seed)
    pick = lambda choices: list(choices)[draw.integers(len(choices))]
    light, fault, built_in = pick(LIGHTS), FAULTS[seed % len(FAULTS)], draw.random() < 0.3
    size, train = (int(np.exp(draw.uniform(np.log(a), np.log(b)))) for a, b in ((4, 120), (1.8, 60)))
    test, spp, layout = int(draw.integers(1, 4)), int(pick((1, 4, 16))), pick(("blender", "blender", *LAYOUTS))
    layout = layout if fault == "none" else "blender"
    settings = SynthSettings(size=size, train=train, test=test, spp=spp, layout=layout, seed=seed)
    if built_in:
        parts = [pick(SHAPES)]
        asset = shape_asset(parts[0], pick(MATERIALS), 48)
    else:
        parts = [pick(PARTS) for _ in range(draw.integers(1, 5))]
        meshes = [PARTS[part](draw).apply_translation(draw.uniform(-0.5, 0.5, 3)) for part in parts]
        mesh = trimesh.util.concatenate(meshes)
        colour = tuple(pick((0.0, 0.5, 1.0)) * draw.random(3))
        look = Material("any", colour, pick((0.0, 0.1, 0.6, 1.0)), pick((0.0, 0.5, 1.0)))
        vertices, faces = np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32)
        normals = np.asarray(mesh.vertex_normals, np.float32)
        asset = Asset("drawn", vertices, faces, normals, np.zeros(len(faces), np.int32), [look])
    write_glb(folder / "asset.glb", asset)
    strength = 10.0 ** draw.uniform(-3, 2)
    write_image(folder / "light.exr", (strength * LIGHTS[light](draw, int(pick((2, 16, 64))))).astype(np.float32))
    data = synthesise(folder / "asset.glb", folder / "light.exr", [], folder / "data", settings)
    spoil(data, fault)
    return Drawn(f"{seed}: {parts}, light {light} times {strength:.2g}, {settings}, fault {fault}", data)


def spoil(data: Path, fault: str) -> None:
    """What the fault's name says, in data of the layout that lends itself to it."""
    photos, path = sorted(data.glob("train/*.png")), data / "transforms_train.json"
    if fault == "none" or not photos:
        return
    content = json.loads(path.read_text())
    poses = [frame["transform_matrix"] for frame in content["frames"]]
    if fault in ("black photo", "white photos", "no masks"):
        for photo in photos[:1] if fault == "black photo" else photos:
            pixels = read_image(photo)
            if fault == "no masks":
                pixels = pixels[..., :3]
            else:
                pixels[..., :3] = fault == "white photos"
            write_image(photo, pixels)
    elif fault == "swapped cameras":
        poses[0], poses[-1] = poses[-1], poses[0]
    elif fault == "one place":
        poses = poses[:1] * len(poses)
    else:
        scale, shift = (1.0, 1e6) if fault == "far away" else (1e-6, 0.0)
        for pose in poses:
            for row in pose[:3]:
                row[3] = scale * row[3] + shift
    for frame, pose in zip(content["frames"], poses):
        frame["transform_matrix"] = pose
    path.write_text(json.dumps(content))


def words_of(scene: Drawn, run: Path, *options: str) -> list[str]:
    return ["train", str(scene.data), "--out", str(run), *options]


def ends_well(scene: Drawn, run: Path, ended: SimpleNamespace) -> str:
    """Checks what a training left, by its exit code and its stderr; returns the line where there is no asset."""
    said = [line for line in ended.stderr.splitlines() if line.startswith("splitnerf: ") and ": note: " not in line]
    assert ended.returncode in (0, 1, 2), (scene.words, ended)
    if ended.returncode:
        assert len(said) == 1 and "unexpected" not in said[0] and "Traceback" not in ended.stderr, (scene.words, ended)
        return said[0]
    assert not said, (scene.words, said)
    asset, light = read_asset(run / "mesh.glb"), read_radiance(run / "environment.exr")
    assert all(np.isfinite(x).all() for x in (asset.vertices, asset.normals, light)), scene.words
    forbidden = lambda word: pytest.fail(f"{scene.words}: {word} in evaluation.json")
    json.loads((run / "evaluation.json").read_text(), parse_constant=forbidden)
    assert all(np.isfinite(line["loss"]) for line in lines_of(run)), scene.words
    return ""


@pytest.mark.parametrize("seed", [14, 20])
def test_a_random_scene_ends_well_in_a_few_steps(tmp_path, capsys, seed):
    """A refusal and an asset."""
    scene, run = random_scene(seed, tmp_path), tmp_path / "run"
    code = main(words_of(scene, run, "--steps", "8", *as_options(SMALL)))
    said = ends_well(scene, run, SimpleNamespace(returncode=code, stderr=capsys.readouterr().err))
    assert ("at one place" in said) == (seed == 14)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100))
def test_a_random_scene_ends_well_in_twenty_seconds(tmp_path, seed):
    """An asset without NaN, or one line that says why there is none; no signal."""
    scene, run = random_scene(seed, tmp_path), tmp_path / "run"
    words = [sys.executable, "-m", "splitnerf", *words_of(scene, run, "--max-minutes", "0.333")]
    print(ends_well(scene, run, subprocess.run(words, capture_output=True, text=True, timeout=300)))
