"""Published sets: what is written in the form of each is read again, and the protocols by closed forms."""

import json
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from published_scenes import FOCAL, RELIT, SIZE, TEST, TRAIN, Written, write_set
from splitnerf.cli import DONE, main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.environment import turn_environment
from splitnerf.data.frames import layout_of, read_frames
from splitnerf.data.images import read_radiance, srgb_to_linear, write_image
from splitnerf.data.layouts import transforms, view_folders
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import lens_intrinsics
from splitnerf.data.photos import load_photo
from splitnerf.data.pixels import decoded
from splitnerf.data.reading import Reading
from splitnerf.data.truth import map_files
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import psnr
from splitnerf.evaluate.published.scoring import table_of_lights
from splitnerf.evaluate.published.views import relit_views

SETS = {"nerfactor": view_folders, "shiny": transforms}  # and the modules that read them
RANDOM = np.random.default_rng(11)
QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.fixture(scope="module", params=SETS)
def written(request, tmp_path_factory) -> tuple[str, Written]:
    return request.param, write_set(tmp_path_factory.mktemp(request.param), request.param)


def fits(frame: Frame, rendered: dict[str, np.ndarray]) -> float:
    """PSNR in dB of a rendering and a photo, to the power of 1 / 2.2, on pixels in the mask that are not clipped."""
    rgba = decoded(load_photo(frame, 1, "object").rgba)
    photo, known = srgb_to_linear(rgba[..., :3]), (rgba[..., 3] > 0.99) & (rgba[..., :3] < 0.95).all(axis=-1)
    return psnr(*(image[known].clip(0, 1) ** (1 / 2.2) for image in (rendered["radiance"], photo)))


def test_published_scores_stand_beside_those_of_their_own_protocol():
    """The SplitNeRF paper's are of 20 views and a factor on the images, not of NeRFactor's protocol."""
    shown = table_of_lights({"relight": {"psnr": 30.0, "ssim": 0.95, "lpips": None}, "albedo": {"psnr": 26.0}}, "ours")
    head, ours, *published, source = shown.splitlines()
    assert ours.split() == ["ours", "30.00", "0.950", "-", "26.00", "-", "-"] and "relit, PSNR" in head
    assert published[-1].split()[:3] == ["SplitNeRF", "27.31", "0.941"] and "20 test views" in source


def test_it_is_recognised_and_the_cameras_are_those_that_were_written(written):
    name, scene = written
    assert layout_of(scene.root) is SETS[name]
    frames = read_frames(scene.root, "train", Reading("all"))[0]
    expected = [*scene.train, *scene.test]
    assert len(frames) == len(expected)
    for frame, pose in zip(frames, expected):
        assert frame.pose == pytest.approx(pose, abs=1e-9)
        assert lens_intrinsics(frame.lens, (SIZE, SIZE)) == pytest.approx([FOCAL, FOCAL, SIZE / 2, SIZE / 2], rel=1e-9)
        assert frame.distortion is None


def test_the_truth_from_each_camera_looks_like_the_photo(written):
    """And not like it from a camera with other axes, with its motion the other way round, or seen in a mirror."""
    name, scene = written
    light, worst = read_radiance(scene.root / "light.hdr"), 34
    frames = read_frames(scene.root, "train", Reading("all"))[0]
    for frame in frames[1:4:2]:
        right = scene.render(light, frame.pose)
        assert fits(frame, right) > worst, fits(frame, right)
        assert fits(frame, {"radiance": right["radiance"][:, ::-1]}) < worst - 6
    for wrong in (
        frame.pose @ np.diag([1.0, -1, -1, 1]),
        frame.pose @ np.diag([-1.0, -1, 1, 1]),
        np.linalg.inv(frame.pose),
    ):
        assert fits(frame, scene.render(light, wrong, 16)) < worst - 6


