"""splitnerf inspect: data without fault raise no suspicion, and each fault that is made is found where it is."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from blender_data import ANGLE, look_at, poses_around, sphere_alpha
from scipy.spatial.transform import Rotation
from splitnerf.cli import DONE, main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import linear_to_srgb, srgb_to_linear, write_image
from splitnerf.data.reading import Reading
from splitnerf_tools.inspection import inspect_page, reduced_views
from splitnerf_tools.inspection.checks import Inspection, duplicates, find_upward, horizontal_axes, inspect, largest_gap
from splitnerf_tools.inspection.reduced_views import views_of
from tiny_runs import refused

SIZE, COUNT, ALL = 100, 24, Reading("all")
BALLS = (((0.0, 0.0, 0.0), 0.7), ((0.5, 0.2, 0.3), 0.5), ((-0.1, -0.6, -0.2), 0.4))  # unlike from all sides
MIDDLE, RADIUS = (0.15, -0.15, 0.05), 0.554 + 0.5  # of their bounding box, and from there to the end of the second
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
    photos = Photos()
    for pose in photos.poses:
        pose[:3, 3] *= 2  # and all lengths
    found = photos.inspected(tmp_path)
    assert [finding.advice for finding in found.findings if finding.advice] == [] and suspects(found) == {}
    said = r"(\S+) to (\S+) \(median (\S+)\) radii of the object; one is (\S+) of the data's units"
    numbers = re.fullmatch(said, line(found, "distance of cameras").value)
    away = [np.linalg.norm(pose[:3, 3] / 2 - MIDDLE) / RADIUS for pose in photos.poses]
    *told, unit = map(float, numbers.groups())
    assert np.nanmax(np.abs(found.brightness)) < 0.01 and "on, 0 held out" in line(found, "layout").value
    assert "(median 5) degrees above" in line(found, "directions").value  # of heights evenly from -0.6 to 0.8
    assert (
        told == pytest.approx([min(away), max(away), np.median(away)], rel=0.05) and RADIUS < unit / 2 < RADIUS + 0.06
    )


@pytest.mark.parametrize("side, gap, sector", [(90, 176, [92, -92]), (115, 126, [116, -118]), (125, 106, None)])
def test_part_of_a_ring_of_cameras_is_one_sided(tmp_path, side, gap, sector):
    """From azimuth -side to side about the origin; 120 degrees are a gap, as seen from the object's middle."""
    turns = np.radians(np.linspace(-side, side, COUNT))
    poses = [look_at([4 * np.cos(t), 4 * np.sin(t), 1.0], np.zeros(3)) for t in turns]
    found = line(Photos(poses).inspected(tmp_path), "directions")
    said = [int(number) for number in re.search(r"gap (\d+) degrees around; (\d+) to (\d+) ", found.value).groups()]
    assert said[0] == pytest.approx(gap, abs=2) and said[1:] == pytest.approx([13, 14], abs=1)
    told = re.search(r"from azimuth (-?\d+) to (-?\d+) degrees, .* add photos", found.advice)
    assert (told and [int(angle) for angle in told.groups()]) == (sector and pytest.approx(sector, abs=2))


def test_the_largest_gap_is_exact_and_leaves_out_the_poles():
    azimuth, elevation = np.array([-170.0, -90.0, 0.0, 100.0, 50.0]), np.array([0.0, 74.5, -30.0, 0.0, -75.5])
    assert largest_gap(azimuth, elevation) == (100.0, 0.0)
    assert largest_gap(np.array([170.0, 90.0]), np.zeros(2)) == (280.0, 170.0)
    assert largest_gap(np.array([10.0]), np.array([89.0])) == (360.0, -180.0)


@pytest.mark.parametrize("tilt, found", [(0, 0), (9, 0), (11, 11), (35, 35), (90, 90), (120, 120), (180, 180)])
def test_upward_is_found_in_a_world_that_is_turned(tilt, found):
    """Up to 10 degrees count as none. Rolled cameras do not tell."""
    turn, upward = (Rotation.from_euler("y", angle, degrees=True).as_matrix() for angle in (tilt, found))
    poses = np.stack(poses_around(np.zeros(3), 1.0, COUNT))
    poses[:, :3] = turn @ poses[:, :3]
    np.testing.assert_allclose(find_upward(poses), upward[:, 2], atol=1e-9)
    axes = np.stack([*horizontal_axes(upward[:, 2]), upward[:, 2]])
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-9) and np.linalg.det(axes) == pytest.approx(1)
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(np.outer(2.4 * np.arange(COUNT), [0, 0, 1])).as_matrix()
    assert find_upward(poses).tolist() == [0, 0, 1]


