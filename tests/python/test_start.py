"""The shape that a training starts from: depths by stereo, what they carve, and the surface that is held near it."""

import contextlib
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from splitnerf.config import preset
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.fields import SdfField
from splitnerf.ops import HashGridSpec
from splitnerf.render import stereo
from splitnerf.training import loop, start
from splitnerf.training.loop import begun
from splitnerf.training.start import StartShape, exact_distances, fit_to, surface_depths
from splitnerf_tools.synth.rendering import spiral
from tiny_runs import tiny, train_scene

SIZE, VIEWS, BOX, CELLS = 80, 40, 1.5, 48


def open_box() -> trimesh.Trimesh:
    """A box from -0.6 to 0.6 with walls of 0.2, whose cavity of 0.8 x 0.8 x 1 is open above."""
    bounds = [[[-0.6, -0.6, -0.6], [0.6, 0.6, -0.4]]]
    bounds += [[[x, -0.6, -0.4], [x + 0.2, 0.6, 0.6]] for x in (-0.6, 0.4)]
    bounds += [[[-0.4, y, -0.4], [0.4, y + 0.2, 0.6]] for y in (-0.6, 0.4)]
    return trimesh.util.concatenate([trimesh.creation.box(bounds=b) for b in bounds])


def texture(points: np.ndarray, frequency: float = 18.0) -> np.ndarray:
    """[n] grey values in [0, 1] that vary over about two units by the frequency."""
    waves = np.random.default_rng(1).normal(size=(12, 3)) * frequency
    return 0.5 + 0.5 * np.tanh(np.sin(points @ waves.T + np.arange(12)).sum(1) / 2.5)


def photographed(
    n: int, size: int, frequency: float, mesh: trimesh.Trimesh | None = None, mirrored: float = 0.0
) -> tuple[stereo.GreyPhotos, torch.Tensor]:
    """n photos of the box or another mesh, each pixel the texture where its ray hits, and the true depths [n, h, w]; 0 beside it.
    `mirrored`: how far from there along the ray that a ball reflects the texture is."""
    mesh = open_box() if mesh is None else mesh
    poses = torch.from_numpy(spiral(n, 3.0, (20, 80))).float()
    focal = 0.5 * size / math.tan(0.35)
    lens = torch.tensor([focal, focal, size / 2, size / 2])
    grey, depths = np.zeros((n, size * size), np.float32), np.zeros((n, size * size), np.float32)
    for i in range(n):
        rays_o, rays_d = (x.numpy() for x in stereo.image_rays(poses[i], lens, size, size))
        points, rays, _ = mesh.ray.intersects_location(rays_o, rays_d, multiple_hits=False)
        outward = points / np.linalg.norm(points, axis=1, keepdims=True)
        reflected = rays_d[rays] - 2 * (rays_d[rays] * outward).sum(1, keepdims=True) * outward
        grey[i, rays] = texture(points + mirrored * reflected, frequency)
        depths[i, rays] = np.linalg.norm(points - rays_o[rays], axis=1)
    depths = torch.from_numpy(depths).view(n, size, size)
    photos = stereo.GreyPhotos(torch.from_numpy(grey).view_as(depths), depths > 0, poses, lens.expand(n, 4))
    return photos, depths


@pytest.fixture(scope="module")
def box_photos() -> tuple[stereo.GreyPhotos, torch.Tensor]:
    """Photos of the box, whose texture varies over a tenth of a unit, and the true depths."""
    return photographed(VIEWS, SIZE, 18.0)


def hull() -> torch.Tensor:
    """[r, r, r] bool, cells in a closed box without a cavity: no outline shows the cavity."""
    axis = (torch.arange(CELLS) + 0.5) * (2 * BOX / CELLS) - BOX
    inside = axis.abs() < 0.62
    return inside[:, None, None] & inside[None, :, None] & inside[None, None, :]


@pytest.fixture(scope="module")
def found(box_photos) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """The depths of the box's photos, their scores and their margins."""
    return stereo.depth_maps(box_photos[0], hull(), BOX)


