"""The shape that a training starts from: depths by stereo, what they carve, and the surface that is held near it."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
import trimesh
from tiny_runs import tiny

from splitnerf.data.dataset import load_dataset
from splitnerf.fields import SdfField
from splitnerf.ops import HashGridSpec
from splitnerf.render import stereo
from splitnerf.synth.cameras import spiral
from splitnerf.training import loop
from splitnerf.training.loop import begin_training, train
from splitnerf.training.start import BEHIND, POINTS, StartShape, fit_to, side_loss

SIZE, VIEWS, BOX, CELLS = 80, 40, 1.5, 48


def open_box() -> trimesh.Trimesh:
    """A box from -0.6 to 0.6 with walls of 0.2, whose cavity of 0.8 x 0.8 x 1 is open above."""
    walls = [trimesh.creation.box(bounds=b) for b in (
        [[-0.6, -0.6, -0.6], [0.6, 0.6, -0.4]],
        [[-0.6, -0.6, -0.4], [-0.4, 0.6, 0.6]], [[0.4, -0.6, -0.4], [0.6, 0.6, 0.6]],
        [[-0.4, -0.6, -0.4], [0.4, -0.4, 0.6]], [[-0.4, 0.4, -0.4], [0.4, 0.6, 0.6]],
    )]  # fmt: skip
    return trimesh.util.concatenate(walls)


def texture(points: np.ndarray) -> np.ndarray:
    """[n] grey values in [0, 1] that vary over about a tenth of a unit."""
    waves = np.random.default_rng(1).normal(size=(12, 3)) * 18
    return 0.5 + 0.5 * np.tanh(np.sin(points @ waves.T + np.arange(12)).sum(1) / 2.5)


@pytest.fixture(scope="module")
def box_photos() -> tuple[stereo.GreyPhotos, torch.Tensor]:
    """Photos of the box, each pixel the texture where its ray hits, and the true depths [n, h, w]; 0 beside the box."""
    mesh, poses = open_box(), torch.from_numpy(spiral(VIEWS, 3.0, (20, 80))).float()
    focal = 0.5 * SIZE / math.tan(0.35)
    lens = torch.tensor([focal, focal, SIZE / 2, SIZE / 2])
    grey, depths = np.zeros((VIEWS, SIZE * SIZE), np.float32), np.zeros((VIEWS, SIZE * SIZE), np.float32)
    for i in range(VIEWS):
        rays_o, rays_d = (x.numpy() for x in stereo.image_rays(poses[i], lens, SIZE, SIZE))
        points, rays, _ = mesh.ray.intersects_location(rays_o, rays_d, multiple_hits=False)
        grey[i, rays], depths[i, rays] = texture(points), np.linalg.norm(points - rays_o[rays], axis=1)
    depths = torch.from_numpy(depths).view(VIEWS, SIZE, SIZE)
    photos = stereo.GreyPhotos(torch.from_numpy(grey).view_as(depths), depths > 0, poses, lens.expand(VIEWS, 4))
    return photos, depths


def hull() -> torch.Tensor:
    """[r, r, r] bool, cells in a closed box without a cavity: no outline shows the cavity."""
    axis = (torch.arange(CELLS) + 0.5) * (2 * BOX / CELLS) - BOX
    inside = axis.abs() < 0.62
    return inside[:, None, None] & inside[None, :, None] & inside[None, None, :]


@pytest.fixture(scope="module")
def found(box_photos) -> tuple[torch.Tensor, torch.Tensor]:
    """The depths of the box's photos and their scores."""
    return stereo.depth_maps(box_photos[0], hull(), BOX)


def test_stereo_finds_the_depths_of_a_textured_cavity(box_photos, found):
    depths, scores = found
    known = (scores > 0.7) & (box_photos[1] > 0)
    assert known.sum() > 0.4 * (box_photos[1] > 0).sum()
    error = (depths - box_photos[1])[known].abs()
    assert error.median() < 0.6 * stereo.STEP
    assert (error < stereo.AGREE).float().mean() > 0.8


