"""splitnerf inspect: data without fault raise no suspicion, and each fault that is made is found where it is."""

import json
from pathlib import Path

import numpy as np
import pytest
from blender_data import ANGLE, look_at, poses_around, sphere_alpha
from scipy.spatial.transform import Rotation
from splitnerf.cli import DONE, main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import linear_to_srgb, write_image
from splitnerf.data.reading import Reading
from splitnerf_tools.inspection.checks import Inspection, find_upward, inspect, largest_gap
from splitnerf_tools.inspection.reduced_views import views_of
from tiny_runs import refused

SIZE, COUNT, ALL = 100, 24, Reading("all")
BALLS = (((0.0, 0.0, 0.0), 0.7), ((0.5, 0.2, 0.3), 0.5), ((-0.1, -0.6, -0.2), 0.4))  # unlike from all sides
LINEAR = 0.2


class Photos:
    """Photos of three grey balls, to be spoilt before they are written."""

    def __init__(self, poses: list[np.ndarray] | None = None, offsets: dict[int, np.ndarray] | None = None):
        self.poses = poses_around(np.zeros(3), 1.0, COUNT) if poses is None else poses
        self.alphas = [
            np.max([sphere_alpha(pose, np.add(centre, (offsets or {}).get(i, 0)), r, SIZE) for centre, r in BALLS], 0)
            for i, pose in enumerate(self.poses)
        ]
        self.linear = [np.full((SIZE, SIZE, 3), LINEAR, np.float32) for _ in self.poses]
        self.keys: list[dict] = [{} for _ in self.poses]

    def write(self, root: Path) -> Path:
        frames = []
        for i, (pose, alpha, linear) in enumerate(zip(self.poses, self.alphas, self.linear)):
            write_image(root / f"{i:02d}.png", np.dstack([linear_to_srgb(linear), alpha]))
            frames.append({"file_path": f"{i:02d}.png", "transform_matrix": pose.tolist(), **self.keys[i]})
        (root / "transforms.json").write_text(json.dumps({"camera_angle_x": ANGLE, "frames": frames}))
        return root

    def inspected(self, root: Path) -> Inspection:
        return inspect(load_dataset(self.write(root), reading=ALL), None, ALL)


def suspects(found: Inspection) -> dict[str, list[int]]:
    """The photos that each line suspects."""
    return {finding.name: sorted(finding.suspects) for finding in found.findings if finding.suspects}


def line(found: Inspection, name: str):
    return next(finding for finding in found.findings if finding.name == name)


def test_data_without_fault_raise_no_suspicion(tmp_path):
    found = Photos().inspected(tmp_path)
    assert [finding.advice for finding in found.findings if finding.advice] == []
    assert suspects(found) == {}
    assert np.nanmax(np.abs(found.brightness)) < 0.01


def test_a_camera_in_the_object_is_found(tmp_path):
    poses = poses_around(np.zeros(3), 1.0, COUNT)
    poses[5][:3, 3] = [0.05, 0.1, 0.0]
    found = Photos(poses).inspected(tmp_path)
    assert suspects(found)["cameras in the object"] == [5]


def test_half_a_ring_of_cameras_is_one_sided(tmp_path):
    """From azimuth -90 to 90, so that half of the circle is a gap."""
    turns = np.radians(np.linspace(-90, 90, COUNT))
    poses = [look_at([4 * np.cos(t), 4 * np.sin(t), 1.0], np.zeros(3)) for t in turns]
    found = Photos(poses).inspected(tmp_path)
    assert line(found, "directions").value.startswith("largest gap 1")
    assert "add photos" in line(found, "directions").advice


def test_the_largest_gap_is_exact_and_leaves_out_the_poles():
    azimuth, elevation = np.array([-170.0, -90.0, 0.0, 100.0, 50.0]), np.array([0.0, 30.0, -30.0, 0.0, 80.0])
    assert largest_gap(azimuth, elevation) == (100.0, 0.0)
    assert largest_gap(np.array([170.0, 90.0]), np.zeros(2)) == (280.0, 170.0)
    assert largest_gap(np.array([10.0]), np.array([89.0]))[0] == 360.0


@pytest.mark.parametrize("tilt", [0.0, 35.0, 120.0, 180.0])
def test_upward_is_found_in_a_world_that_is_turned(tilt):
    turn = Rotation.from_euler("x", tilt, degrees=True).as_matrix()
    poses = np.stack(poses_around(np.zeros(3), 1.0, COUNT))
    poses[:, :3] = turn @ poses[:, :3]
    np.testing.assert_allclose(find_upward(poses), turn[:, 2], atol=1e-9)


def test_a_mask_beside_its_object_is_found(tmp_path):
    photos = Photos()
    photos.alphas[7] = np.roll(photos.alphas[7], 15, axis=1)
    found = photos.inspected(tmp_path)
    assert suspects(found)["masks against poses"] == [7]


