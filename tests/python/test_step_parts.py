"""Parts of a step by hand: points beside samples, corrections of rays, wide lobes, probes, and the losses of materials."""

import pytest
import torch
from op_checks import generator, rand
from splitnerf.config import preset
from splitnerf.ops import PackedSamples, ShadingSubset
from splitnerf.render.model import wide_lobes
from splitnerf.render.renderer import MIN_OPACITY, ProbePoints, add_corrections, place_samples
from splitnerf.training.batches import make_probes, probe_counts
from splitnerf.training.losses import material_losses

# ---- points ----

RAYS = torch.tensor([[0.0, 0, 0], [10, 0, 0]]), torch.tensor([[1.0, 0, 0], [0, 1, 0]])
SAMPLES = PackedSamples(
    torch.tensor([0, 0, 1]), torch.tensor([1.0, 2, 3]), torch.tensor([2.0, 3, 4]), torch.tensor([0, 2, 3])
)
MIDDLES = [[1.5, 0, 0], [2.5, 0, 0], [10, 3.5, 0]]
ANYWHERE, SHIFTS = torch.tensor([[5.0, 5, 5]]), torch.tensor([[0.0, 0, 1], [0, 0, 2]])


def placed(samples: PackedSamples, chosen: list[float], padded: bool) -> tuple[list, torch.Tensor, list]:
    positions, directions, beside = place_samples(
        *RAYS, samples, ProbePoints(ANYWHERE, torch.tensor(chosen), SHIFTS), padded
    )
    return positions.tolist(), directions, beside.tolist()


def test_padding_repeats_the_first_samples_and_none_is_beside_it():
    positions, directions, beside = placed(SAMPLES.extended(4), [0.5, 0.99], True)
    assert positions == [*MIDDLES, *MIDDLES, MIDDLES[0], [5, 5, 5], [2.5, 0, 1], [10, 3.5, 2]]
    assert not directions[3:].any() and len(directions) == 7 and beside == [1, 2]


def test_without_samples_only_given_points_are_left():
    none = PackedSamples(*(x[:0] for x in SAMPLES[:3]), torch.zeros(3, dtype=torch.int64))
    positions, directions, beside = placed(none, [0.5, 0.99], False)
    assert positions == [[5, 5, 5]] and len(directions) == 0 and beside == []
    positions, directions, beside = placed(none.extended(2), [0.5, 0.99], True)
    assert positions == [[0, 0, 0], [0, 0, 0], [5, 5, 5], [0, 0, 1], [0, 0, 2]] and not directions.any()
    assert beside == [0, 0]


def test_probes_fill_the_cube_and_shifts_are_normal():
    """Each coordinate by its quantiles, no two related."""
    n = 40_000
    config = preset("cpu").replace(
        {
            f"constants.{name}": x
            for name, x in dict(eikonal_points=n, smoothness_points=n, smoothness_radius=0.5, box=1.3).items()
        }
    )
    chosen, random = (torch.rand(k, generator=generator(3), dtype=torch.float64) for k in probe_counts(config))
    anywhere, _, shifts = make_probes(config, chosen, random)
    shares = (torch.arange(n, dtype=torch.float64) + 0.5) / n
    for column, expected in ((anywhere, 2.6 * shares - 1.3), (shifts, 0.5 * 2**0.5 * torch.erfinv(2 * shares - 1))):
        inner = slice(n // 1000, -n // 1000)
        for x in column.T:
            torch.testing.assert_close(x.sort().values[inner], expected[inner], rtol=0, atol=0.05)
    assert (torch.corrcoef(torch.cat([anywhere, shifts], 1).T) - torch.eye(6)).abs().max() < 0.03


# ---- sums over directions ----


def test_a_correction_counts_by_the_share_of_its_segment():
    """Three rays of 100 samples with every second one shaded, in segments of 1 to 5; two samples of one ray are corrected."""
    shaded, rays = torch.arange(0, 300, 2), torch.arange(300) // 100
    segment = torch.repeat_interleave(torch.arange(50), torch.tensor([1, 2, 5, 3, 4]).repeat(10))
    shares, opacity, mean, correction = rand(150, seed=1), rand(4, seed=2), rand(4, 3), rand(5, 3, seed=4)
    opacity[2], at, none = 1e-9, torch.tensor([7, 120, 0, 9, 149]), torch.zeros(0)
    spread = ShadingSubset(shaded, none, none, none, none, torch.zeros(50), segment, none)
    expected = mean.clone()
    for k, added in zip(at.tolist(), correction):
        ray = rays[shaded[k]]
        expected[ray] += added * shares[segment == segment[k]].sum() / opacity[ray].clamp(min=MIN_OPACITY)
    torch.testing.assert_close(
        add_corrections(mean, correction, at, spread, rays, shares, opacity), expected, rtol=1e-12, atol=1e-12
    )


def test_the_share_of_wide_lobes_rises_smoothly_over_the_band():
    """t^2 (3 - 2 t); candidates may repeat, and those without a share are left out where all count."""
    roughness = torch.tensor([0.1, 0.3, 0.35, 0.45, 0.55, 0.6, 0.9])[:, None]
    candidates = torch.tensor([6, 0, 3, 1, 4, 3, 2, 5])
    t = ((roughness[candidates, 0] - 0.3) / 0.3).clamp(0, 1)
    expected = t * t * (3 - 2 * t)
    at, share = wide_lobes(candidates, roughness, 0.3, 0.6, None)
    assert at.tolist() == [6, 3, 4, 3, 2, 5]
    torch.testing.assert_close(share, expected[expected > 0], rtol=1e-5, atol=1e-6)
    for n in (0, 3, 8):
        at, share = wide_lobes(candidates, roughness, 0.3, 0.6, torch.tensor(n))
        assert torch.equal(at, candidates)
        torch.testing.assert_close(share, expected * (torch.arange(8) < n), rtol=1e-5, atol=1e-6)


# ---- materials ----


def test_metals_by_hand():
    """Eq. (18); a metal by halves; dark metals, but neither bright ones nor dielectrics; nothing costs nothing."""
    metallic, shares = torch.tensor([[1.0], [0.4]]), torch.tensor([0.5, 0.25])
    metal, binary, _ = material_losses(torch.ones(2, 3), metallic, shares)
    assert metal.item() == pytest.approx((0.5 + 0.25 * 0.16) / 0.75)
    assert binary.item() == pytest.approx(0.25 * 0.24 / 0.75)
    albedo = torch.tensor([[0.1, 0.2, 0.0], [0.5, 0.1, 0.1], [0.01, 0.01, 0.01]])
    dark = material_losses(albedo, torch.tensor([[1.0], [1.0], [0.0]]), torch.ones(3))[2]
    assert dark.item() == pytest.approx((1 - 0.2 / 0.4) / 3)
    assert not material_losses(torch.zeros(0, 3), torch.zeros(0, 1), torch.zeros(0)).any()