def test_a_camera_in_the_object_and_a_mask_beside_it_are_found(tmp_path):
    poses = poses_around(np.zeros(3), 1.0, COUNT)
    poses[5][:3, 3] = [0.05, 0.1, 0.0]
    photos = Photos(poses)
    photos.alphas[17] = np.roll(photos.alphas[17], 15, axis=1)
    found = photos.inspected(tmp_path)
    assert suspects(found)["cameras in the object"] == [5] and suspects(found)["masks against poses"] == [17]


def test_masks_that_fit_nowhere_are_said_once(tmp_path):
    photos, draw = Photos(), np.random.default_rng(0)
    photos.alphas = [np.roll(alpha, draw.integers(-20, 21, 2), (0, 1)) for alpha in photos.alphas]
    found = line(photos.inspected(tmp_path), "masks against poses")
    assert found.advice.startswith("masks and poses fit badly everywhere") and found.suspects == {}


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
    assert line(found, "masks against poses").advice.endswith(f" and {len(moved) - 3} more; the object may have moved")


def test_copies_of_photos_and_of_poses_are_told_apart(tmp_path):
    photos = Photos()
    photos.alphas[3], photos.poses[20] = photos.alphas[2], photos.poses[19]
    photos.alphas[11], photos.poses[11] = photos.alphas[10], photos.poses[10]
    inspected = photos.inspected(tmp_path)
    reasons = line(inspected, "duplicate photos").suspects
    assert suspects(inspected)["duplicate photos"] == [2, 3, 10, 11, 19, 20]
    told = "one photo, two poses: 03.png", "one photo twice: 10.png", "two photos, one pose: 20.png"
    assert tuple(reasons[index] for index in (2, 11, 19)) == told
    value = "1 pairs, one photo twice, 1 pairs, one photo, two poses, 1 pairs, two photos, one pose"
    assert line(inspected, "duplicate photos").value == value
    for degrees, radii, pairs in ((0.04, 9e-4, 1), (0.06, 0, 0), (0, 1.1e-3, 0)):  # of one pose to another
        first, pose = inspected.views[0], inspected.views[0].pose.copy()
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_euler("y", degrees, degrees=True).as_matrix()
        pose[0, 3] += 2 * radii
        assert len(duplicates([first, replace(inspected.views[1], pose=pose)], 2.0)) == pairs


def test_a_photo_of_twice_the_exposure_is_found_until_it_says_so(tmp_path):
    """From 0.3 EV on, of the luminance of the linear colours."""
    photos = Photos()
    for index, factors in {4: 2.0, 10: 2**0.28, 15: (3.0, 1.2, 1.0), 22: 2**0.32}.items():
        photos.linear[index] = photos.linear[index] * np.float32(factors)
    found = photos.inspected(tmp_path)
    coloured = np.log2(3 * 0.2126 + 1.2 * 0.7152 + 0.0722)
    assert suspects(found) == {"brightness": [4, 15, 22]}
    assert found.brightness[[4, 10, 15, 22]] == pytest.approx([1, 0.28, coloured, 0.32], abs=0.02)
    brightness = line(found, "brightness")
    assert list(brightness.suspects) == [4, 15, 22] and brightness.suspects[4] == "brightness +1.00 EV"
    assert brightness.value.startswith("no exposures stated; ") and brightness.value.endswith(", at most 1")
    photos.keys[4] = {"exposure": 2.0}
    found = photos.inspected(tmp_path)
    assert suspects(found) == {"brightness": [15, 22]}
    assert line(found, "brightness").value.startswith("exposures stated, 1.00 to 2.00 (median 1.00); ")


def test_photos_of_any_exposure_are_told_once(tmp_path):
    photos = Photos()
    for i, gain in enumerate(np.random.default_rng(0).normal(0, 0.4, COUNT)):
        photos.linear[i] = photos.linear[i] * np.float32(2**gain)
    found = photos.inspected(tmp_path)
    said, usual = line(found, "brightness"), 1.4826 * np.median(np.abs(found.brightness))
    assert "`exposure`" in said.advice and f" by {usual:.2g} EV, " in said.value  # the deviation of normal values


