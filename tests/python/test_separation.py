"""Masks for photos without any: the region, and a ball on a floor from end to end."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from blender_data import look_at
from splitnerf.cli import main
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.images import read_image, srgb_to_linear, write_image
from splitnerf.data.normalisation import box_of_views, transform_points
from splitnerf.data.photos import separated_mask
from splitnerf.data.reading import SEPARATED, Reading
from splitnerf.errors import InputError
from splitnerf_tools.capture import masks as capture_masks
from splitnerf_tools.separation import masks as finding
from splitnerf_tools.separation import separate as separation
from splitnerf_tools.separation import training
from splitnerf_tools.separation.field import RadianceField, Rendered
from splitnerf_tools.separation.foot import find_foot
from splitnerf_tools.separation.ground import Table, find_table
from splitnerf_tools.separation.masks import at_edges, find_mask, view_rays, with_background, with_mirrors
from splitnerf_tools.separation.region import CELLS, Region, find_region
from splitnerf_tools.separation.walker import random_walk
from tiny_runs import train

SIZE, FOCAL = 40, 40.0
CENTRE, RADIUS = np.array([0, 0, 0.35]), 0.35
EVERYWHERE = Region(np.ones((CELLS,) * 3, bool), None)


class TestRegion:
    LEVEL = (0.3, 37, 0, 0, True), (0.3, 43, 0, 0, False), (0.18, 0, 0, 0, True), (0.12, 0, 0, 0, False)
    BELOW = (0.5, 6, 0.13, 0.01, True), (0.5, 0, 0.17, 0, False), (0.9, 0, 0.07, 0.03, False), (0.5, 0, 0, 0.1, True)

    @pytest.mark.parametrize("share, tilt, depth, below, found", LEVEL + BELOW)
    def test_a_table_is_large_and_level_and_nothing_shows_below(self, share, tilt, depth, below, found):
        """By the share of points on it, degrees, the centre's depth in the cameras' distances, and the share of points below."""
        random = np.random.default_rng(0)
        points = random.uniform([-1, -1, 0.2], [1, 1, 2], (4000, 3))
        points[: int(4000 * share), 2] = random.normal(size=int(4000 * share)) * 0.001
        points[-int(4000 * below) or 4000 :, 2] *= -0.5
        up = np.array([np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt))])
        plane = find_table(points, np.array([0, 0, -3.0 * depth]), up, 3.0, random)
        assert (plane is not None) == found
        np.testing.assert_allclose(np.append(*plane) if found else [0, 0, 1, 0], [0, 0, 1, 0], atol=2e-3)

    @pytest.mark.parametrize("scatter, told", [(0.001, (6, 203)), (0.01, (25, 203)), (0.04, (60, 200)), (0, (60, 200))])
    def test_things_stand_out_by_how_far_the_tables_points_scatter(self, scatter, told):
        """At 2.5 standard deviations, within limits; points farther than 0.05 from the plane, maybe all, tell nothing of it."""
        random, normal = np.random.default_rng(0), np.array([0.6, 0, 0.8])
        apart = np.append(np.full(9000, 0.055), (random.normal(size=5000) * scatter + 0.003)[: 5000 * (scatter > 0)])
        table = Table.through(normal, 0.2, (0.2 + apart)[:, None] * normal)
        assert (1000 * table.height, 1000 * table.offset) == pytest.approx(told, abs=1)
        np.testing.assert_allclose(np.cross(*table.axes), normal, atol=1e-12)

    @pytest.mark.parametrize("table", [None, Table(np.array([0.0, 0, 1]), -0.3)])
    def test_parts_count_by_their_size_and_place(self, table):
        """A tube and what stands over it, not what stands apart, a speck, or cells of one point; filled, larger, to a table."""
        cells = np.zeros((6, *(CELLS,) * 3), bool)
        cells[0, 33:63, 33:63, 44:56] = cells[1, 58:64, 50:56, 64:69] = cells[2, 70:76, 45:51, 45:50] = True
        cells[3, 40:45, 40:45, 64:69] = cells[4, 36:42, 50:56, 72:75] = cells[5, 86:94, 10:86, 44:60] = True
        cells[0, 35:61, 35:61], cells[5, 2:94, 2:94, 38:40] = False, table is not None
        tube, over, apart, speck, vague, far = (Region(part, None).centres().numpy() for part in cells)
        first = tube, over, over, apart, speck, vague, far
        second = tube, apart, speck, far, *(9 + 0 * x for x in (over, over, vague))
        region = find_region(np.concatenate(first + second), table, 2)
        held = [bool(region.holds(torch.from_numpy(part.mean(0)))) for part in (tube, over, apart, speck, vague)]
        assert held == [True, True, False, False, False]
        assert region.holds(torch.tensor([[-0.45, 0, 0.31], [-0.45, 0, 0.34]])).tolist() == [True, False]
        below = torch.tensor([[0.475, 0.18, 0.417], [-0.45, 0, -0.26], [-0.45, 0, -0.28], [-0.9, 0, -0.25]])
        assert region.holds(below).tolist() == [table is not None, table is not None, False, False]
        down = torch.tensor([[-0.48, 0, 3.0], [0.35, 0.18, 3.0]]), torch.tensor([[1e-9, 1e-9, -1.0]] * 2)
        assert region.blocks(*down).tolist() == [True, False]  # only one photo shows the other part

    def test_a_wall_is_looked_for_where_there_is_no_table(self):
        """It may stand 0.7 before the middle; what is farther than 1.5 from the middle tells nothing."""
        cameras = SimpleNamespace(poses=np.stack([look_at([3, y, z], [0, 0, 0]) for y in (-1, 1) for z in (-1, 1)]))
        for axis, place, found in (0, 0.6, True), (0, 0.85, False), (2, -0.5, True):
            points = np.random.default_rng(0).uniform([-1, -1, -1], [0.5, 1, 1], (4000, 3))
            points[:3000, axis] = place
            table = separation.table_under(np.concatenate([points, *[points + [2.1, 0, 0]] * 6]), cameras, 0)
            assert (table is not None and table.normal[axis] > 0.99) == found

    def test_box_of_views(self):
        centre = np.array([5.0, -2, 1])
        around = np.array([[3, 0, 1], [0, 3, 1], [-3, 0, 2], [0, -3, 0.5]])
        poses = np.stack([look_at(centre + at, centre) for at in around])
        box = box_of_views(poses, np.tile([50.0, 30, 0, 0], (4, 1)), np.tile([40, 60], (4, 1)))
        np.testing.assert_allclose(box[:3, :3] @ centre + box[:3, 3], 0, atol=1e-6)
        assert 1 / box[0, 0] == pytest.approx(0.8 * np.median(np.linalg.norm(around, axis=1)) * 30 / 50)
        with pytest.raises(ValueError, match="all 4 cameras stand at one place"):
            box_of_views(poses[[0] * 4], np.full((4, 4), 50.0), np.full((4, 2), 40))

    def test_nothing_in_the_middle(self, ball):
        with pytest.raises(InputError, match=f"{ball[1].root}: nothing stands out in the middle of the photos"):
            separation.find_object(None, ball[1], None, np.full((10, 3), 3.0))


def pattern(points: np.ndarray, colour: list[float]) -> np.ndarray:
    """A colour, brighter and darker in tiles that do not repeat."""
    tiles = np.floor(4 * points) @ np.array([127.1, 311.7, 74.7])[: points.shape[-1]]
    return np.array(colour) * (0.5 + 0.5 * np.modf(np.abs(np.sin(tiles) * 43.7))[0][..., None])


def ball_on_floor(origins, rays, radius: float = RADIUS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colours [..., 3] of a patterned ball on a patterned floor, distances [...], and whether it is the ball [...]."""
    apart = origins - CENTRE
    half = (rays * apart).sum(-1)
    inside = half**2 - ((apart**2).sum(-1) - radius**2)
    t_ball = -half - np.sqrt(inside.clip(0))
    t_floor = np.where(rays[..., 2] < 0, -origins[..., 2] / np.minimum(rays[..., 2], -1e-3), 200.0)
    on_ball, on_floor = (origins + t[..., None] * rays for t in (t_ball, t_floor))
    ground = np.where(rays[..., 2:] < 0, pattern(on_floor[..., :2], [0.2, 0.7, 0.3]), [0.5, 0.6, 0.9])
    hit = (inside > 0) & (t_ball > 0)
    colours = np.where(hit[..., None], pattern(on_ball - CENTRE, [0.9, 0.3, 0.2]), ground)
    return colours, np.where(hit, t_ball, t_floor), hit


