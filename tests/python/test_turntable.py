"""Photos whose light is turned in each: what is read of it, the light that points and photos get, and what a run makes of it."""

import json
import shutil
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
import torch
from blender_data import edit, look_at, make_blender
from painted_ball import lamps, photos
from PIL import Image
from scipy.spatial.transform import Rotation
from splitnerf.cli import DONE, main
from splitnerf.data.dataset import dataset_fingerprint, load_dataset
from splitnerf.data.environment import sample_environment, turn_environment
from splitnerf.data.images import read_image, write_image
from splitnerf.errors import InputError
from splitnerf.export.writers import write_glb
from splitnerf.fields import LightPyramid, SkyCells
from splitnerf.fields.light import mean_over
from splitnerf.pipeline import load_run
from splitnerf.refinement.fit import FitSettings, Refinement, groups_of
from splitnerf.render.renderer import render_view
from splitnerf_tools.capture.turntable import light_turns, moving_pixels, reduced, write_moving
from splitnerf_tools.synth.rendering import turn_to
from test_views import LENS, POSE, SIZE, ball
from tiny_runs import SMALL, as_options, refused


def about_z(*degrees: float) -> np.ndarray:
    """[n, 3, 3] float32 rotations."""
    return Rotation.from_euler("z", np.reshape(degrees, (-1, 1)), degrees=True).as_matrix().astype(np.float32)