def test_an_object_that_is_cut_or_small_or_clipped_is_found(tmp_path):
    """Below 5 % of the photo, above 1 % of its edge, above 5 % of the object; each beside a photo that is still good."""
    photos = Photos()
    for index, missing in ((3, 1), (9, 0)):
        photos.alphas[index][:] = 0
        photos.alphas[index][40:60, 40:65].flat[missing:] = 1
    for index, edge, more in ((12, 4, 1), (15, 3, 0)):
        photos.alphas[index][0, :edge] = 1
        rows, columns = np.nonzero(photos.alphas[index + 6])
        bright = np.s_[: len(rows) // 20 + more]
        photos.linear[index + 6][rows[bright], columns[bright]] = 1.0
    found = photos.inspected(tmp_path)
    assert line(found, "masks cover").suspects == {3: "object on 5.0%"}
    assert line(found, "cut by the edge").suspects == {12: "cut, 1% of the edge"}
    assert line(found, "clipped").suspects == {18: "clipped 5%"}


@pytest.mark.parametrize("exposure, factor", [(1.0, 1), (2.0, 1), (1.0, 2)])
def test_shares_are_those_of_the_pixels(tmp_path, monkeypatch, exposure, factor):
    """A mask on the left 28 %: so many of the pixels, and of the edge one side and 28 % of two; a quarter of it is clipped."""
    monkeypatch.setattr(reduced_views, "SIZE", SIZE // factor)
    photos, side = Photos(), SIZE // factor
    photos.keys[0] = {"exposure": exposure}
    photos.alphas[0][:] = 0
    photos.alphas[0][:, :28] = 1
    photos.linear[0][:, :7], photos.linear[0][:, 7:14] = 1.0, srgb_to_linear(np.float32(254 / 255))
    view = views_of(load_dataset(photos.write(tmp_path), reading=ALL))[0]
    assert (view.share, view.clipped, view.exposure) == (0.28, pytest.approx(0.25), exposure)
    assert view.cut == pytest.approx((side + 2 * (0.28 * side - 1)) / (4 * side - 4))
    focal = 0.5 * side / np.tan(ANGLE / 2)
    assert view.mask.shape == (side, side) and view.intrinsics == pytest.approx([focal, focal, side / 2, side / 2])


def test_the_command_prints_advice_and_writes_one_page(tmp_path, capsys, monkeypatch):
    """Held out photos are looked at too; the plans show all cameras; of photos without suspicion so many are shown."""
    monkeypatch.setattr(inspect_page, "SHOWN", 5)
    photos = Photos()
    photos.alphas, photos.linear = ([image[10:90] for image in images] for images in (photos.alphas, photos.linear))
    photos.linear[0] = photos.linear[0] * 2  # every 8th is held out
    data = photos.write(tmp_path / "data")
    before = sorted(data.iterdir())
    assert main(["inspect", str(data), "--out", str(tmp_path)]) == DONE and sorted(data.iterdir()) == before
    printed, page = capsys.readouterr().out, (tmp_path / "inspect.html").read_text()
    assert "21 photos to train on, 3 held out" in printed and "-> exposed otherwise" in printed and "00.png" in printed
    assert "100 x 80 pixels, 40 degrees across" in printed and re.search("upward by the cameras +z\n", printed)
    assert page.index("00.png with its mask") < page.index("01.png with its mask")  # what is suspected comes first
    assert 'src="http' not in page and "href=" not in page and "held out · <b>brightness +1" in page
    drawn = [page.count(f'<circle class="{kind}"') for kind in ("camera", "held-out", "suspect")]
    assert drawn == [2 * 21, 2 * 2, 2] and page.count("<figure><img") == 6 and "18 others are not shown" in page
    assert f"the last photo <b>{100 * photos.alphas[16].mean():.4g}</b>" in page
    for folder, out, said in ((tmp_path / "absent", "page.html", "no such folder"), (data, "page.txt", "not a page")):
        assert said in refused(capsys, "inspect", folder, "--out", tmp_path / out) and not (tmp_path / out).exists()
