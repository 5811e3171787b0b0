"""wide_lobes and add_corrections."""

from __future__ import annotations

import pytest
import torch
from op_checks import check_error, check_op, generator, lib
from shading_inputs import correction_inputs, shaded_rays

from splitnerf.ops import add_corrections, wide_lobes

DIFFERENTIABLE = (0, 1)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_share_rises_smoothly_over_the_band(dtype):
    """t^2 (3 - 2 t); candidates may repeat, and those without a share are left out where all count."""
    roughness = torch.tensor([0.1, 0.3, 0.35, 0.45, 0.55, 0.6, 0.9], dtype=dtype)[:, None]
    candidates = torch.tensor([6, 0, 3, 1, 4, 3, 2, 5])
    t = ((roughness[candidates, 0] - 0.3) / 0.3).clamp(0, 1)
    expected = t * t * (3 - 2 * t)
    at, share = wide_lobes(candidates, roughness, 0.3, 0.6)
    assert at.tolist() == [6, 3, 4, 3, 2, 5]
    torch.testing.assert_close(share, expected[expected > 0], rtol=1e-5, atol=1e-6)
    for n in (0, 3, 8):
        at, share = wide_lobes(candidates, roughness, 0.3, 0.6, torch.tensor(n))
        assert torch.equal(at, candidates)
        torch.testing.assert_close(share, expected * (torch.arange(8) < n), rtol=1e-5, atol=1e-6)


def test_no_candidates():
    for n in (None, torch.tensor(0)):
        for k in (0, 5):
            at, share = wide_lobes(torch.zeros(0, dtype=torch.int64), torch.rand(k, 1), 0.3, 0.6, n)
            assert at.shape == share.shape == (0,)


def test_many_candidates_are_those_of_a_loop():
    roughness, candidates = torch.rand(500, 1, generator=generator()), torch.randint(500, (3000,), generator=generator(1))
    at, share = wide_lobes(candidates, roughness, 0.3, 0.45)
    assert at.tolist() == [i for i in candidates.tolist() if roughness[i] > 0.3]
    assert ((share > 0) & (share <= 1)).all() and (share == 1).any() and (share < 1).any()


def by_hand(mean, correction, at, shaded, ray_indices, segment, weights, opacity, least):
    mean = mean.clone()
    for k, added in zip(at.tolist(), correction):
        ray = ray_indices[shaded[k]]
        mean[ray] = mean[ray] + added * weights[segment == segment[k]].sum() / opacity[ray].clamp(min=least)
    return mean


def test_a_correction_counts_by_the_share_of_its_segment():
    inputs = correction_inputs()
    torch.testing.assert_close(add_corrections(*inputs), by_hand(*inputs), rtol=1e-12, atol=1e-12)
    *most, opacity, least = inputs
    clear = (*most, 1e-9 * opacity, 0.5)
    torch.testing.assert_close(add_corrections(*clear), by_hand(*clear), rtol=1e-12, atol=1e-12)


def test_gradients():
    inputs = correction_inputs()
    mean, correction = (x.clone().requires_grad_() for x in inputs[:2])
    assert torch.autograd.gradcheck(lambda a, b: add_corrections(a, b, *inputs[2:]), (mean, correction))
    for i, name in ((6, "weights"), (7, "opacity")):
        bad = [*inputs]
        bad[i] = bad[i].clone().requires_grad_()
        with pytest.raises(RuntimeError, match=f"no gradient to {name}"):
            add_corrections(*bad).sum().backward()


def test_operators():
    inputs = correction_inputs(torch.float32)
    check_op(lib.add_corrections, inputs, DIFFERENTIABLE)
    check_op(lib.add_corrections_backward, (*inputs[2:], torch.rand(4, 3)))
    check_op(lib.wide_lobes, (torch.tensor([2, 0]), torch.rand(3, 1), 0.0, 0.1, torch.tensor(1)))
    torch.library.opcheck(
        lib.wide_lobes, (torch.tensor([2, 0]), torch.rand(3, 1), 0.0, 0.1, None), test_utils=("test_schema", "test_faketensor")
    )


def test_nothing_to_add():
    none, mean = torch.zeros(0, dtype=torch.int64), torch.rand(4, 3, dtype=torch.float64)
    found = add_corrections(mean, mean[:0], none, *shaded_rays(), 1e-4)
    assert torch.equal(found, mean) and found is not mean
    empty = torch.zeros(0)
    assert add_corrections(torch.zeros(0, 3), torch.zeros(0, 3), none, none, none, none, empty, empty, 1e-4).shape == (0, 3)


def test_what_does_not_fit_is_named():
    roughness, inputs = torch.rand(3, 1), correction_inputs(torch.float32)
    two = torch.tensor([2, 0])
    for arguments, words in (
        ((two + 1, roughness, 0.3, 0.6, None), "candidates must hold numbers in [0, 3)"),
        ((two - 1, roughness, 0.3, 0.6, None), "candidates must hold numbers in [0, 3)"),
        ((two, roughness[:, 0], 0.3, 0.6, None), "roughness must be [n, 1] float32"),
        ((two, roughness, 0.6, 0.6, None), "low must be below high"),
        ((two, roughness, 0.3, 0.6, two), "n_candidates must be [] int64"),
    ):
        check_error(lambda arguments=arguments: lib.wide_lobes(*arguments), "wide_lobes", words)
    for i, bad, words in (
        (0, inputs[0][:3], "mean must be [4, 3] float32"),
        (1, inputs[1][:3], "correction must be [5, 3] float32"),
        (2, inputs[2] + 1, "at must hold numbers in [0, 150)"),
        (3, inputs[3] + 2, "shaded must hold numbers in [0, 300)"),
        (5, inputs[5][1:], "segment must be [150] int64"),
        (6, inputs[6].double(), "opacity must be [n] float64"),
        (8, 0.0, "min_opacity must be positive"),
    ):
        arguments = [*inputs]
        arguments[i] = bad
        check_error(lambda arguments=arguments: lib.add_corrections(*arguments), "add_corrections", words)