def test_the_light_turns_as_the_camera_seems_to():
    """Each camera stands, in the light's frame, at one azimuth: level ones, one that looks down, one that is rolled."""
    heights = np.radians([0, 30, 60, 90, 45])
    azimuths = np.radians([0, 100, 200, 300, -40])
    back = np.stack([np.cos(azimuths) * np.cos(heights), np.sin(azimuths) * np.cos(heights), np.sin(heights)], axis=1)
    poses = np.stack([look_at(3 * b, np.zeros(3)) for b in back])
    away = [np.cos(azimuths[3]), np.sin(azimuths[3]), 0]  # what the camera above has at the lower end of its photo
    poses[3, :3, :3] = np.stack([np.cross([0, 0, 1], away), np.negative(away), [0, 0, 1]], axis=1)
    poses[4, :3, :3] = poses[4, :3, :3] @ about_z(90)[0]  # a phone on its side
    turns = light_turns(poses)
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (5, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(turns[3] @ poses[3, :3, 1], [-1, 0, 0], atol=1e-6)
    seen = np.einsum("nij,nj->ni", turns, back)
    np.testing.assert_allclose(seen, np.stack([np.cos(heights), 0 * heights, np.sin(heights)], axis=1), atol=1e-6)


def test_what_turns_before_a_backdrop_is_found():
    """A square of noise that is elsewhere in each photo, before noise that stands still, from three heights of the stand."""
    random = np.random.default_rng(0)
    views, squares = [], []
    for height in range(3):
        backdrop = random.integers(0, 256, (60, 80, 3)).astype(np.uint8)
        for k in range(5):
            photo, square = backdrop.copy(), np.s_[20 + height : 40, 4 + 12 * k : 16 + 12 * k]
            photo[square] = random.integers(0, 256, photo[square].shape)
            views.append(reduced(photo))
            squares.append(square)
    for moving, square in zip(moving_pixels(views), squares):
        inside = np.zeros((60, 80), bool)
        inside[square] = True
        assert moving[inside].mean() > 0.95 and moving[~inside].mean() < 0.1
    assert np.all(moving_pixels(views[:2], ["one lens", "another"]))
    for step, n_moving in ((7, 0), (8, 172)):  # a square of 10 x 10 without its corners, grown by two; not one pixel
        plain = np.zeros((4, 30, 40, 3), np.int16)
        plain[0, 10:20, 10:20, 1], plain[0, 5, 30] = step, 200
        assert [moving.sum() for moving in moving_pixels(plain)] == [n_moving, 0, 0, 0]
    large = reduced(np.full((480, 640, 3), 40 << 8, np.uint16))
    assert large.dtype == np.int16 and large.shape == (240, 320, 3) and (large == 40).all()


@pytest.mark.parametrize("edge", [0, 16, 20])
def test_photos_in_which_nothing_turns_are_refused(tmp_path, edge):
    """Or as good as nothing: less than 0.2 % of the pixels, with two around them at half the size."""
    for i in range(3):
        photo = np.full((480, 640, 3), 0.5)
        photo[40 : 40 + edge, 100 * i + 50 : 100 * i + 50 + edge] = 1
        write_image(tmp_path / f"photos/lens_1/{i}.png", photo)
    with nullcontext() if edge == 20 else pytest.raises(InputError, match="nothing turns; leave --turntable out"):
        write_moving(tmp_path / "photos", tmp_path / "moving", lambda share: None)
    assert (tmp_path / "moving").exists() == (edge == 20)
    if edge == 20:
        mask = np.asarray(Image.open(tmp_path / "moving/lens_1/2.png.png"))
        assert mask.shape == (480, 640) and (mask[40:60, 250:270] == 255).all() and mask.sum() == 255 * 4 * 172


def random_turns(n: int, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(Rotation.random(n, random_state=seed).as_matrix()).float()


def pyramid(seed: int = 0) -> LightPyramid:
    """A light that differs in all directions."""
    light = LightPyramid(32)
    with torch.no_grad():
        light.texels.copy_(0.7 * torch.randn(light.texels.shape, generator=torch.Generator().manual_seed(seed)))
    return light


def test_the_rotations_of_the_light_are_read(tmp_path):
    make_blender(tmp_path, train=6, test=2)
    still = load_dataset(tmp_path)
    assert still.light_turns is None
    turn = about_z(30.0)[0]
    edit(tmp_path, lambda meta: meta["frames"][2].update(light_rotation=turn.tolist()))
    turned = load_dataset(tmp_path)
    assert turned.light_turns[2] == pytest.approx(turn)
    assert turned.light_turns[[0, 5]] == pytest.approx(np.tile(np.eye(3), (2, 1, 1)))
    assert turned.select([2]).light_turns == pytest.approx(turn[None])
    assert dataset_fingerprint(turned) != dataset_fingerprint(still)
    for given in (*(matrix.tolist() for matrix in (2 * np.eye(3), -np.eye(3), np.eye(4))), "z", 3.0):  # no rotations
        edit(tmp_path, lambda meta, given=given: meta["frames"][1].update(light_rotation=given))
        with pytest.raises(InputError, match="light_rotation' of frame 1"):
            load_dataset(tmp_path)


def test_points_look_up_the_light_in_its_own_frame():
    light, turns = pyramid().evaluate(), random_turns(5)
    directions, roughness = torch.nn.functional.normalize(torch.randn(10, 3), dim=1), torch.rand(10, 1)
    found = light.turned(turns)(directions, roughness)
    mean = mean_over(light, turns)(directions, roughness)
    each = torch.stack([light(directions @ turn.T, roughness) for turn in turns])
    assert torch.allclose(found, torch.cat([each[i % 5, i : i + 1] for i in range(10)]), rtol=1e-3, atol=1e-4)
    assert torch.allclose(mean, each.mean(0), rtol=1e-3, atol=1e-4)


def test_a_view_under_a_turned_light_is_the_turned_view():
    """A ball looks from a camera as it does from a turned one, if the light turns with the camera."""
    model, cells = ball()
    with torch.no_grad():
        model.light.texels[:16] = torch.randn(16, 3, generator=torch.Generator().manual_seed(0))  # a smooth light
        for parameter in model.material.parameters():
            parameter.zero_()
    turn = torch.eye(4)
    turn[:3, :3] = random_turns(1)[0]
    expected = render_view(model, cells, turn @ POSE, LENS, SIZE, SIZE)
    found = render_view(model, cells, POSE, LENS, SIZE, SIZE, turn=turn[:3, :3])
    still = render_view(model, cells, POSE, LENS, SIZE, SIZE)
    covered = (expected["alpha"] > 0.9) & (found["alpha"] > 0.9)
    errors = [(rgb["rgb"] - expected["rgb"])[covered].abs().mean() for rgb in (found, still)]
    assert covered.sum() > 30 and errors[0] < 0.04 and errors[1] > 2 * errors[0]


def test_cells_have_the_mean_of_the_turned_lights():
    cells, light = SkyCells(256), pyramid(1)
    turns = about_z(*np.arange(0, 360, 90))
    cells.turns = torch.from_numpy(turns)
    assert torch.equal(cells.aims(light.evaluate()), cells.centres)
    found = cells.light(light.evaluate())
    panorama = light.panorama(64).numpy()
    mean = np.mean([turn_environment(panorama, turn) for turn in turns], axis=0)
    cells.turns = None
    fixed = cells.light(light.evaluate())
    ours, theirs = found.radiance.detach().numpy(), sample_environment(mean, cells.centres.numpy())
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.9
    weights = found.solid_angles[:, None] / found.solid_angles.sum()
    assert torch.allclose((found.radiance * weights).sum(0), (fixed.radiance * weights).sum(0), rtol=0.02)
    assert found.radiance.std() < 0.8 * fixed.radiance.std()


def test_photos_are_grouped_by_the_rotation_of_their_light():
    degrees = np.concatenate([np.arange(0, 360, 90) + d for d in (-1.0, 0.0, 2.0)])
    view = np.repeat(np.arange(12), 5)
    groups = groups_of(about_z(*degrees), view)
    assert sorted(np.concatenate(groups).tolist()) == list(range(60))
    assert all(len(set(np.round(degrees[view[group]] / 90) % 4)) == 1 for group in groups)
    many = groups_of(random_turns(200).numpy(), np.arange(200))
    assert len(many) <= 24 and sum(map(len, many)) == 200


def test_the_truth_explains_photos_of_a_turntable(painted):
    """Only in the light's own frame of each photo."""
    asset, light = painted[0], lamps()
    turns = about_z(*(36.0 * np.arange(10)))
    data = photos(asset, light, turns=turns)
    settings = FitSettings(sweeps=1, pixels=600)
    known = Refinement(data, asset, light, settings)
    error = np.mean([known.gather(known.surface()) for _ in range(6)])
    ignored = Refinement(replace(data, light_turns=None), asset, light, settings)
    assert error < 2e-4 and np.mean([ignored.gather(ignored.surface()) for _ in range(6)]) > 10 * abs(error)
    assert known.make_lamp_compact() is None


def test_made_data_turn_the_light_with_the_camera(ball, tmp_path):
    """A ball of one colour looks alike from all sides of one height, as it does to a camera that does not move."""
    write_glb(tmp_path / "ball.glb", ball)
    write_image(tmp_path / "light.hdr", lamps())
    options = ["--size", "24", "--train", "4", "--test", "6", "--spp", "256"]
    words = ["synth", str(tmp_path / "ball.glb"), "--light", str(tmp_path / "light.hdr"), *options]
    assert main([*words, "--out", str(tmp_path / "turn"), "--turntable"]) == DONE
    assert main([*words, "--out", str(tmp_path / "still")]) == DONE

    def spread(data) -> float:
        frames = json.loads((data / "transforms_test.json").read_text())["frames"]
        pictures = np.stack([read_image(data / f"{frame['file_path']}.png")[..., :3] for frame in frames])
        heights = np.array([frame["transform_matrix"][2][3] for frame in frames])
        pairs = [(i, j) for i in range(6) for j in range(i) if abs(heights[i] - heights[j]) < 0.05]
        assert pairs
        return float(np.mean([np.abs(pictures[i] - pictures[j])[8:16, 8:16].mean() for i, j in pairs]))

    assert spread(tmp_path / "turn") < 0.25 * spread(tmp_path / "still")
    turns = load_dataset(tmp_path / "turn").light_turns
    poses = load_dataset(tmp_path / "turn").world_poses
    azimuths = [np.arctan2(*(turn @ pose[:3, 3])[1::-1]) for turn, pose in zip(turns, poses)]
    assert azimuths == pytest.approx([azimuths[0]] * len(azimuths), abs=1e-5)
    assert turn_to(poses[0], poses[0]) == pytest.approx(np.eye(3))
    assert main([*words, "--out", str(tmp_path / "folders"), "--turntable", "--layout", "nerfactor"]) == 2


def test_a_run_of_a_turntable_goes_to_its_end(data, tmp_path, capsys):
    """Trained, stopped, resumed, refined, exported and scored."""
    turned = tmp_path / "data"
    shutil.copytree(data, turned)
    for split in ("train", "test"):
        content = json.loads((turned / f"transforms_{split}.json").read_text())
        for i, frame in enumerate(content["frames"]):
            frame["light_rotation"] = about_z(40.0 * i)[0].tolist()
        (turned / f"transforms_{split}.json").write_text(json.dumps(content))
    run = tmp_path / "run"
    words = ["train", str(turned), "--out", str(run), *as_options(SMALL)]
    assert main([*words, "--steps", "24"]) == DONE
    assert main([*words, "--steps", "40", "--resume"]) == DONE
    scores = json.loads((run / "evaluation.json").read_text())
    assert scores["novel_view"]["psnr"] > 8
    model, _, content = load_run(run)
    assert len(content["light_turns"]) == 6 and len(model.cells.turns) == 6
    assert model.config.shading.method == "split"
    assert main(["evaluate", str(run), "--data", str(turned), "--spp", "1"]) == DONE
    mlp = [*words, "--set", "occlusion.kind=mlp", "--set", "shading.method=split", "--overwrite"]
    assert "photos of a turntable need occlusion.kind" in refused(capsys, *mlp)
    assert json.loads((run / "evaluation.json").read_text())  # the run stays