def write_ball_on_floor(root, n: int = 20, *, alpha: bool = False) -> list[np.ndarray]:
    """Photos without masks of the ball, or with an alpha that is 1 everywhere; returns the true masks."""
    frames, masks = [], []
    for i in range(n):
        angle, height = 2.4 * i, 0.9 + 1.2 * (i % 5) / 4
        pose = look_at(np.array([2.2 * np.cos(angle), 2.2 * np.sin(angle), height]), CENTRE)
        y, x = np.mgrid[:SIZE, :SIZE] + 0.5
        rays = np.stack([(x - SIZE / 2) / FOCAL, -(y - SIZE / 2) / FOCAL, -np.ones_like(x)], -1) @ pose[:3, :3].T
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        image, _, mask = ball_on_floor(np.broadcast_to(pose[:3, 3], rays.shape), rays)
        write_image(root / f"images/p{i}.png", np.dstack([image, np.ones((SIZE, SIZE))]) if alpha else image)
        frames.append({"file_path": f"images/p{i}.png", "transform_matrix": pose.tolist()})
        masks.append(mask)
    lens = {"fl_x": FOCAL, "fl_y": FOCAL, "cx": SIZE / 2, "cy": SIZE / 2, "w": SIZE, "h": SIZE, "frames": frames}
    (root / "transforms.json").write_text(json.dumps(lens))
    return masks


