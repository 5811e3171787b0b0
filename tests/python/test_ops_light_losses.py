"""light_prior: closed forms."""

from __future__ import annotations

import math

import pytest
import torch
from op_checks import generator

from splitnerf.ops import light_prior

SIZES = [16, 64, 256]


def test_a_light_of_one_colour_is_free_and_a_texel_costs_what_its_level_is_worth():
    light = torch.zeros(sum(SIZES), 3, dtype=torch.float64)
    light[:16] += torch.tensor([0.5, 0.0, -0.7])
    assert light_prior(light, SIZES).item() == pytest.approx(0, abs=1e-25)
    for texel, n in ((16, 64), (16 + 63, 64), (16 + 64, 256), (335, 256)):
        for change, cost in (([0.9] * 3, 0.81 / 0.75), ([0.9, 0.0, -0.9], 0.54 / 0.12)):
            changed = light.clone()
            changed[texel] += torch.tensor(change)
            assert light_prior(changed, SIZES).item() == pytest.approx(math.log1p(cost) / n, rel=1e-7)


def test_the_brightness_of_the_whole_light_has_no_gradient():
    light = 1.5 * torch.randn(sum(SIZES), 3, generator=generator(3), dtype=torch.float64)
    light.requires_grad_()
    light_prior(light, SIZES).backward()
    torch.testing.assert_close(light.grad[:16].sum(0), torch.zeros(3, dtype=torch.float64), rtol=0, atol=1e-15)
    assert light.grad[:16].abs().min() > 0 and light.grad[16:].abs().min() > 0
    with torch.no_grad():
        light[7, 1] = math.nan
    assert light_prior(light, SIZES).isnan()