def test_photos_are_compared_small_grey_and_within_their_masks():
    """Averaged by a whole factor of their shorter edge, with the lens of what is left; some evenly spread ones get depths."""
    images = np.full((5, 21, 33, 4), [0.2, 0.4, 0.9, 0.0], np.float32)
    images[:, :, :16, 3], images[:, :, 16, 3] = 1.0, 0.8  # 0.4 of the ninth block
    poses, lens = np.tile(np.eye(4, dtype=np.float32), (5, 1, 1)), np.tile(np.float32([40, 44, 16, 10]), (5, 1))
    poses[:, 0, 3] = np.arange(5)
    data = Dataset("a", Path(), "train", 1, images, poses, lens, list("abcde"), [Path()] * 5, np.eye(4))
    found = stereo.grey_photos(data, edge=10)
    columns = np.float32([0.5] * 8 + [0.2] + [0] * 7)
    np.testing.assert_allclose(found.grey, np.broadcast_to(columns, (5, 10, 16)), atol=1e-3)
    assert torch.equal(found.masks, torch.from_numpy(columns > 0.3).expand(5, 10, 16))
    assert found.intrinsics[0].tolist() == [20, 22, 8, 5] and found.spread(3).poses[:, 0, 3].tolist() == [0, 2, 4]


def test_photos_are_compared_with_those_at_a_fair_angle():
    """At most six, from 4 to 45 degrees away as seen from the origin, the nearest to 15 degrees first."""
    angle = torch.tensor([0.0, 2, 10, 16, 30, 44, 50, -13.5, -22, -35]).deg2rad()
    poses = torch.eye(4).repeat(10, 1, 1)
    poses[:, :3, 3] = 3 * torch.stack([angle.cos(), angle.sin(), 0 * angle], 1)
    assert [stereo._neighbours(poses, i) for i in (0, 6)] == [[3, 7, 2, 8, 4, 9], [4, 5, 3, 2]]


def test_stereo_finds_the_depths_of_a_textured_cavity(box_photos, found):
    depths, scores, _ = found
    known = (scores > 0.7) & (box_photos[1] > 0)
    assert known.sum() > 0.4 * (box_photos[1] > 0).sum()
    error = (depths - box_photos[1])[known].abs()
    assert error.median() < 0.6 * stereo.STEP
    assert (error < 0.06).float().mean() > 0.8


def test_depths_of_texture_stand_out_and_those_of_a_slow_gradient_do_not(box_photos, found):
    n_pixels = box_photos[0].masks.sum()
    assert (found[2] > start.MARGIN).sum() > (start.CLEAR_SHARE + 0.2) * n_pixels
    rows = torch.linspace(0.4, 0.6, SIZE)[:, None].expand(SIZE, SIZE)
    plain = box_photos[0]._replace(grey=rows * box_photos[0].masks)
    assert (stereo.depth_maps(plain, hull(), BOX)[2] > start.MARGIN).sum() < 0.5 * start.CLEAR_SHARE * n_pixels


@pytest.mark.parametrize("size", [199, 200])
def test_grain_that_large_photos_show_alone_opens_a_cavity(size, monkeypatch):
    """Photos of 50 pixels show a slow gradient only. Those of 200 pixels are asked, smaller ones are not."""
    rows = torch.linspace(0.4, 0.6, 50)[:, None].expand(50, 50)

    def sized(photos: object, device: torch.device, edge: int) -> stereo.GreyPhotos:
        n = min(edge, size)
        large = photographed(16, n, 60.0)[0]
        return large if n > 50 else large._replace(grey=rows * large.masks)

    monkeypatch.setattr(start, "grey_photos", sized)
    monkeypatch.setattr(start, "FINE_PASSES", start.FINE_PASSES[-1:])
    monkeypatch.setattr(start, "FULL_FINE", 0.7)  # this box has thick walls
    monkeypatch.setattr(start, "FOLLOWED_TRIED", 0.6)  # one pass of three leaves the surface beside its place
    shape = start.start_shape(SimpleNamespace(height=300, width=size), hull(), preset("cpu"))
    if size < 200:
        assert shape is None
        return
    places = torch.tensor([[0.0, 0.0, 0.5], [0.0, 0.0, 0.0], [0.0, 0.0, -0.3], [0.0, 0.0, -0.5], [0.5, 0.0, 0.0]])
    assert (shape.at(places) > 0).tolist() == [True, True, True, False, False]


def test_a_solid_object_begins_with_a_sphere_however_clear_its_depths(monkeypatch):
    block = trimesh.creation.box(bounds=[[-0.6] * 3, [0.6] * 3])
    photos = photographed(24, 50, 18.0, block)[0]
    assert (stereo.depth_maps(photos, hull(), BOX)[2] > start.MARGIN).sum() > start.CLEAR_SHARE * photos.masks.sum()
    monkeypatch.setattr(start, "grey_photos", lambda *_: photos)
    assert start.start_shape(SimpleNamespace(height=50, width=50), hull(), preset("cpu")) is None


