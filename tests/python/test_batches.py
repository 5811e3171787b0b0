"""What a step draws beside its pixels: backgrounds, jitter, probes; by the run's generator alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import torch
from splitnerf.ops import EdgeRuns, read_pixels
from splitnerf.render.edges import EdgePixels
from splitnerf.render.rays import DrawnRays
from splitnerf.training.batches import draw_batch
from tiny_runs import tiny


def drawn(seed: int = 0, edges: EdgePixels | None = None, **settings):
    """A batch whose origins are 1, directions 2 and pixels 3, which are the first ones of three photos, exposed by 1, 2 and 3."""
    config = tiny(box=1.3, eikonal_points=4000, smoothness_points=3000, smoothness_radius=0.05, **settings)
    runs = EdgeRuns.none(torch.device("cpu")) if edges is None else edges.runs

    def draw(n: int, random: torch.Tensor, backgrounds: torch.Tensor, exposures: torch.Tensor) -> DrawnRays:
        assert random.shape == (n,) and 0 <= random.min() < 0.01 and 0.99 < random.max() < 1
        pixels, *beside = read_pixels(
            torch.full((n, 4), 3.0), torch.arange(n), torch.arange(n) % 3, exposures, backgrounds, runs
        )
        return DrawnRays(torch.full((n, 3), 1.0), torch.full((n, 3), 2.0), pixels, torch.arange(n) % 3, *beside)

    source = SimpleNamespace(generator=torch.Generator().manual_seed(seed), draw=draw)
    return draw_batch(source, 2000, config, torch.tensor([[1.0], [2.0], [3.0]]).repeat(1, 3))


def test_rays_and_pixels_are_those_of_the_source():
    batch = drawn()
    for found, columns, value in ((batch.rays_o, 3, 1.0), (batch.rays_d, 3, 2.0), (batch.target, 4, 3.0)):
        assert torch.equal(found, torch.full((2000, columns), value))
    assert batch.rays == (batch.rays_o, batch.rays_d, batch.jitter)
    assert torch.equal(batch.exposure, (batch.view + 1.0)[:, None].expand(2000, 3))


def test_what_is_drawn_fills_its_range():
    batch = drawn()
    assert batch.background.shape == (2000, 3) and batch.jitter.shape == (2000,)
    assert (batch.background[:, 0] != batch.background[:, 1]).all()
    for x in (batch.background, batch.jitter, batch.phase, batch.probes.chosen):
        assert 0 <= x.min() < 0.01 and 0.99 < x.max() < 1
    apart = torch.stack(
        [batch.jitter, batch.phase, *batch.background.T, batch.probes.chosen[:2000], *batch.probes.shifts[:2000].T]
    )
    assert (torch.corrcoef(apart) - torch.eye(9)).abs().max() < 0.1
    anywhere, shifts = batch.probes.anywhere, batch.probes.shifts
    assert anywhere.shape == (4000, 3) and -1.3 <= anywhere.min() < -1.29 and 1.29 < anywhere.max() <= 1.3
    assert batch.probes.chosen.shape == (3000,) and shifts.shape == (3000, 3)
    assert shifts.mean(0).abs().max() < 0.005
    torch.testing.assert_close(shifts.T.cov(), 0.05**2 * torch.eye(3), rtol=0, atol=0.1 * 0.05**2)


def test_whole_pixels_are_seen_before_what_lies_behind_them():
    """And all others before random colours, which do not change by that."""
    numbers, behind = torch.tensor([0, 7, 8, 1999]), np.arange(12, dtype=np.uint8).reshape(4, 3)
    runs = np.array([0, 7, 1999]), np.array([1, 9, 2000])
    batch, plain = drawn(edges=EdgePixels([(runs, behind)], 2000, torch.device("cpu"))), drawn()
    assert torch.equal(batch.whole.nonzero()[:, 0], numbers) and not plain.whole.any()
    torch.testing.assert_close(batch.background[numbers], torch.from_numpy(behind) / 255)
    assert torch.equal(batch.background[~batch.whole], plain.background[~batch.whole])


def test_without_smoothness_no_neighbours_are_drawn():
    probes = drawn(**{"losses.smoothness_weight": 0.0}).probes
    assert len(probes.anywhere) == 4000 and len(probes.chosen) == len(probes.shifts) == 0


def test_the_same_generator_draws_the_same():
    first, again, other = drawn(), drawn(), drawn(1)
    drawn_parts = [(batch.background, batch.jitter, *batch.probes) for batch in (first, again, other)]
    for a, b, c in zip(*drawn_parts):
        assert torch.equal(a, b) and not torch.equal(a, c)