def test_the_light_of_each_relit_photo_makes_it(written):
    """And not the light mirrored or turned by a quarter, in the world or in its own axes."""
    name, scene = written
    if name == "shiny":
        return
    views = relit_views(scene.root, map_files(scene.root, prefixed=True))
    assert len(views) == TEST * len(RELIT)
    poses = np.repeat(scene.test, len(RELIT), axis=0)
    worst = 33
    for view, pose in list(zip(views, poses))[:: 3 if len(views) > 4 else 1]:
        light = view.radiance()
        assert view.frame.pose == pytest.approx(pose, abs=1e-9)
        assert fits(view.frame, scene.render(light, pose)) > worst, fits(view.frame, scene.render(light, pose))
    for wrong in (light[:, ::-1], light[::-1], turn_environment(light, QUARTER), turn_environment(light, QUARTER.T)):
        assert fits(view.frame, scene.render(wrong, pose, 16)) < worst - 4


def test_a_trainer_reads_it(written):
    name, scene = written
    data = load_dataset(scene.root, "train")
    assert len(data) == TRAIN and data.height == SIZE
    assert 0.1 < (data.images[..., 3] > 0.5).mean() < 0.6


def test_radiance_a_little_below_0_is_noise(tmp_path):
    pixels = RANDOM.uniform(0.1, 0.5, (16, 16, 3)).astype(np.float32)
    pixels[3, 4] = -0.01
    for factor, good in ((1, True), (100, False)):
        write_image(tmp_path / "a.exr", np.where(pixels < 0, factor * pixels, pixels))
        frame = Frame("a", tmp_path / "a.exr", np.eye(4), {"camera_angle_x": 0.5})
        if good:
            rgba = load_photo(frame, 1, "object").rgba
            assert not rgba[3, 4, :3].any() and rgba[..., :3].any(axis=-1).sum() == 255
            continue
        with pytest.raises(InputError, match="a.exr: has NaN, infinite or negative pixels"):
            load_photo(frame, 1, "object")


# ---- the truth scores nearly perfectly ----


BEST = {  # layout: what the truth, path traced, must score at least, by key
    "nerfactor": {"psnr": 30, "albedo_psnr": 30, "view_psnr": 30},
    "shiny": {"view_psnr": 30},
}
ERRORS = {"shiny": 4, "nerfactor": 3}  # degrees of its normals


def complete(layout: str, scene) -> None:
    """Writes the truth that synth does not write, and gives views the numbers that the protocol takes."""
    root = scene.root
    if layout == "nerfactor":  # of 200 test views two that count, and two validation views, of which one has the factor
        for i in range(2):
            shutil.copytree(root / f"test_{i:03d}", root / f"val_{i:03d}")
        (root / "val_001/albedo.png").unlink()
        for old, new in ((0, 49), (1, 199)):
            (root / f"test_{old:03d}").rename(root / f"test_{new:03d}")


def tinted(path: Path, tint: tuple[float, float, float]) -> Path:
    """A GLB file with all colours of its materials times a tint."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    content, rest = json.loads(data[20 : 20 + length]), data[20 + length :]
    for material in content["materials"]:
        pbr = material["pbrMetallicRoughness"]
        pbr["baseColorFactor"] = [*np.multiply(pbr["baseColorFactor"][:3], tint), 1.0]
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    out = path.with_name("tinted.glb")
    out.write_bytes(struct.pack("<4s4I", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest)
    return out


def test_albedos_and_relit_views_are_scored_after_the_albedos_factors(tmp_path):
    """Of the truth in other colours, as of a reconstruction whose light is that much off."""
    scene = write_set(tmp_path / "s", "nerfactor")
    complete("nerfactor", scene)
    asset = tinted(next((tmp_path / "s").rglob("asset.glb")), (0.5, 0.8, 1.1))
    options = [
        "--data",
        str(scene.root),
        "--protocol",
        "nerfactor",
        "--env",
        str(scene.root / "light.hdr"),
        "--spp",
        "96",
    ]
    assert main(["evaluate", str(asset), *options, "--out", str(tmp_path / "scores.json")]) == DONE
    scores = json.loads((tmp_path / "scores.json").read_text())["scores"]
    for key in ("psnr", "albedo_psnr"):
        assert scores[key] > BEST["nerfactor"][key], (key, scores)


@pytest.mark.parametrize("layout", BEST)
def test_the_truth_scores_nearly_perfectly_by_the_protocol_of_its_set(layout, tmp_path, capsys):
    scene = write_set(tmp_path / "s", layout)
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
    assert scores["normals"] < ERRORS[layout]
    assert f"scores: {tmp_path / 'scores.json'}" in shown