@pytest.mark.parametrize("mirrored", [False, True])
def test_what_a_mirror_shows_is_no_surface(mirrored, monkeypatch):
    """Surroundings 1 away in a ball look like surfaces in it, but not like one, which a short run has no time to try. The box's
    cavity is one."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.6)
    what = (24, 50, 6.0, ball, 1.0) if mirrored else (24, 50, 18.0)
    photos = photographed(*what)[0]
    assert (stereo.depth_maps(photos, hull(), BOX)[2] > start.MARGIN).sum() > start.CLEAR_SHARE * photos.masks.sum()
    monkeypatch.setattr(start, "grey_photos", lambda *_: photos)
    monkeypatch.setattr(start, "PASSES", start.PASSES[1:4] + start.PASSES[5:])
    monkeypatch.setattr(start, "FULL", 0.7)  # this box has thick walls
    ask = lambda **run: start.start_shape(SimpleNamespace(height=50, width=50), hull(), preset("cpu").replace(run))
    shape = ask()
    assert (shape is None or not shape.is_sure) == mirrored
    monkeypatch.setattr(start, "FOLLOWED_TRIED", 0.0)
    assert (ask(**{"run.max_minutes": 1.0}) is None) == mirrored


def test_windows_that_follow_a_surface_find_it_more_precisely(box_photos, found):
    photos, true = box_photos
    beside = torch.where(true > 0, true + 0.05, 0.0)
    depths, scores = stereo.refined_depths(photos, beside, 0.1, 0.02)
    assert ((depths - beside).abs()[scores > 0] < 0.09).all()  # the outermost are no result
    known = (scores > 0.7) & (true > 0)
    assert known.sum() > 0.5 * (true > 0).sum()
    error = (depths - true)[known].abs()
    first = (found[0] - true)[(found[1] > 0.7) & (true > 0)].abs()
    assert error.median() < 0.004
    assert error.median() < 0.5 * first.median()


def test_a_photo_does_not_count_where_its_own_surface_hides_the_point(box_photos):
    """All neighbours see something 0.5 in front of the surface: none is left to compare with."""
    photos, true = box_photos
    in_front = torch.where(true > 0, true - 0.5, 0.0)
    in_front[0] = true[0]
    shares = [
        (stereo.refined_depths(photos, base, 0.1, 0.02)[1][0][photos.masks[0]] > 0.3).float().mean()
        for base in (true, in_front)
    ]
    assert shares[0] > 0.8 and shares[1] < 0.1


def test_depths_open_a_cavity_that_no_outline_shows(box_photos, found):
    depths, scores, _ = found
    weights = torch.where((depths > 0) & (scores > 0.5), scores, 0.0)
    solid = stereo.fused_distances(box_photos[0], depths, weights, hull(), BOX, 0.12)[0] < 0
    assert hull()[CELLS // 2, CELLS // 2, CELLS // 2]
    empty = torch.tensor([[0.0, 0.0, 0.5], [0.0, 0.0, 0.0], [0.2, 0.2, 0.2], [0.0, 0.0, -0.25]])
    full = torch.tensor([[0.5, 0.0, 0.0], [0.0, -0.5, 0.3], [0.0, 0.0, -0.5]])
    for places, expected in ((empty, False), (full, True)):
        cells = ((places + BOX) / (2 * BOX / CELLS)).long()
        assert (solid[tuple(cells.T)] == expected).all()


def test_true_depths_make_the_true_walls(box_photos):
    photos, true = box_photos
    distances, trust = stereo.fused_distances(photos, true, (true > 0).float(), hull(), BOX, 0.08)
    shape = StartShape(distances, trust, BOX)
    height = torch.linspace(-0.3, 0.5, 9)
    x = torch.tensor([0.35, 0.5, 0.65])  # before the wall, within it and behind it
    places = torch.stack(torch.meshgrid(x, torch.zeros(1), height, indexing="ij"), -1)
    before, within, behind = shape.at(places.view(-1, 3)).view(3, -1)
    assert (before > 0.02).all() and (within < -0.03).all() and (behind > 0.02).all()
    assert (trust[distances.abs() < 0.04] > 0.9).all()


def test_a_jump_between_two_pixels_empties_nothing_behind_the_nearer_surface():
    """A camera looks down from z = 3 on two planes, one 2 and one 3 away, whose edge passes beside a cell's centre."""
    pose, lens = torch.eye(4)[None].clone(), torch.tensor([[110.0, 110.0, 40.0, 40.0]])
    pose[0, 2, 3] = 3.0
    depths = torch.where(torch.arange(SIZE) < 42, 2.0, 3.0).expand(1, SIZE, SIZE)
    photo = stereo.GreyPhotos(torch.zeros_like(depths), depths > 0, pose, lens)
    everywhere = torch.ones(CELLS, CELLS, CELLS, dtype=torch.bool)
    distances, trust = stereo.fused_distances(photo, depths, torch.ones_like(depths), everywhere, BOX, 0.08)
    behind, in_front, beside = (24, 24, 39), (24, 24, 44), (20, 24, 39)  # 0.03 behind the nearer plane, 0.28 before it
    assert distances[behind] < -0.0799 and trust[behind] == 0
    assert distances[in_front] > 0.07 and trust[in_front] > 0.99
    assert -0.06 < distances[beside] < -0.02 and trust[beside] > 0.99