def test_photos_agree_on_true_depths_and_not_on_wrong_ones(box_photos, found):
    known = box_photos[1] > 0
    _, wide = stereo.supporting_views(box_photos[0], box_photos[1], known)
    scattered = box_photos[1] + torch.randn(known.shape, generator=torch.Generator().manual_seed(0))
    _, wrong = stereo.supporting_views(box_photos[0], scattered, known)
    assert (wide[known] >= 3).float().mean() > 0.9
    assert (wrong[known] >= 3).float().mean() < 0.1


def test_depths_open_a_cavity_that_no_outline_shows(box_photos, found):
    depths, scores = found
    solid = stereo.solid_cells(box_photos[0], depths, scores > 0.5, hull(), BOX)
    cell = 2 * BOX / CELLS
    at = lambda *p: bool(solid[tuple(int((x + BOX) / cell) for x in p)])  # noqa: E731
    assert hull()[CELLS // 2, CELLS // 2, CELLS // 2]
    for empty in ((0.0, 0.0, 0.5), (0.0, 0.0, 0.0), (0.2, 0.2, 0.2), (0.0, 0.0, -0.25)):
        assert not at(*empty), empty
    for full in ((0.5, 0.0, 0.0), (0.0, -0.5, 0.3), (0.0, 0.0, -0.5)):
        assert at(*full), full


def test_without_depths_the_hull_stays(box_photos, found):
    none = torch.zeros_like(found[1], dtype=torch.bool)
    assert torch.equal(stereo.solid_cells(box_photos[0], found[0], none, hull(), BOX), hull())


def ball(radius: float, middle: tuple[float, float, float] = (0.0, 0.0, 0.0), n: int = CELLS) -> torch.Tensor:
    """[n, n, n] the true distances of a ball at the cells' centres."""
    axis = (torch.arange(n) + 0.5) * (2 * BOX / n) - BOX
    centres = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), -1)
    return (centres - torch.tensor(middle)).norm(dim=-1) - radius


def test_the_distance_of_cells_is_that_of_a_ball_within_a_cell():
    true = ball(0.8)
    near = true.abs() < 0.5
    assert (stereo.signed_distance(true < 0, BOX) - true)[near].abs().max() < 2 * BOX / CELLS


def shape_of_ball(n: int = CELLS) -> StartShape:
    points = torch.nn.functional.normalize(torch.randn(500, 3, generator=torch.Generator().manual_seed(0)), dim=1)
    return StartShape(ball(0.8, n=n), BOX, 0.8 * points, points)


def test_a_shape_is_read_where_it_is():
    middle = (0.3, -0.2, 0.1)
    places = torch.tensor(middle) + torch.tensor([[0.8, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.5]])
    shape = shape_of_ball()._replace(distance=ball(0.8, middle))
    assert torch.allclose(shape.at(places), torch.tensor([0.0, 0.2, -0.3]), atol=0.01)


def test_drawn_points_lie_on_the_sides_that_the_loss_expects():
    drawn = shape_of_ball().drawn(torch.Generator().manual_seed(1))
    distance = drawn.norm(dim=1) - 0.8
    assert len(drawn) == POINTS
    assert (distance[:BEHIND] < 0).all() and (distance[BEHIND:] > 0).all()
    assert side_loss(distance) == 0
    assert side_loss(-distance) > 0.02


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
    expected = train(load_dataset(data), tiny(**settings), whole)
    config = tiny(**settings)
    training = begin_training(load_dataset(data), config, part, torch.device("cpu"))
    assert training.take_step.start is not None
    while training.step < 4:
        training.refresh()
        training.advance(None)
    training.save()
    resumed = train(load_dataset(data), config, part, resume=True)
    for ours, theirs in zip(resumed.model.parameters(), expected.model.parameters()):
        assert torch.equal(ours, theirs)
