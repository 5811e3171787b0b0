"""hash_encode and hash_encode_jacobian."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import torch
from op_cases import HASH_SPEC, hash_gradients, hash_inputs
from op_checks import DEVICES, check_error, check_no_gradient, check_op, grad_leaves, lib

from splitnerf.ops import HashGrid, HashGridSpec, growth_for, hash_encode, hash_encode_jacobian


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("n_active", [0, 1, 3])
def test_matches_the_reference(device, n_active):
    positions, table, *_ = hash_inputs(device, torch.float64, 40)
    got = hash_encode(positions, table, HASH_SPEC, n_active)
    expected = reference.hash_encode(positions.cpu(), table.cpu(), *HASH_SPEC.arguments(n_active))
    np.testing.assert_allclose(got.cpu(), expected, atol=1e-14)


@pytest.mark.parametrize("device", DEVICES)
def test_float32_is_close_to_float64(device):
    single, double = (
        hash_encode_jacobian(*hash_inputs(device, t, 200)[:2], HASH_SPEC) for t in (torch.float32, torch.float64)
    )
    for got, expected in zip(single, double):
        torch.testing.assert_close(got.double(), expected, rtol=1e-4, atol=1e-4)
    again = hash_encode(*hash_inputs(device, torch.float32, 200)[:2], HASH_SPEC)
    torch.testing.assert_close(single[0], again, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("device", DEVICES)
def test_opcheck(device):
    for dtype in (torch.float32, torch.float64):
        inputs = hash_inputs(device, dtype)
        positions, table, *grid = inputs
        g, gj = hash_gradients(inputs)
        check_op(lib.hash_encode, inputs, (0, 1))
        check_op(lib.hash_encode_jacobian, inputs, (0, 1))
        check_op(lib.hash_encode_backward, (positions, g, *grid), (0, 1))
        check_op(lib.hash_encode_jacobian_backward, (positions, g, gj, *grid))
        check_op(lib.hash_encode_jacobian_backward_positions, (positions, table, g, gj, *grid))


@pytest.mark.parametrize("device", DEVICES)
def test_gradcheck(device):
    inputs = grad_leaves(hash_inputs(device, torch.float64), (0, 1))
    torch.autograd.gradcheck(lib.hash_encode, inputs)
    torch.autograd.gradgradcheck(lib.hash_encode, inputs)
    torch.autograd.gradcheck(lib.hash_encode_jacobian, inputs)


@pytest.mark.parametrize("device", DEVICES)
def test_jacobian_is_the_derivative_of_the_features(device):
    positions, table, *_ = grad_leaves(hash_inputs(device, torch.float64), (0,))
    features, jacobian = hash_encode_jacobian(positions, table, HASH_SPEC)
    for column in range(HASH_SPEC.n_outputs):
        (expected,) = torch.autograd.grad(features[:, column].sum(), positions, retain_graph=True)
        torch.testing.assert_close(jacobian[:, :, column], expected)


@pytest.mark.parametrize("device", DEVICES)
def test_missing_gradients_raise(device):
    inputs = hash_inputs(device, torch.float64)
    positions, table, *grid = inputs
    g, gj = hash_gradients(inputs)
    for index in range(3):
        check_no_gradient(lib.hash_encode_jacobian_backward, (positions, g, gj, *grid), index)
    for index in range(4):
        check_no_gradient(lib.hash_encode_jacobian_backward_positions, (positions, table, g, gj, *grid), index)
    leaves = grad_leaves(inputs, (0, 1))
    _, jacobian = lib.hash_encode_jacobian(*leaves)
    (first,) = torch.autograd.grad(jacobian.square().sum(), leaves[1], create_graph=True)
    with pytest.raises(RuntimeError, match="hash_encode_jacobian_backward: no gradient is defined"):
        first.sum().backward()


@pytest.mark.parametrize("device", DEVICES)
def test_empty_batch(device):
    positions, table, *grid = grad_leaves(hash_inputs(device, torch.float32, 0), (0, 1))
    features, jacobian = lib.hash_encode_jacobian(positions, table, *grid)
    assert features.shape == (0, 6) and jacobian.shape == (0, 3, 6)
    lib.hash_encode(positions, table, *grid).sum().backward()
    assert positions.grad.shape == (0, 3) and not table.grad.any()


@pytest.mark.parametrize("device", DEVICES)
def test_positions_outside_and_nan(device):
    _, table, *_ = hash_inputs(device, torch.float32)
    nan = float("nan")
    x = torch.tensor([[-1, 0.5, 0.5], [0, 0.5, 0.5], [nan, 0.5, 0.5], [2, 9, -7], [1, 1, 0]], device=device)
    features = hash_encode(x, table, HASH_SPEC)
    assert torch.equal(features[0], features[1]) and torch.equal(features[3], features[4])
    assert features[2].isnan().all() and not features[[0, 1, 3, 4]].isnan().any()


@pytest.mark.parametrize("device", DEVICES)
def test_errors_name_what_is_wrong(device):
    positions, table, *grid = hash_inputs(device, torch.float32)
    check_error(
        lambda: lib.hash_encode(positions[:, :2], table, *grid),
        "hash_encode",
        "positions",
        "[n, 3] float32",
        "[9, 2] float32",
    )
    check_error(
        lambda: lib.hash_encode(positions.double(), table, *grid), "hash_encode", "positions", "float32", "float64"
    )
    check_error(
        lambda: lib.hash_encode(positions, table[1:], *grid),
        "hash_encode",
        "table",
        str(HASH_SPEC.n_entries),
        str(HASH_SPEC.n_entries - 1),
    )
    check_error(
        lambda: lib.hash_encode(positions, table.long(), *grid),
        "hash_encode",
        "table",
        "float32, float64, float16 or bfloat16",
        "int64",
    )
    check_error(lambda: lib.hash_encode(positions, table[0], *grid), "hash_encode", "table", "[n_entries, n_features]")
    check_error(lambda: hash_encode(positions, table, HASH_SPEC, 4), "hash_encode", "n_active", "[0, n_levels]", "4")
    check_error(lambda: lib.hash_encode(positions, table, 33, 4, 1.5, 8, 2), "n_levels", "[1, 32]", "33")
    check_error(lambda: lib.hash_encode(positions, table, 3, 0, 1.5, 8, 2), "base_resolution", "0")
    check_error(lambda: lib.hash_encode(positions, table, 3, 4, 0.5, 8, 2), "growth", "0.5")
    check_error(lambda: lib.hash_encode(positions, table, 3, 4, 1.5, 31, 2), "log2_table_size", "[1, 30]", "31")
    check_error(lambda: lib.hash_encode(positions, table, 32, 16, 3.0, 8, 2), "finest level")
    check_error(
        lambda: hash_encode_jacobian(positions[None], table, HASH_SPEC),
        "hash_encode_jacobian",
        "positions",
        "[1, 9, 3]",
    )


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
    assert grid.jacobian(x)[1].shape == (5, 3, 6)


def test_growth_leads_to_the_finest_resolution():
    spec = HashGridSpec(n_levels=8, base_resolution=16, growth=growth_for(16, 512, 8))
    assert [spec.levels()[0][0], spec.levels()[-1][0]] == [16, 512]