def test_a_photo_says_nothing_of_what_it_does_not_show(box_photos):
    """Photos that are cut in the middle of the box leave its other half as it was."""
    photos, true = box_photos
    half = stereo.GreyPhotos(photos.grey[:1], photos.masks[:1], photos.poses[:1], photos.intrinsics[:1])
    known = torch.where(torch.arange(SIZE) < SIZE // 2, (true[:1] > 0).float(), 0.0)[..., : SIZE // 2]
    _, trust = stereo.fused_distances(half, true[:1, :, : SIZE // 2], known, hull(), BOX, 0.08)
    points = hull().nonzero() * (2 * BOX / CELLS) + BOX / CELLS - BOX
    in_camera = (points - photos.poses[0, :3, 3]) @ photos.poses[0, :3, :3]
    column = photos.intrinsics[0, 2] - photos.intrinsics[0, 0] * in_camera[:, 0] / in_camera[:, 2]
    assert (trust[hull()][column > SIZE // 2 + 1] == 0).all()
    assert (trust[hull()][column < SIZE // 2 - 1] > 0).any()


def test_without_depths_what_was_known_stays(box_photos, found):
    none, photos = torch.zeros_like(found[1]), box_photos[0]
    distances, trust = stereo.fused_distances(photos, found[0], none, hull(), BOX, 0.12)
    assert torch.equal(distances < 0, hull())
    assert (trust == 0).all()
    before = ball(0.4)
    distances, _ = stereo.fused_distances(photos, found[0], none, hull(), BOX, 0.12, before)
    assert torch.allclose(distances[hull()], before.clamp(-0.12, 0.12)[hull()])


def ball(radius: float, middle: tuple[float, float, float] = (0.0, 0.0, 0.0), n: int = CELLS) -> torch.Tensor:
    """[n, n, n] the true distances of a ball at the cells' centres."""
    axis = (torch.arange(n) + 0.5) * (2 * BOX / n) - BOX
    centres = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), -1)
    return (centres - torch.tensor(middle)).norm(dim=-1) - radius


def test_the_surface_of_a_ball_stands_where_rays_meet_it(box_photos):
    photos = box_photos[0]
    depths = surface_depths(ball(0.8).clamp(-0.1, 0.1), BOX, photos)
    middle = depths[:, SIZE // 2 - 1 : SIZE // 2 + 1, SIZE // 2 - 1 : SIZE // 2 + 1]
    assert (middle - (3.0 - 0.8)).abs().max() < 0.01
    assert (depths[:, 0, 0] == 0).all()


def test_truncated_distances_become_those_of_the_ball_and_crumbs_go():
    true = ball(0.8)
    crumb = torch.minimum(true, ball(0.1, (1.2, 1.2, 1.2)))
    found = exact_distances(crumb.clamp(-0.1, 0.1), BOX)
    near = true.abs() < start.NEAR_CELLS * 2 * BOX / len(true)
    assert (found - true)[near].abs().max() < 0.02
    assert (found - true).abs().max() < 0.8 * 2 * BOX / len(true)


def shape_of_ball(n: int = CELLS) -> StartShape:
    return StartShape(ball(0.8, n=n), torch.ones(n, n, n), BOX)


def test_a_field_is_held_where_the_photos_are_sure_and_within_half_a_cell():
    shape = shape_of_ball()
    points = torch.tensor([[0.9, 0.0, 0.0], [-0.9, 0.0, 0.0]])
    sure = torch.where(torch.arange(CELLS)[:, None, None] < CELLS // 2, 0.05, 0.8).expand_as(shape.trust)
    unsure = StartShape(shape.distance, sure, BOX)
    true = shape.at(points)
    for held, cells, expected in ((shape, 0.4, [0.0, 0.0]), (shape, -1.5, [1.0, 1.0]), (unsure, 1.5, [1.0, 0.01])):
        left = held.left(true + cells * shape.cell, points)
        assert torch.allclose(left, shape.cell * torch.tensor(expected), atol=1e-6)


def test_a_field_takes_a_shape():
    torch.manual_seed(0)
    field, shape = SdfField(HashGridSpec(4, 2, 16, 1.47, 14), BOX), shape_of_ball()
    fit_to(field, shape, torch.Generator().manual_seed(0), tiny(steps=1000))
    near = (shape.distance.abs() < 0.2).nonzero()
    positions = (near + 0.5) * shape.cell - BOX
    assert (field.sdf(positions) - shape.at(positions)).abs().mean() < 0.01


def test_a_held_run_resumes_with_the_same_bits(data, tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "start_shape", lambda *_: shape_of_ball(16))  # the tiny photos are too few
    settings = {"surface.start": "stereo", "deterministic": True, "steps": 100}
    whole, part = tmp_path / "whole", tmp_path / "part"
    for run in (whole, part):
        run.mkdir()
    expected = train_scene(load_dataset(data), tiny(**settings), whole)
    config = tiny(**settings)
    training = begun(load_dataset(data), config, part, torch.device("cpu"))
    assert training.take_step.start is not None
    while training.step < 4:
        training.refresh()
        training.advance(None)
    training.save()
    resumed = train_scene(load_dataset(data), config, part, resume=True)
    for ours, theirs in zip(resumed.model.parameters(), expected.model.parameters()):
        assert torch.equal(ours, theirs)


def test_in_half_a_minute_no_photos_are_compared(data, tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "start_shape", lambda *_: pytest.fail("photos are compared"))
    config = tiny(**{"surface.start": "stereo", "run.max_minutes": 0.5})
    assert begun(load_dataset(data), config, tmp_path, torch.device("cpu")).step == 0


@pytest.mark.parametrize(("radius", "of_sphere"), [(0.7, 1.3), (1.3, 0.7)])
def test_photos_choose_between_an_unsure_shape_and_a_sphere(data, tmp_path, monkeypatch, radius, of_sphere):
    """What they show is about a ball of radius 0.7."""
    shape = StartShape(ball(radius, n=16), torch.zeros(16, 16, 16), BOX, is_sure=False)
    monkeypatch.setattr(loop, "start_shape", lambda *_: shape)
    config = tiny(**{"surface.start": "stereo", "steps": 400, "sphere_radius": of_sphere})
    training = begun(load_dataset(data), config, tmp_path, torch.device("cpu"))
    assert (training.take_step.start is shape) == (radius == 0.7)
    assert training.step == 60 and training.run == tmp_path and not list(tmp_path.iterdir())


class Scripted:
    """A training whose photos have these decibels, each for 200 steps."""

    def __init__(self, psnrs, config, run):
        self.psnrs, self.config, self.run, self.observer, self.step = psnrs, config, run, None, 0
        self.log, self.take_step = SimpleNamespace(), SimpleNamespace(running=contextlib.nullcontext)
        self.started, self.refresh, self.settle = 0.0, lambda: None, lambda: None

    def advance(self, _):
        self.log.psnr = self.psnrs[self.step // 200]
        self.step += 1


@pytest.mark.parametrize(
    ("leads", "time_for", "is_kept", "steps"),
    [
        ([1.3, 1.2, 0.1, 0.1, -0.5], 2000, False, 500),  # a wrong shape leads at first
        ([1.0, 1.0, 0.9, 0.6, 0.4], 2000, False, 1000),
        ([-0.6, 0.8, 0.1, 0.0, -0.2], 2000, True, 1000),
        ([0.3, 1.8, 1.5, 1.5, 1.5], 2000, True, 500),
        ([-0.7, -0.7, -1.5, -1.5, -1.5], 2000, False, 500),
        ([0.2, 0.4, 0.4, 0.3, 0.3], 800, True, 800),
        ([0.2, 0.4, 0.4, 0.1, 0.1], 800, False, 800),
        ([2.0, 2.0, 2.0, 2.0, 2.0], 300, False, 300),
    ],
)
def test_a_trial_ends_with_a_sure_lead_or_sees_more(leads, time_for, is_kept, steps, tmp_path, monkeypatch):
    minutes = time_for / (60 * loop.TRIED_SHARE)
    config = tiny(steps=20_000, **{"run.max_minutes": minutes, "refinement.enabled": False})
    sphere, other = (Scripted([20.0 + x for x in each], config, tmp_path) for each in ([0.0] * 5, leads))
    monkeypatch.setattr(loop, "time", SimpleNamespace(monotonic=lambda: float(other.step)))
    assert (loop.better_of(sphere, other) is other) == is_kept
    assert other.step == sphere.step == steps
