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
from splitnerf.data.images import read_image, write_image
from splitnerf.data.normalisation import box_of_views, transform_points
from splitnerf.data.photos import separated_mask
from splitnerf.data.reading import SEPARATED, Reading
from splitnerf.errors import InputError
from splitnerf_tools.capture import masks as capture_masks
from splitnerf_tools.separation import separate as separation
from splitnerf_tools.separation import training
from splitnerf_tools.separation.field import RadianceField, Rendered
from splitnerf_tools.separation.foot import find_foot
from splitnerf_tools.separation.ground import Table, find_table
from splitnerf_tools.separation.masks import (
    _points,
    at_edges,
    find_mask,
    view_rays,
    with_background,
    with_mirrors,
    without_specks,
)
from splitnerf_tools.separation.region import CELLS, Region, find_region
from tiny_runs import train

SIZE, FOCAL = 40, 40.0
EVERYWHERE = Region(np.ones((CELLS,) * 3, bool), None)


class TestRegion:
    @pytest.fixture
    def points(self):
        """A ball of radius 0.3 that stands on a floor, and a post at its edge."""
        random = np.random.default_rng(0)
        ball = random.normal(size=(6000, 3))
        ball = 0.3 * ball / np.linalg.norm(ball, axis=1, keepdims=True)
        floor = np.column_stack([random.uniform(-1.4, 1.4, (30000, 2)), np.full(30000, -0.3)])
        post = np.array([0.75, 0, -0.3]) + random.uniform(0, 1, (900, 3)) * [0.1, 0.1, 0.3]
        return np.concatenate([ball, floor, post]) + random.normal(size=(36900, 3)) * 0.004

    @pytest.mark.parametrize("height", [0.0, -0.45], ids=["photos aim at the ball", "photos aim below its foot"])
    def test_the_floor_is_found(self, points, height):
        centre, up = np.array([0, 0, height]), np.array([0.1, 0, 0.995])
        normal, offset = find_table(points, centre, up, 3.0, np.random.default_rng(0))
        np.testing.assert_allclose(normal, [0, 0, 1], atol=2e-3)
        assert offset == pytest.approx(-0.3, abs=2e-3)

    def test_the_top_of_a_box_is_no_table(self):
        random = np.random.default_rng(0)
        top = np.column_stack([random.uniform(-0.3, 0.3, (9000, 2)), np.full(9000, 0.2)])
        side = np.column_stack([np.full(1000, 0.3), random.uniform(-0.3, 0.3, 1000), random.uniform(-0.2, 0.2, 1000)])
        assert find_table(np.concatenate([top, side]), np.zeros(3), np.array([0, 0, 1.0]), 3.0, random) is None

    def test_the_region_is_the_ball(self, points):
        region = find_region(points, Table.through(np.array([0.0, 0, 1]), -0.3, points))
        held = torch.tensor([[0.0, 0, 0.3], [0.3, 0, 0], [0, 0, 0]])
        others = torch.tensor([[0.0, 0, -0.3], [0.6, 0, -0.25], [0.8, 0.05, -0.15], [0, 0, 0.9]])
        assert region.holds(held).all() and not region.holds(others).any()
        torch.testing.assert_close(region.middle(), torch.zeros(3), atol=0.05, rtol=0)

    def test_nothing_in_the_middle(self):
        assert find_region(np.array([[3.0, 0, 0]] * 10), None) is None


def test_box_of_views():
    centre = np.array([5.0, -2, 1])
    around = np.array([[3, 0, 1], [0, 3, 1], [-3, 0, 2], [0, -3, 0.5]])
    poses = np.stack([look_at(centre + at, centre) for at in around])
    box = box_of_views(poses, np.tile([50.0, 30, 0, 0], (4, 1)), np.tile([40, 60], (4, 1)))
    np.testing.assert_allclose(box[:3, :3] @ centre + box[:3, 3], 0, atol=1e-6)
    assert 1 / box[0, 0] == pytest.approx(0.8 * np.median(np.linalg.norm(around, axis=1)) * 30 / 50)
    with pytest.raises(ValueError, match="all 4 cameras stand at one place"):
        box_of_views(poses[[0] * 4], np.full((4, 4), 50.0), np.full((4, 2), 40))


