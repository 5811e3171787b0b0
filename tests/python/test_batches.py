"""What a step draws beside its pixels: backgrounds, jitter, probes; by the run's generator alone."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import torch
from tiny_runs import tiny

from splitnerf.training.batches import draw_batch


def drawn(seed: int = 0):
    config = tiny(box=1.3, eikonal_points=4000, smoothness_points=3000, smoothness_radius=0.05)
    source = SimpleNamespace(generator=torch.Generator().manual_seed(seed), draw=lambda n: (torch.zeros(n, 3),) * 2 + (torch.zeros(n, 4),))
    return draw_batch(source, 2000, config)


def test_what_is_drawn_fills_its_range():
    batch = drawn()
    assert batch.background.shape == (2000, 3) and batch.jitter.shape == (2000,)
    assert (batch.background[:, 0] != batch.background[:, 1]).all()
    for x in (batch.background, batch.jitter, batch.probes.chosen):
        assert 0 <= x.min() < 0.01 and 0.99 < x.max() < 1
    anywhere, shifts = batch.probes.anywhere, batch.probes.shifts
    assert anywhere.shape == (4000, 3) and -1.3 <= anywhere.min() < -1.29 and 1.29 < anywhere.max() <= 1.3
    assert shifts.shape == (3000, 3) and shifts.std().item() == pytest.approx(0.05, rel=0.05)


def test_the_same_generator_draws_the_same():
    first, again, other = drawn(), drawn(), drawn(1)
    for part in ("background", "jitter"):
        assert torch.equal(getattr(first, part), getattr(again, part)) and not torch.equal(getattr(first, part), getattr(other, part))
    assert torch.equal(first.probes.shifts, again.probes.shifts)