@pytest.mark.parametrize("late", [5, 12, 17])
def test_the_photos_of_a_moved_object_are_found(tmp_path, late):
    """In the last photos it stands elsewhere; where those are most, the first ones are said to differ. One that looks
    along the shift may fit all the same."""
    shift = np.array([0.3, -0.3, 0.0])
    found = Photos(offsets={i: shift for i in range(COUNT - late, COUNT)}).inspected(tmp_path)
    first, last = set(range(COUNT - late)), set(range(COUNT - late, COUNT))
    moved = set(suspects(found)["masks against poses"])
    group = last if moved <= last else first
    assert moved <= group and 0.8 * len(group) <= len(moved) <= COUNT / 2


def test_copies_of_photos_and_of_poses_are_told_apart(tmp_path):
    photos = Photos()
    photos.alphas[3], photos.poses[20] = photos.alphas[2], photos.poses[19]
    photos.alphas[11], photos.poses[11] = photos.alphas[10], photos.poses[10]
    inspected = photos.inspected(tmp_path)
    reasons = line(inspected, "duplicate photos").suspects
    assert suspects(inspected)["duplicate photos"] == [2, 3, 10, 11, 19, 20]
    assert reasons[2] == "one photo, two poses: 03.png"
    assert reasons[11] == "one photo twice: 10.png"
    assert reasons[19] == "two photos, one pose: 20.png"


def test_a_photo_of_twice_the_exposure_is_found_until_it_says_so(tmp_path):
    photos = Photos()
    photos.linear[4] = photos.linear[4] * 2
    found = photos.inspected(tmp_path)
    assert suspects(found) == {"brightness": [4]}
    assert found.brightness[4] == pytest.approx(1, abs=0.02)
    photos.keys[4] = {"exposure": 2.0}
    assert suspects(photos.inspected(tmp_path)) == {}


def test_photos_of_any_exposure_are_told_once(tmp_path):
    photos = Photos()
    for i, gain in enumerate(np.random.default_rng(0).normal(0, 0.4, COUNT)):
        photos.linear[i] = photos.linear[i] * np.float32(2**gain)
    assert "`exposure`" in line(photos.inspected(tmp_path), "brightness").advice


def test_an_object_that_is_cut_or_small_or_clipped_is_found(tmp_path):
    photos = Photos()
    photos.poses[2] = look_at(photos.poses[2][:3, 3], [0.0, 0.0, 1.0])  # the object leaves the photo below
    photos.poses[9][:3, 3] *= 3
    photos = Photos(photos.poses)
    photos.linear[6][:, : SIZE // 2] = 1.0
    found = photos.inspected(tmp_path)
    assert suspects(found)["cut by the edge"] == [2]
    assert suspects(found)["masks cover"] == [9]
    assert suspects(found)["clipped"] == [6]


def test_shares_are_those_of_the_pixels(tmp_path):
    """A mask on the left quarter: a quarter of the pixels, and of the 396 of the edge a side of 100 and 2 times 24."""
    photos = Photos()
    photos.alphas[0][:] = 0
    photos.alphas[0][:, :25] = 1
    photos.linear[0][:, :5] = 1.0
    view = views_of(load_dataset(photos.write(tmp_path), reading=ALL))[0]
    assert (view.share, view.clipped) == (0.25, pytest.approx(0.2))
    assert view.cut == pytest.approx((100 + 2 * 24) / 396)


def test_the_command_prints_advice_and_writes_one_page(tmp_path, capsys):
    photos = Photos()
    photos.linear[4] = photos.linear[4] * 2
    data = photos.write(tmp_path / "data")
    before = sorted(data.iterdir())
    assert main(["inspect", str(data), "--eval-mode", "all", "--out", str(tmp_path)]) == DONE
    printed, page = capsys.readouterr().out, (tmp_path / "inspect.html").read_text()
    assert "24 photos to train on, 0 held out" in printed and "-> exposed otherwise" in printed
    assert page.index("04.png with its mask") < page.index("00.png with its mask")  # what is suspected comes first
    assert page.count("<figure><img") == COUNT and 'src="http' not in page and "href=" not in page
    assert sorted(data.iterdir()) == before


def test_held_out_photos_are_looked_at_too(tmp_path, capsys):
    photos = Photos()
    photos.linear[8] = photos.linear[8] * 2  # every 8th is held out
    data = photos.write(tmp_path / "data")
    assert main(["inspect", str(data), "--out", str(tmp_path / "page.html")]) == DONE
    assert "21 photos to train on, 3 held out" in (printed := capsys.readouterr().out)
    assert "08.png" in printed and "held out · <b>brightness +1" in (tmp_path / "page.html").read_text()


@pytest.mark.parametrize(
    "data, out, said", [("absent", "page.html", "no such folder"), ("data", "page.txt", "not a page")]
)
def test_bad_input_is_refused(tmp_path, capsys, data, out, said):
    Photos().write(tmp_path / "data")
    assert said in refused(capsys, "inspect", tmp_path / data, "--out", tmp_path / out)
    assert not (tmp_path / out).exists()