CENTRE, RADIUS = np.array([0, 0, 0.35]), 0.35


def pattern(points: np.ndarray, colour: list[float]) -> np.ndarray:
    """A colour, brighter and darker in tiles that do not repeat."""
    tiles = np.floor(4 * points) @ np.array([127.1, 311.7, 74.7])[: points.shape[-1]]
    return np.array(colour) * (0.5 + 0.5 * np.modf(np.abs(np.sin(tiles) * 43.7))[0][..., None])


def ball_on_floor(
    origins: np.ndarray, rays: np.ndarray, radius: float = RADIUS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
    lens = {"fl_x": FOCAL, "fl_y": FOCAL, "cx": SIZE / 2, "cy": SIZE / 2, "w": SIZE, "h": SIZE}
    (root / "transforms.json").write_text(json.dumps(lens | {"frames": frames}))
    return masks


def photos_of_ball(root) -> tuple[list[np.ndarray], Dataset]:
    """Eight photos without masks, and the true masks."""
    return write_ball_on_floor(root, 8), load_dataset(root, reading=Reading("all"), masked=False)


class TrueField:
    """The ball on its floor as a field that needs no training; the part that is hidden must be the ball."""

    def __init__(self, world_from_box: np.ndarray):
        self.scale, self.shift = world_from_box[0, 0], world_from_box[:3, 3]

    def render(self, rays_o, rays_d, n_first, n, jitter=False, hidden=None, coloured=True):
        origins, rays = rays_o.double().numpy() * self.scale + self.shift, rays_d.double().numpy()
        if hidden is not None:
            assert hidden(torch.from_numpy((CENTRE - self.shift) / self.scale).float())
        colour, t, _ = ball_on_floor(origins, rays, RADIUS if hidden is None else 0.0)
        weights = torch.zeros(len(rays), n)
        weights[:, 0] = 1
        distances = torch.from_numpy(t / self.scale).float()[:, None].expand(-1, n)
        return Rendered(torch.from_numpy(colour).float(), weights, distances, distances, weights, distances)


class TestReading:
    def test_photos_without_masks_are_refused_unless_allowed(self, tmp_path):
        write_ball_on_floor(tmp_path, 8)
        with pytest.raises(InputError, match="images: nothing says where the object is"):
            load_dataset(tmp_path, reading=Reading("all"))
        photos = load_dataset(tmp_path, reading=Reading("all"), masked=False)
        assert not photos.masked and (photos.images[..., 3] == 1).all()
        np.testing.assert_allclose(transform_points(photos.world_from_box, np.zeros(3)), [0, 0, 0.35], atol=0.01)

    @pytest.mark.parametrize("alpha", [False, True])
    def test_found_masks_are_read(self, tmp_path, alpha):
        masks = write_ball_on_floor(tmp_path / "data", 8, alpha=alpha)
        for i, mask in enumerate(masks):
            small = mask.reshape(SIZE // 2, 2, SIZE // 2, 2).mean((1, 3))
            name = separated_mask(tmp_path / f"data/images/p{i}.png", tmp_path / "data")
            write_image(tmp_path / "found" / name, small)
        photos = load_dataset(tmp_path / "data", reading=Reading("all", separated=tmp_path / "found"))
        assert photos.masked
        assert ((photos.images[..., 3] > 0.5) == np.stack(masks)).mean() > 0.98


def test_specks_beside_the_object_go():
    mask = np.zeros((40, 60), np.float32)
    mask[5:35, 5:30], mask[10:20, 40:50], mask[30:32, 50:52] = 0.8, 1.0, 1.0  # the object, its other part, a speck
    cleaned = mask * (np.arange(60) < 50)
    np.testing.assert_array_equal(without_specks(mask), cleaned)
    assert not without_specks(np.zeros((4, 5), np.float32)).any()
    np.testing.assert_array_equal(without_specks(mask * (cleaned == 0)), mask * (cleaned == 0))  # all there is


@pytest.mark.parametrize("size", [(41, 55), (37, 93)])
def test_masks_of_odd_sizes(tmp_path, size):
    _, photos = photos_of_ball(tmp_path)
    odd = replace(photos, images=np.ones((8, *size, 4), np.float32), sizes=None)
    assert find_mask(TrueField(photos.world_from_box), EVERYWHERE, odd, 0).shape == size


def overlap(run, masks: list[np.ndarray]) -> float:
    """The mean intersection over union of a run's found masks with the true ones."""
    found = [read_image(run / SEPARATED / f"images/p{i}.png")[..., 0] > 0.5 for i in range(len(masks))]
    return float(np.mean([(a & b).sum() / (a | b).sum() for a, b in zip(found, masks)]))


def test_from_photos_without_masks_to_an_asset(tmp_path, capsys, monkeypatch):
    """Trains with the masks by a field that is right, and scores the run again with them."""
    masks, run = write_ball_on_floor(tmp_path / "data"), tmp_path / "run"
    monkeypatch.setattr(separation, "train_field", lambda dataset, **_: TrueField(dataset.world_from_box))
    assert train(tmp_path / "data", run, "--eval-mode", "all", "--steps", "30") == 0
    assert overlap(run, masks) > 0.9
    assert (run / SEPARATED / "sheet.jpg").is_file() and (run / "mesh.glb").is_file()
    around = read_image(run / SEPARATED / "surroundings.exr")
    assert around.shape == (64, 128, 4) and np.abs(around[8, :, :3] - [0.214, 0.319, 0.787]).max() < 1e-3  # the sky
    assert around[36:48, :, 1].mean() > 2 * around[36:48, :, 0].mean() and around[36:48, :, 3].mean() > 0.6
    assert "above a table" in capsys.readouterr().err
    found = json.loads((run / SEPARATED / "ground.json").read_text())
    np.testing.assert_allclose([*found["normal"], found["offset"]], [0, 0, 1, 0], atol=0.01)
    assert main(["evaluate", str(run), "--data", str(tmp_path / "data"), "--spp", "1"]) == 0
    (run / SEPARATED / "images/p0.png").write_bytes(b"")
    again = "--eval-mode", "all", "--steps", "30", "--overwrite"
    assert train(tmp_path / "data", run, *again) == 0 and overlap(run, masks) > 0.9  # found anew
    (run / SEPARATED / "separation.json").unlink()
    assert main(["evaluate", str(run), "--data", str(tmp_path / "data"), "--spp", "1"]) == 2


def test_prepare_looks_for_the_table_in_the_field_where_sparse_points_show_none(tmp_path, monkeypatch):
    """Or for a wall: before what all points lie on, the object is cut from it."""
    masks = write_ball_on_floor(tmp_path)
    monkeypatch.setattr(capture_masks, "train_field", lambda dataset, **_: TrueField(dataset.world_from_box))
    told_of = []
    found = capture_masks.find_masks(tmp_path, SimpleNamespace(table=False), 0, False, told_of.append)
    found = [one for _, one in zip(masks, found)]  # as many as there are photos are asked for
    assert told_of[-1] == 1.0
    shares = [((a > 0.5) & b).sum() / ((a > 0.5) | b).sum() for (a, _), b in zip(found, masks)]
    assert np.mean(shares) > 0.9
    told = [picture[..., 3] > 0 for _, picture in found]
    assert all((part & b).sum() > 20 and (part & ~b).sum() > 50 for part, b in zip(told, masks))
    photos = load_dataset(tmp_path, reading=Reading("all"), masked=False)
    for i, (_, picture) in enumerate(found):
        rays_o, rays_d = (x.numpy() for x in view_rays(photos, i, (SIZE, SIZE)))
        world = rays_o * photos.world_from_box[0, 0] + photos.world_from_box[:3, 3]
        floor = ball_on_floor(world, rays_d, 0.0)[0].reshape(SIZE, SIZE, 3)
        assert np.abs(picture[..., :3] - floor)[told[i]].max() < 0.01


def test_no_background_is_told_for_a_photo_that_shows_something_else(tmp_path):
    """Somebody walks through the left half of it."""
    masks, photos = photos_of_ball(tmp_path)
    field = TrueField(photos.world_from_box)
    mask, alone = with_background(field, EVERYWHERE, photos, 0, masks[0].astype(np.float32))
    np.testing.assert_array_equal(mask > 0.5, masks[0])
    images = np.array(photos.images)
    images[0, :, : SIZE // 2, :3] = 1 - images[0, :, : SIZE // 2, :3]
    mask, crossed = with_background(field, EVERYWHERE, replace(photos, images=images), 0, masks[0].astype(np.float32))
    np.testing.assert_array_equal(mask > 0.5, masks[0])
    assert (alone[..., 3] > 0).sum() > 100 and not crossed.any()


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_photos_without_the_object_and_filled_by_it_tell_no_background(tmp_path, share):
    _, photos = photos_of_ball(tmp_path)
    given = np.full((SIZE, SIZE), share, np.float32)
    mask, picture = with_background(RadianceField(), EVERYWHERE, photos, 0, given)
    np.testing.assert_array_equal(mask, given)
    assert picture.shape == (SIZE, SIZE, 4) and not picture.any()


def test_what_looks_unlike_its_background_belongs_to_the_mask_beside_it(tmp_path):
    """A mask that lost a rim on one side, as where a mirror looks transparent, gets it back, and nothing else."""
    masks, photos = photos_of_ball(tmp_path)
    field = TrueField(photos.world_from_box)
    right = np.flatnonzero(masks[0].any(axis=0)).max()
    cut = masks[0] & (np.arange(SIZE) < right - 4)
    mask = with_background(field, EVERYWHERE, photos, 0, cut.astype(np.float32))[0] > 0.5
    lost, extra = (masks[0] & ~mask).sum(), (mask & ~masks[0]).sum()
    assert (masks[0] & ~cut).sum() > 40 and lost < 6 and extra < 6


def test_photos_in_other_units_of_radiance(tmp_path, monkeypatch):
    """The field sees them at an exposure of 1 in the mean; the surroundings are in their units."""
    write_ball_on_floor(tmp_path / "data")
    photos = load_dataset(tmp_path / "data", reading=Reading("all"), masked=False)
    given, around = [], []

    def train_field(dataset, **_):
        given.append(dataset)
        return TrueField(dataset.world_from_box)

    monkeypatch.setattr(separation, "train_field", train_field)
    for factor in (1.0, 0.01):
        exposed = photos.exposed(factor * np.where(np.arange(len(photos)) % 2, 2.0, 0.5))
        separation.separate(exposed, exposed.select([0, 1]), tmp_path / "found", steps=1, minutes=0, seed=0)
        around.append(read_image(tmp_path / "found/surroundings.exr"))
    assert np.log(given[1].exposures).mean() == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(given[1].exposures, given[0].exposures)
    np.testing.assert_allclose(given[1].images[:2], given[0].images[:2], atol=1e-6)
    np.testing.assert_allclose(around[1][..., :3], 100 * around[0][..., :3], rtol=1e-2)
    np.testing.assert_array_equal(around[1][..., 3], around[0][..., 3])


def test_training_lowers_the_error(tmp_path, monkeypatch):
    (_, dataset), told = photos_of_ball(tmp_path), []
    monkeypatch.setattr(training, "RAYS", 128)
    training.train_field(dataset, steps=150, minutes=0, seed=0, report=lambda share, text: told.append((share, text)))
    psnr = [float(text.split()[3]) for _, text in told]
    assert psnr[-1] > psnr[0] + 2 and told[-1][0] == 1 and len(told) == 150


def test_numbers_that_are_not_finite_end_it(tmp_path, monkeypatch):
    _, dataset = photos_of_ball(tmp_path)
    monkeypatch.setattr(training, "SPREAD_WEIGHT", math.nan)
    with pytest.raises(RuntimeError, match="no longer finite at step 2"):
        training.train_field(dataset, steps=5, minutes=0, seed=0, report=lambda share, text: None)


@pytest.mark.slow
def test_the_trained_field_tells_the_ball_from_the_floor(tmp_path):
    masks, run = write_ball_on_floor(tmp_path / "data", 40), tmp_path / "run"
    assert train(tmp_path / "data", run, "--eval-mode", "all", "--steps", "30", "--set", "separation.steps=4000") == 0
    assert overlap(run, masks) > 0.8


class TestFoot:
    TABLE = Table(np.array([0.0, 0.6, 0.8]), -0.1)

    def scene(self, height: float, noise: float, radius: float = 0.4):
        """Points of a table and of a round plinth on it, their colours, and points of the post on the plinth."""
        random = np.random.default_rng(0)
        at = random.uniform(-0.8, 0.8, (300_000, 2))
        plinth = np.linalg.norm(at, axis=1) < radius
        heights = np.where(plinth, height, 0.0) + random.normal(size=len(at)) * noise
        points = at @ self.TABLE.axes + (self.TABLE.offset + heights)[:, None] * self.TABLE.normal
        colours = np.where(plinth[:, None], [0.3, 0.3, 0.3], 0.5 + 0.3 * np.sin(40 * at[:, :1] + [0, 1, 2]))
        return points, colours, self.lifted(random.uniform(-0.1, 0.1, (500, 2)), 0.3)

    def lifted(self, at: np.ndarray, height: float) -> np.ndarray:
        return (at @ self.TABLE.axes + (self.TABLE.offset + height) * self.TABLE.normal).astype(np.float32)

    def over(self, radius: float, height: float) -> torch.Tensor:
        angle = np.linspace(0, 2 * np.pi, 60)
        return torch.from_numpy(self.lifted(radius * np.stack([np.cos(angle), np.sin(angle)], 1), height))

    def test_a_plinth_lower_than_the_noise_of_points_is_found(self):
        foot = find_foot(self.TABLE, *self.scene(0.012, 0.012))
        assert foot.holds(self.over(0.2, 0.0)).all() and foot.holds(self.over(0.38, 0.01)).all()
        assert not foot.holds(self.over(0.42, 0.01)).any() and not foot.holds(self.over(0.7, 0.0)).any()
        assert not foot.holds(self.over(5.0, 0.0)).any()

    def test_a_foot_of_the_tables_colour_is_found_by_its_height(self):
        points, colours, post = self.scene(0.03, 0.004, radius=0.13)
        foot = find_foot(self.TABLE, points, np.full_like(colours, 0.5), post)
        assert foot.holds(self.over(0.1, 0.0)).all() and not foot.holds(self.over(0.2, 0.0)).any()

    def test_what_no_photo_shows_within_the_foot_is_the_foots(self):
        points, colours, _ = self.scene(0.012, 0.003)
        radius = np.linalg.norm(points @ self.TABLE.axes.T, axis=1)
        shown = radius > 0.2
        post = points[(radius > 0.25) & (radius < 0.3)] + 0.3 * self.TABLE.normal
        foot = find_foot(self.TABLE, points[shown], colours[shown], post)
        assert foot.holds(self.over(0.1, 0.0)).all() and foot.holds(self.over(0.3, 0.0)).all()

    def test_a_sparse_rim_is_not_cut_off(self):
        points, colours, post = self.scene(0.012, 0.003)
        radius = np.linalg.norm(points @ self.TABLE.axes.T, axis=1)
        thin = (radius > 0.3) & (radius < 0.4) & (np.arange(len(points)) % 20 > 0)
        foot = find_foot(self.TABLE, points[~thin], colours[~thin], post)
        assert foot.holds(self.over(0.375, 0.0)).float().mean() > 0.9 and not foot.holds(self.over(0.45, 0.0)).any()

    def test_without_a_plinth_or_points_it_holds_nothing(self):
        for scene in (self.scene(0.0, 0.003), [np.zeros((0, 3))] * 3):
            assert not find_foot(self.TABLE, *scene).holds(self.over(0.2, 0.0)).any()

    def test_below_an_overhang_points_decide_by_their_height(self):
        """No photo shows the table within 0.3 from above; the object hangs over it."""
        points, colours, _ = self.scene(0.0, 0.003)
        shown = np.linalg.norm(points @ self.TABLE.axes.T, axis=1) > 0.3
        random = np.random.default_rng(1)
        hanging = random.uniform(-0.4, 0.4, (4000, 2))
        hanging = self.lifted(hanging[np.linalg.norm(hanging, axis=1) < 0.35], 0.3)
        foot = find_foot(self.TABLE, points[shown], colours[shown], hanging)
        assert foot.holds(self.over(0.2, 0.05)).all() and not foot.holds(self.over(0.2, 0.01)).any()
        assert not foot.holds(self.over(0.5, 0.05)).any()

    def test_what_stands_apart_is_not_the_foot(self):
        points, colours, post = self.scene(0.012, 0.003)
        apart = np.linalg.norm(points @ self.TABLE.axes.T - [0.6, 0.6], axis=1) < 0.1
        foot = find_foot(self.TABLE, points + apart[:, None] * 0.02 * self.TABLE.normal, colours, post)
        beside = torch.from_numpy(self.lifted(np.array([[0.6, 0.6]]), 0.0))
        assert foot.holds(self.over(0.2, 0.0)).all() and not foot.holds(beside).any()

    def test_heights_are_over_the_table_that_the_field_shows(self):
        """The field shows the table, and with it the plinth, deeper than the plane through the cameras' sparse points."""
        points, colours, post = self.scene(0.012, 0.003)
        shown = points - 0.006 * self.TABLE.normal
        table = Table.through(self.TABLE.normal, self.TABLE.offset, shown)
        assert table.offset == pytest.approx(self.TABLE.offset - 0.006, abs=2e-3) and table.height < 0.012
        foot = find_foot(table, shown, colours, post)
        assert foot.holds(self.over(0.38, 0.0)).all() and not foot.holds(self.over(0.42, 0.0)).any()

    @pytest.mark.parametrize("light", [1.0, 0.3])
    @pytest.mark.parametrize("place, raised, held", [(0.36, -0.012, True), (0.44, 0.02, False)])
    def test_where_heights_are_wrong_colour_decides(self, place, raised, held, light):
        """A notch in the plinth's edge, and a bump of the table beside it; also in a shadow that falls on both."""
        points, colours, post = self.scene(0.012, 0.003)
        at = points @ self.TABLE.axes.T
        colours = np.where(np.linalg.norm(at - [0.4, 0], axis=1)[:, None] < 0.15, light, 1) * colours
        wrong = (np.linalg.norm(at - [place, 0], axis=1) < 0.05) & ((np.linalg.norm(at, axis=1) < 0.4) == held)
        foot = find_foot(self.TABLE, points + wrong[:, None] * raised * self.TABLE.normal, colours, post)
        assert bool(foot.holds(torch.from_numpy(self.lifted(np.array([[place, 0.0]]), 0.005)))) == held
        assert foot.holds(self.over(0.3, 0.0)).all() and not foot.holds(self.over(0.5, 0.01)).any()

    def test_the_region_goes_by_its_foot_near_the_table(self):
        points, colours, post = self.scene(0.012, 0.006)
        column = post + np.linspace(0, 0.5, len(post))[:, None] * self.TABLE.normal
        region = find_region(
            np.concatenate([points, *[column] * 20]), Table.through(self.TABLE.normal, self.TABLE.offset, points)
        )
        shown = np.concatenate([points, column]).astype(np.float32)
        region = region.with_foot(shown, np.concatenate([colours, 0 * column]))
        assert region.holds(self.over(0.38, 0.01)).all() and region.holds(self.over(0.05, 0.4)).all()
        assert not region.holds(self.over(0.38, 0.2)).any() and not region.holds(self.over(0.42, 0.01)).any()
        assert not region.holds(self.over(0.1, -0.2)).any()

    def test_what_seems_to_lie_below_the_table_is_on_it(self):
        region = Region(np.ones((CELLS,) * 3, bool), self.TABLE)
        o, d = (
            torch.tensor([[0.0, 2, 2], [0.0, 2, 2], [0.0, -3, -3]]),
            torch.tensor([[0.0, -0.6, -0.8], [0.0, 0.6, 0.8], [0.0, -0.6, -0.8]]),
        )
        found = region.above_table(o, d, torch.tensor([[1.0, 9.0]] * 3))
        torch.testing.assert_close(found, torch.tensor([[1.0, 2.9], [1.0, 9.0], [1.0, 9.0]]))
        assert torch.equal(EVERYWHERE.above_table(o, d, found), found)


class TestOutline:
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

    @pytest.mark.parametrize("value", [0.0, 1.0])
    def test_without_an_edge(self, value):
        mask = np.full((8, 9), value, np.float32)
        np.testing.assert_array_equal(at_edges(mask, np.ones((8, 9, 3), np.float32)), mask)


class TestMirrors:
    def rays(self, width: float, top: float, bottom: float, n: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Along x, of n rows and columns."""
        y, z = torch.meshgrid(torch.linspace(-width, width, n), torch.linspace(top, bottom, n), indexing="xy")
        o = torch.stack([torch.full_like(y, 3.0), y, z], -1).reshape(-1, 3)
        return o, torch.tensor([[-1.0, 0, 0]]).expand(len(o), 3)

    def region(self, table: Table | None = None) -> Region:
        """A slab of solid cells at x = 0, |y| < 0.8, 0.2 < z < 0.9."""
        centres = ((np.indices((CELLS,) * 3) + 0.5) * (2 / CELLS) - 1) * 1.6
        solid = (np.abs(centres[0]) < 0.03) & (np.abs(centres[1]) < 0.8) & (centres[2] > 0.2) & (centres[2] < 0.9)
        return Region(solid, table, None, solid)

    def test_solid_cells_block_rays_above_a_table(self):
        o = torch.tensor([[3.0, 0, 0.5], [3.0, 1, 0.5], [3.0, 0, 0.3], [3.0, 0, 1.2], [-0.5, 0, 0.5]])
        d = torch.tensor([[-1.0, 0, 0]] * 5)
        assert self.region().blocks(o, d).tolist() == [True, False, True, False, False]
        assert self.region(Table(np.array([0.0, 0, 1]), 0.35)).blocks(o, d).tolist() == [True] + [False] * 4

    def test_a_mask_gets_what_is_solid_but_no_rims(self):
        """Seen along x: the right half of the slab is missing from the mask, and a rim of four pixels on the left."""
        n = 80
        o, d = self.rays(1.0, 1.2, 0.0, n // 2)
        mask = torch.zeros(n, n)
        mask[22:64, 12:40] = 1
        found = with_mirrors(mask, self.region(), (n // 2, n // 2), o, d)
        assert found[30:60, 42:68].min() == 1 and torch.equal(found[:, :12], mask[:, :12]) and found[:, 76:].max() == 0
        assert torch.equal(with_mirrors(mask, Region(np.zeros((CELLS,) * 3, bool), None), (n // 2, n // 2), o, o), mask)

    def test_a_lonely_solid_cell_beside_a_mask_is_fog(self):
        """However many pixels it covers; a slab of 12 cells beside it is not."""
        n, solid = 320, self.region().solid.numpy().copy()
        solid[:, abs(((np.arange(CELLS) + 0.5) * (2 / CELLS) - 1) * 1.6) > 0.2] = False
        solid[CELLS // 2, CELLS // 2 + 9, CELLS // 2 + 15] = True
        region, (o, d) = Region(solid, None, None, solid), self.rays(0.35, 0.8, 0.3, n // 2)
        assert 7 < region.cell_pixels((n // 2, n // 2), o, d) < 8
        seen = region.blocks(o, d).view(n // 2, n // 2)
        found = with_mirrors(torch.zeros(n, n), region, (n // 2, n // 2), o, d)
        assert seen[:, 140:].any() and found[:, 90:230].min() == 1 and not found[:, 260:].any()

    def test_cells_that_several_photos_show_are_solid(self):
        random = np.random.default_rng(0)
        wall = np.column_stack([random.normal(size=400) * 0.002, random.uniform(-0.3, 0.3, (400, 2))])
        lonely = np.column_stack([random.normal(size=400) * 0.002, random.uniform([-0.3, 0.3], [0.3, 0.5], (400, 2))])
        photos = [np.concatenate([wall, lonely if i == 3 else wall]) for i in range(4)]
        region = find_region(np.concatenate(photos), None, 4)
        o, d = torch.tensor([[3.0, 0.1, 0.1], [3.0, 0.1, 0.4]]), torch.tensor([[-1.0, 0, 0]] * 2)
        assert region.blocks(o, d).tolist() == [True, False] and region.holds(torch.tensor([[0.0, 0.1, 0.4]])).all()


def test_no_rays_give_no_points():
    assert _points(RadianceField(), torch.empty(0, 3), torch.empty(0, 3)).shape == (0, 3)
