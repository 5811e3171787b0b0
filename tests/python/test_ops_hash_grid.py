"""Positions outside of the cube, shapes that no grid has, and the module that holds a grid."""

from __future__ import annotations

import pytest
import torch
from op_cases import HASH_SPEC, hash_inputs
from op_checks import DEVICES, check_error

from splitnerf.ops import HashGrid, HashGridSpec, growth_for, hash_encode


@pytest.mark.parametrize("device", DEVICES)
def test_positions_outside_and_nan(device):
    _, table, *_ = hash_inputs(device, torch.float32)
    nan = float("nan")
    x = torch.tensor([[-1, 0.5, 0.5], [0, 0.5, 0.5], [nan, 0.5, 0.5], [2, 9, -7], [1, 1, 0]], device=device)
    features = hash_encode(x, table, HASH_SPEC)
    assert torch.equal(features[0], features[1]) and torch.equal(features[3], features[4])
    assert features[2].isnan().all() and not features[[0, 1, 3, 4]].isnan().any()


IMPOSSIBLE = [("n_levels", 0), ("n_levels", 33), ("n_features", 3), ("base_resolution", 0), ("growth", 0.9), ("growth", float("nan")),
              ("log2_table_size", 0), ("log2_table_size", 64), ("base_resolution", 2**40)]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), IMPOSSIBLE)
def test_an_impossible_shape_raises(name, value):
    check_error(lambda: HashGridSpec(**{name: value}), "finest level" if value == 2**40 else name, "got")


def test_module_opens_levels_one_by_one():
    grid = HashGrid(HASH_SPEC, init_scale=1.0)
    x = torch.rand(5, 3)
    full = grid(x)
    grid.n_active = 1
    assert torch.equal(grid(x)[:, :2], full[:, :2]) and not grid(x)[:, 2:].any()


def test_growth_leads_to_the_finest_resolution():
    spec = HashGridSpec(n_levels=8, base_resolution=16, growth=growth_for(16, 512, 8))
    assert [spec.levels()[0][0], spec.levels()[-1][0]] == [16, 512]