class TrueField:
    """The ball on its floor as a field that needs no training; the part that is hidden must be the ball."""

    def __init__(self, world_from_box: np.ndarray):
        self.scale, self.shift = world_from_box[0, 0], world_from_box[:3, 3]

    def render(self, rays_o, rays_d, n_first, n, jitter=False, hidden=None, coloured=True):
        origins, rays = rays_o.double().numpy() * self.scale + self.shift, rays_d.double().numpy()
        if hidden is not None:
            assert hidden(torch.from_numpy((CENTRE - self.shift) / self.scale).float())
        colour, t, _ = ball_on_floor(origins, rays, RADIUS if hidden is None else 0.0)
        weights = torch.eye(n)[:1].expand(len(rays), -1)
        distances = torch.from_numpy(t / self.scale).float()[:, None].expand(-1, n)
        return Rendered(torch.from_numpy(colour).float(), weights, distances, distances, weights, distances)


@pytest.fixture(scope="module")
def ball(tmp_path_factory) -> tuple[list[np.ndarray], Dataset, TrueField]:
    """The true masks of eight photos, the photos without masks, and the field that is right."""
    root = tmp_path_factory.mktemp("ball")
    masks, photos = write_ball_on_floor(root, 8), load_dataset(root, reading=Reading("all"), masked=False)
    return masks, photos, TrueField(photos.world_from_box)


def overlap(run, masks: list[np.ndarray]) -> float:
    """The mean intersection over union of a run's found masks with the true ones."""
    found = [read_image(run / SEPARATED / f"images/p{i}.png")[..., 0] > 0.5 for i in range(len(masks))]
    return float(np.mean([(a & b).sum() / (a | b).sum() for a, b in zip(found, masks)]))


class TestRuns:
    @pytest.mark.parametrize("alpha", [False, True])
    def test_photos_without_masks_are_refused_unless_allowed_or_found(self, tmp_path, alpha):
        masks, images = write_ball_on_floor(tmp_path, 8, alpha=alpha), tmp_path / "images"
        with pytest.raises(InputError, match="images: nothing says where the object is"):
            load_dataset(tmp_path, reading=Reading("all"))
        photos = load_dataset(tmp_path, reading=Reading("all"), masked=False)
        assert not photos.masked and (photos.images[..., 3] == 1).all()
        np.testing.assert_allclose(transform_points(photos.world_from_box, np.zeros(3)), [0, 0, 0.35], atol=0.01)
        for i, mask in enumerate(masks):
            small = mask.reshape(SIZE // 2, 2, SIZE // 2, 2).mean((1, 3))
            write_image(tmp_path / "found" / separated_mask(images / f"p{i}.png", tmp_path), small)
        photos = load_dataset(tmp_path, reading=Reading("all", separated=tmp_path / "found"))
        assert photos.masked and ((photos.images[..., 3] > 0.5) == np.stack(masks)).mean() > 0.98

    def test_from_photos_without_masks_to_an_asset(self, tmp_path, capsys, monkeypatch):
        """Trains with the masks by a field that is right, and scores the run again with them."""
        masks, run = write_ball_on_floor(tmp_path / "data"), tmp_path / "run"
        monkeypatch.setattr(separation, "train_field", lambda dataset, **_: TrueField(dataset.world_from_box))
        assert train(tmp_path / "data", run, "--eval-mode=all", "--steps=30") == 0 and overlap(run, masks) > 0.9
        assert (run / SEPARATED / "sheet.jpg").is_file() and (run / "mesh.glb").is_file()
        around = read_image(run / SEPARATED / "surroundings.exr")
        assert np.abs(around[8, :, :3] - [0.214, 0.319, 0.787]).max() < 1e-3  # the sky
        assert around[36:48, :, 1].mean() > 2 * around[36:48, :, 0].mean() and around[36:48, :, 3].mean() > 0.6
        assert "above a table" in capsys.readouterr().err
        found = json.loads((run / SEPARATED / "ground.json").read_text())
        np.testing.assert_allclose([*found["normal"], found["offset"]], [0, 0, 1, 0], atol=0.01)
        assert main(["evaluate", str(run), "--data", str(tmp_path / "data"), "--spp", "1"]) == 0
        (run / SEPARATED / "images/p0.png").write_bytes(b"")
        assert train(tmp_path / "data", run, "--eval-mode=all", "--steps=30", "--overwrite") == 0
        assert overlap(run, masks) > 0.9  # found anew
        (run / SEPARATED / "separation.json").unlink()
        assert main(["evaluate", str(run), "--data", str(tmp_path / "data"), "--spp", "1"]) == 2

    def test_prepare_looks_for_the_table_in_the_field_where_sparse_points_show_none(self, ball, monkeypatch):
        """Or for a wall: before what all points lie on, the object is cut from it."""
        (masks, photos, field), told_of = ball, []
        monkeypatch.setattr(capture_masks, "train_field", lambda *_, **__: field)
        found = capture_masks.find_masks(photos.root, SimpleNamespace(table=False), 0, False, told_of.append)
        found = [one for _, one in zip(masks, found)]  # as many as there are photos are asked for
        assert told_of[-1] == 1.0
        shares = [((a > 0.5) & b).sum() / ((a > 0.5) | b).sum() for (a, _), b in zip(found, masks)]
        assert np.mean(shares) > 0.9
        for i, ((_, picture), mask) in enumerate(zip(found, masks)):
            told = picture[..., 3] > 0
            assert (told & mask).sum() > 20 and (told & ~mask).sum() > 50
            floor = field.render(*view_rays(photos, i, (SIZE, SIZE)), 1, 1, hidden=lambda _: True).colour.numpy()
            assert np.abs(picture[..., :3] - floor.reshape(SIZE, SIZE, 3))[told].max() < 0.01

    def test_photos_in_other_units_of_radiance(self, ball, tmp_path, monkeypatch):
        """The field sees them at an exposure of 1 in the mean; the surroundings are in their units."""
        (_, photos, field), given, around = ball, [], []
        monkeypatch.setattr(separation, "train_field", lambda dataset, **_: given.append(dataset) or field)
        for factor in (1.0, 0.01):
            exposed = photos.exposed(factor * np.where(np.arange(len(photos)) % 2, 2.0, 0.5))
            separation.separate(exposed, exposed.select([0, 1]), tmp_path / "found", steps=1, minutes=0, seed=0)
            around.append(read_image(tmp_path / "found/surroundings.exr"))
        assert np.log(given[1].exposures).mean() == pytest.approx(0, abs=1e-9)
        np.testing.assert_allclose(given[1].exposures, given[0].exposures)
        np.testing.assert_allclose(given[1].images[:2], given[0].images[:2], atol=1e-6)
        np.testing.assert_allclose(around[1], around[0] * [100, 100, 100, 1], rtol=1e-2)

    def test_the_sheet_shows_photos_dark_around_the_object(self, ball, tmp_path):
        for path, mask in zip(ball[1].image_paths, ball[0]):
            write_image(tmp_path / separated_mask(path, ball[1].root), mask)
        separation.write_sheet(ball[1], tmp_path)
        tiles = read_image(tmp_path / "sheet.jpg").reshape(3, SIZE, 3, SIZE, 3).swapaxes(1, 2).reshape(9, SIZE, SIZE, 3)
        apart = np.abs(tiles[:8] - ball[1].images[..., :3] * np.where(ball[0], 1, 0.25)[..., None]).mean(-1)
        assert max(apart[np.stack(ball[0])].mean(), apart.mean()) < 0.03 and tiles[8].max() < 0.1

    def test_training_lowers_the_error(self, ball, monkeypatch):
        """From grey; by a rate that grows over a hundred steps and falls to 3 %; to the last step, the end of the time or NaN."""
        told, rates, grey = [], [], np.full((8, SIZE, SIZE, 4), 0.8, np.float32)
        step, run = torch.optim.Adam.step, lambda *now: told.append(now)
        monkeypatch.setattr(training, "RAYS", 128)
        monkeypatch.setattr(torch.optim.Adam, "step", lambda a: rates.append(a.param_groups[0]["lr"]) or step(a))
        for at, steps, minutes in (ball[1], 150, 0), (replace(ball[1], images=grey), 9, 1e-9):
            training.train_field(at, steps=steps, minutes=minutes, seed=0, report=run)
        psnr = [float(text.split()[3]) for _, text in told]
        assert psnr[149] > psnr[0] + 2 and [told[k][0] for k in (149, 150)] == [1, 1] and len(told) == 151
        assert rates[0:150:99] == pytest.approx([1e-4, 0.01 * 0.03**0.66]) and psnr[150] == pytest.approx(10.5, abs=2)
        monkeypatch.setattr(training, "SPREAD_WEIGHT", math.nan)
        with pytest.raises(RuntimeError, match="no longer finite at step 2"):
            training.train_field(ball[1], steps=5, minutes=0, seed=0, report=run)

    @pytest.mark.slow
    def test_the_trained_field_tells_the_ball_from_the_floor(self, tmp_path):
        masks, run = write_ball_on_floor(tmp_path / "data", 40), tmp_path / "run"
        assert train(tmp_path / "data", run, "--eval-mode=all", "--steps=30", "--set", "separation.steps=4000") == 0
        assert overlap(run, masks) > 0.8


class TestMasks:
    def test_specks_beside_the_object_go(self):
        """Parts below a hundredth of it; a faint bridge joins parts, and what is fainter stays everywhere; specks alone stay."""
        mask = np.full((40, 60), 0.05, np.float32)
        mask[5:35, 5:30], mask[10:20, 40:50], mask[6, 30:33], mask[6, 33] = 0.8, 1.0, 0.2, 1.0  # 754, 100 pixels
        mask[2, 30:38], mask[38, 30:37] = 1, 1
        cleaned = mask * ~((np.arange(40) == 38)[:, None] & (mask == 1))
        np.testing.assert_array_equal(finding.without_specks(mask), cleaned)
        assert not finding.without_specks(np.zeros((4, 5), np.float32)).any()
        np.testing.assert_array_equal(finding.without_specks(mask * (cleaned == 0)), mask * (cleaned == 0))

    @pytest.mark.parametrize("size, found", [((41, 55), (41, 55)), ((37, 93), (37, 93)), ((1000, 20), (800, 16))])
    def test_masks_of_odd_sizes(self, ball, size, found):
        odd = replace(ball[1], images=np.ones((8, *size, 4), np.float32), sizes=None)
        assert find_mask(ball[2], EVERYWHERE, odd, 0).shape == found

    def test_smaller_images_look_the_same_way(self, ball):
        photos = replace(ball[1], images=np.ones((8, 30, 40, 4), np.float32), sizes=None)
        assert [finding._size(photos, 0, n) for n in (1, 300, 5000)] == [(1, 1), (15, 20), (30, 40)]
        right, up, back = (view_rays(photos, 0, (10, 20))[1].numpy() @ photos.poses[0, :3, :3]).T.reshape(3, 10, 20)
        np.testing.assert_allclose(right / -back, (2 * np.arange(20)[None] + [[1 - 20]] * 10) / 40, atol=1e-5)
        np.testing.assert_allclose(up / back, (3 * np.arange(10)[:, None] + [1.5 - 20] * 20) / 40, atol=1e-5)

    def test_no_background_is_told_for_a_photo_that_shows_something_else(self, ball):
        """Somebody walks through the left half of it, or the field is wrong by more than a tenth."""
        (masks, photos, field), images = ball, np.array(ball[1].images)
        given, crossed = masks[1].astype(np.float32), np.where(np.arange(SIZE)[:, None] < SIZE // 2, 1 - images, images)
        others = (replace(photos, images=x) for x in (crossed, images + 0.12, images + 0.08))
        others = photos, replace(photos, exposures=0.5 * np.arange(8)), *others
        found, told = zip(*(with_background(field, EVERYWHERE, other, 1, given) for other in others))
        assert all(((mask > 0.5) == masks[1]).all() for mask in found)
        assert told[0][masks[1].sum(1).argmax(), :, 3].sum() == 16  # four pixels on both sides of both edges
        assert [bool(picture.any()) for picture in told] == [True, True, False, False, True]
        np.testing.assert_allclose(srgb_to_linear(told[1][..., :3]), 0.5 * srgb_to_linear(told[0][..., :3]), atol=1e-5)
        for share in np.zeros((SIZE, SIZE), np.float32), np.ones((SIZE, SIZE), np.float32):  # without it, filled by it
            mask, picture = with_background(RadianceField(), EVERYWHERE, photos, 0, share)
            assert np.array_equal(mask, share) and picture.shape == (SIZE, SIZE, 4) and not picture.any()

    def test_what_looks_unlike_its_background_belongs_to_the_mask_beside_it(self, ball):
        """A mask that lost a rim on one side, as where a mirror looks transparent, gets it back, and nothing else."""
        masks, photos, field = ball
        cut = masks[0] & (np.arange(SIZE) < np.flatnonzero(masks[0].any(axis=0)).max() - 4)
        mask = with_background(field, EVERYWHERE, photos, 0, cut.astype(np.float32))[0] > 0.5
        lost, extra = (masks[0] & ~mask).sum(), (mask & ~masks[0]).sum()
        assert (masks[0] & ~cut).sum() > 40 and lost < 6 and extra < 6

    def test_it_moves_to_where_the_colours_change(self):
        y, x = np.mgrid[:40, :40] + 0.5
        true = np.hypot(x - 20, y - 20) < 10
        noise = np.random.default_rng(0).normal(0, 0.02, (40, 40, 3))
        photo = np.where(true[..., None], [0.6, 0.3, 0.2], [0.4, 0.5, 0.5]) + noise
        moved = np.clip(11.5 - np.hypot(x - 20.5, y - 20), 0, 1)
        found = at_edges(moved.astype(np.float32), photo.astype(np.float32))
        assert (moved > 0.5).sum() > 1.1 * true.sum() and ((found > 0.5) == true).mean() > 0.99

    def test_no_farther_than_a_band(self):
        mask = np.zeros((40, 40), np.float32)
        mask[:, :20] = 1  # goes on beyond the photo's edges
        photo = np.where(np.arange(40)[None, :, None] < 30, 0.2, 0.8) * np.ones((40, 1, 3))
        found = at_edges(mask, photo.astype(np.float32))
        assert (found[:, :17] == 1).all() and (found[:, 23:] == 0).all() and found.shape == mask.shape
        assert all((at_edges(0 * mask + value, 0 * photo) == value).all() for value in (0, 1))

    @pytest.mark.parametrize("second, shares", [(0.0, (0.6, 0.2)), (1.0, (5 / 7, 1 / 7))])
    def test_cells_share_by_their_hints_and_colours(self, second, shares):
        """Two cells, tied by 1 or by 1/2: (1 + tie) x - tie y = 1 and (2 + tie) y = tie x; the third takes no part."""
        colours = np.array([0, second, 9])[None, :, None].repeat(3, 2)
        cells = np.array([[1.0, -2.0, 5.0]]), colours, np.array([[True, True, False]])
        for turned in cells, [np.swapaxes(x, 0, 1) for x in cells]:
            found = random_walk(*turned, np.log(2) / 4)
            np.testing.assert_allclose(found.ravel(), [*shares, 0], atol=2e-4)

    def test_points_are_where_half_of_the_light_is_gone(self):
        """At the last sample at the latest, whatever rounding leaves; no rays give none."""
        weights, distances = torch.zeros(3, 32), torch.arange(1.0, 33).expand(3, -1)
        weights[0, [0, 4, 9]], weights[1, [5, 31]] = torch.tensor([0.3, 0.3, 0.4]), torch.tensor([0.4, 0.6])
        field = SimpleNamespace(render=lambda *_, coloured: SimpleNamespace(weights=weights, distances=distances))
        points = finding._points(field, torch.ones(3, 3), torch.tensor([[0, 0, 1.0]] * 3))
        np.testing.assert_array_equal(points, [[1, 1, 6], [1, 1, 33], [1, 1, 33]])
        assert finding._points(field, torch.empty(0, 3), torch.empty(0, 3)).shape == (0, 3)

    def test_points_around_the_foot_have_the_photos_colours(self, ball):
        """Those that a photo shows from above where its rays meet the table within the object's reach and 0.2 more."""
        (_, photos, field), cells = ball, np.zeros((CELLS,) * 3, bool)
        cells[46:62, 44:52, 50:60] = (
            True  # their middle is at x = 0.2, their half edges 0.25 and 0.1167, their half diagonal 0.2759
        )
        floor = -field.shift[2] / field.scale
        for one in (photos.select([i, *others]) for i in range(8) for others in ([], [4, 4])):
            found = finding.points_near(field, one, Region(cells, Table(np.array([0.0, 0, 1]), floor)))
            o, d = (x.numpy() for x in view_rays(one, 0, (SIZE, SIZE)))
            x, y, _ = (o - (o[:, 2:] - floor) / d[:, 2:] * d).T
            near = (np.hypot(x - 0.2, y) < 0.4759) & (d[:, 2] < -min(0.4, 0.7 * np.median(one.poses[:, 2, 2])))
            distances = ball_on_floor(o * field.scale + field.shift, d)[1] / field.scale
            np.testing.assert_allclose(found[0][: near.sum()], (o + distances[:, None] * d)[near], atol=1e-4)
            np.testing.assert_array_equal(found[1][: near.sum()], one.images[0].reshape(-1, 4)[near, :3])

    def test_surroundings_are_known_where_points_show_them(self):
        """Four points beside the object tell a patch by half, sixteen fully; not where the field is clipped, nor those within."""
        cells = np.zeros((CELLS,) * 3, bool)
        cells[60:66, 48:54, 48:54] = True
        towards = np.float32([[0.98, 0.1, 0.05], [0.1, 0.98, 0.05], [0.1, 0.1, 0.95], [-0.009, -0.001, 0.001]])
        points = np.repeat(towards + np.float32([0.5, 0.1, 0.1]), [4, 16, 16, 16], axis=0)
        field, colours = SimpleNamespace(), torch.tensor([[0.96, 0.2, 0.2], [0.98, 0.2, 0.2]])
        field.render = lambda o, d, *_, hidden: SimpleNamespace(colour=colours[(d[:, 2] > 0.5).long()])
        around = finding.surroundings(field, Region(cells, None), points)
        assert (around[28:32, 60:64, 3] == 0.5).all() and (around[28:32, 32:36, 3] == 1).all()
        assert around.shape == (64, 128, 4) and around[..., 3].sum() == 16 * 1.5
        np.testing.assert_allclose(around[40, 0, :3], ((np.array([0.96, 0.2, 0.2]) + 0.055) / 1.055) ** 2.4, rtol=1e-4)


class TestFoot:
    TABLE, MIDDLE = Table(np.array([0.0, 0.6, 0.8]), -0.1), np.array([0.2, -0.15])

    def scene(self, height: float, noise: float, radius: float = 0.4, post=(0, 0.1), tint: float = 1.0):
        """Points of a table and of a round plinth on it, their colours, and points of a post between two radii."""
        random = np.random.default_rng(0)
        at = random.uniform(-0.8, 0.8, (300_000, 2))
        plinth, (inner, outer) = np.linalg.norm(at, axis=1), post
        over, plinth = (plinth > inner) & (plinth < outer), plinth < radius
        heights = np.where(plinth, height, 0.0) + random.normal(size=len(at)) * noise
        points = self.lifted(at, heights[:, None]).astype(float)
        colours = 0.5 + tint * np.where(plinth[:, None], -0.2, 0.3 * np.sin(40 * at[:, :1] + [0, 1, 2]))
        return points, colours, self.lifted(at[over], 0.3)

    def lifted(self, at: np.ndarray, height: float | np.ndarray) -> np.ndarray:
        return np.float32((at + self.MIDDLE) @ self.TABLE.axes + (self.TABLE.offset + height) * self.TABLE.normal)

    def over(self, radius: float, height: float) -> torch.Tensor:
        angle = np.linspace(0, 2 * np.pi, 60)
        return torch.from_numpy(self.lifted(radius * np.stack([np.cos(angle), np.sin(angle)], 1), height))

    @pytest.mark.parametrize(
        "scene, shown, held, others",
        [
            ((0.012, 0.012), (0, 1), [(0.2, 0), (0.38, 0.01)], [(0.42, 0.01), (0.7, 0), (5, 0)]),
            ((0.012, 0.003, 0.4, (0.25, 0.3)), (0.2, 1), [(0.1, 0), (0.3, 0)], []),
            ((0.0, 0.003, 0.4, (0, 0.35)), (0.3, 1), [(0.2, 0.05)], [(0.2, 0.01), (0.5, 0.05)]),
            ((0.012, 0.003), (0, 0.3), [(0.37, 0)], [(0.45, 0)]),
            ((0.03, 0.004, 0.13, (0, 0.1), 0), (0, 1), [(0.1, 0)], [(0.2, 0)]),
            ((0.0, 0.003), (0, 1), [], [(0.2, 0)]),
        ],
        ids=["lower than the noise", "not shown in its middle", "below an overhang", "sparse rim", "grey", "none"],
    )
    def test_feet(self, scene, shown, held, others):
        """What no photo shows within a foot is the foot's; below an overhang, points decide by their height."""
        points, colours, post = self.scene(*scene)
        radius = np.linalg.norm(points @ self.TABLE.axes.T - self.MIDDLE, axis=1)
        chosen = (radius > shown[0]) & ((radius < shown[1]) | (radius > 0.4) | (np.arange(len(points)) % 20 == 0))
        foot = find_foot(self.TABLE, points[chosen], colours[chosen], post)
        assert all(foot.holds(self.over(*at)).all() for at in held)
        assert not any(foot.holds(self.over(*at)).any() for at in others)

    def test_what_stands_apart_is_not_the_foot(self):
        points, colours, post = self.scene(0.012, 0.003)
        apart = np.linalg.norm(points @ self.TABLE.axes.T - self.MIDDLE - [0.6, 0.6], axis=1) < 0.1
        foot = find_foot(self.TABLE, points + apart[:, None] * 0.02 * self.TABLE.normal, colours, post)
        beside = torch.from_numpy(self.lifted(np.array([[0.6, 0.6]]), 0.0))
        assert foot.holds(self.over(0.2, 0.0)).all() and not foot.holds(beside).any()
        assert not find_foot(self.TABLE, *[np.zeros((0, 3))] * 3).holds(self.over(0.2, 0.0)).any()

    @pytest.mark.parametrize("light", [1.0, 0.3])
    @pytest.mark.parametrize("place, raised, held", [(0.36, -0.012, True), (0.44, 0.02, False)])
    def test_where_heights_are_wrong_colour_decides(self, place, raised, held, light):
        """A notch in the plinth's edge, and a bump of the table beside it; also in a shadow that falls on both."""
        points, colours, post = self.scene(0.012, 0.003)
        at = points @ self.TABLE.axes.T - self.MIDDLE
        colours = np.where(np.linalg.norm(at - [0.4, 0], axis=1)[:, None] < 0.15, light, 1) * colours
        wrong = (np.linalg.norm(at - [place, 0], axis=1) < 0.05) & ((np.linalg.norm(at, axis=1) < 0.4) == held)
        foot = find_foot(self.TABLE, points + wrong[:, None] * raised * self.TABLE.normal, colours, post)
        assert bool(foot.holds(torch.from_numpy(self.lifted(np.array([[place, 0.0]]), 0.005)))) == held
        assert foot.holds(self.over(0.3, 0.0)).all() and not foot.holds(self.over(0.5, 0.01)).any()

    def test_the_region_goes_by_its_foot_near_the_table(self):
        points, colours, post = self.scene(0.012, 0.006)
        column = post + np.linspace(0, 0.5, len(post))[:, None] * self.TABLE.normal
        table = Table.through(self.TABLE.normal, self.TABLE.offset, points)
        region = find_region(np.concatenate([points, *[column] * 2]), table)
        region = region.with_foot(np.float32(np.concatenate([points, column])), np.concatenate([colours, 0 * column]))
        assert region.holds(self.over(0.38, 0.01)).all() and region.holds(self.over(0.05, 0.4)).all()
        assert not region.holds(self.over(0.38, 0.2)).any() and not region.holds(self.over(0.42, 0.01)).any()
        assert not region.holds(self.over(0.1, -0.2)).any()
        up = self.TABLE.upward.expand(60, 3)
        assert all(region.stands_at(self.over(r, 1.0), -up).all() == (r < 0.4) for r in (0.1, 0.3, 0.5))
        assert not region.stands_at(self.over(0.1, 1.0), up).any() and not EVERYWHERE.stands_at(up, up).any()

    def test_what_seems_to_lie_below_the_table_is_on_it(self):
        region = Region(np.ones((CELLS,) * 3, bool), self.TABLE)
        o = torch.tensor([[0.0, 2, 2], [0.0, 2, 2], [0.0, -3, -3]])
        d = torch.tensor([[0.0, -0.6, -0.8], [0.0, 0.6, 0.8], [0.0, -0.6, -0.8]])
        found = region.above_table(o, d, torch.tensor([[1.0, 9.0]] * 3))
        torch.testing.assert_close(found, torch.tensor([[1.0, 2.9], [1.0, 9.0], [1.0, 9.0]]))
        assert torch.equal(EVERYWHERE.above_table(o, d, found), found)


class TestMirrors:
    def rays(self, width: float, top: float, bottom: float, n: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Along x, of n rows and columns."""
        y, z = torch.meshgrid(torch.linspace(-width, width, n), torch.linspace(top, bottom, n), indexing="xy")
        o = torch.stack([torch.full_like(y, 3.0), y, z], -1).reshape(-1, 3)
        return o, torch.tensor([[-1.0, 0, 0]]).expand(len(o), 3)

    CENTRES = ((np.indices((CELLS,) * 3) + 0.5) * (2 / CELLS) - 1) * 1.6
    SLAB = (np.abs(CENTRES[0]) < 0.03) & (np.abs(CENTRES[1]) < 0.8) & (CENTRES[2] > 0.2) & (CENTRES[2] < 0.9)

    def test_solid_cells_block_rays_above_a_table(self):
        o = torch.tensor([[3, 0, 0.5], [3, 1, 0.5], [3, 0, 0.3], [3, 0, 1.2], [-0.5, 0, 0.5], [2.4, 0, 2.3]])
        d = torch.tensor([[-1.0, 0, 0]] * 5 + [[-0.8, 0, -0.6]])
        for table, seen in (None, [True, False, True]), (Table(np.array([0.0, 0, 1]), 0.26), [True, False, False]):
            assert Region(self.SLAB, table, None, self.SLAB).blocks(o, d).tolist() == [*seen, False, False, True]

    def test_a_mask_gets_what_is_solid_but_no_rims(self):
        """Seen along x: the right half of the slab is missing from the mask, and a rim of four pixels on the left."""
        (o, d), mask = self.rays(1.0, 1.2, 0.0, 40), torch.zeros(80, 80)
        mask[22:64, 12:40] = 1
        found = with_mirrors(mask, Region(self.SLAB, None, None, self.SLAB), (40, 40), o, d)
        assert found[30:60, 42:68].min() == 1 and torch.equal(found[:, :12], mask[:, :12]) and found[:, 76:].max() == 0
        assert torch.equal(with_mirrors(mask, Region(np.zeros((CELLS,) * 3, bool), None), (40, 40), o, o), mask)

    @pytest.mark.parametrize("half_width, seen", [(0.5, True), (0.3, False)])
    def test_what_is_solid_is_looked_for_in_every_other_pixel(self, ball, half_width, seen):
        """A slab of 18 pixels, but not one of 10, that the field itself does not show."""
        photos = replace(ball[1], images=np.ones((8, SIZE, SIZE, 4), np.float32))
        corner, x, y, z = self.CENTRES.max(0) < -1.57, *np.abs(self.CENTRES)
        region = Region(corner, None, None, (x < 0.03) & (y < half_width) & (z < 0.6))
        assert find_mask(ball[2], region, photos, 0)[20].sum() == pytest.approx(16 * seen, abs=1)

    def test_a_few_lonely_solid_cells_beside_a_mask_are_fog(self):
        """However many pixels they cover; a slab of 12 x 21 cells beside them is not."""
        n, solid = 320, self.SLAB & (np.abs(self.CENTRES[1]) < 0.2)
        solid[CELLS // 2, 56:58, 63:65] = True
        region, (o, d) = Region(solid, None, None, solid), self.rays(0.35, 0.8, 0.3, n // 2)
        assert 7 < region.cell_pixels((n // 2, n // 2), o, d) < 8
        found = with_mirrors(torch.zeros(n, n), region, (n // 2, n // 2), o, d)
        assert region.blocks(o, d).view(n // 2, n // 2)[:, 140:].any()
        assert found[:, 90:230].min() == 1 and not found[:, 260:].any()
