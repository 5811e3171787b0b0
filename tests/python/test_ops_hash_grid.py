"""hash_encode with tables of 16 bits, the module that holds a grid and its copy, and the field on one."""

import pytest
import torch
from op_cases import BOX, CASES, HASH_SPEC, SDF_SPEC, field_rays, full_cells, hash_inputs, sampling_settings
from op_checks import DEVICES, check_error, generator, lib
from splitnerf.fields.surface import SdfField
from splitnerf.ops import HashGrid, HashGridSpec, hash_encode
from splitnerf.ops.sdf import sample_rays

each_device = pytest.mark.parametrize("device", DEVICES)


IMPOSSIBLE = {"n_levels": (0, 33), "n_features": (3,), "base_resolution": (0, 2**40), "log2_table_size": (0, 64)}
IMPOSSIBLE |= {"growth": (0.9, float("nan"))}


@pytest.mark.parametrize(("name", "value"), [(name, x) for name, values in IMPOSSIBLE.items() for x in values])
def test_an_impossible_shape_raises(name, value):
    check_error(lambda: HashGridSpec(**{name: value}), "finest level" if value == 2**40 else name, "got")


def test_module_opens_levels_one_by_one():
    grid = HashGrid(HASH_SPEC, init_scale=1.0)
    x = torch.rand(5, 3)
    full = grid(x)
    assert grid.stored() is None
    grid.n_active = 1
    assert torch.equal(grid(x)[:, :2], full[:, :2]) and not grid(x)[:, 2:].any()


def exact_inputs(device, n: int = 200) -> tuple:
    """Positions and a table of multiples of 1/64 in [-1, 1], which float32 and float16 both have."""
    positions, table, *_ = hash_inputs(device, torch.float32, n)
    return positions, (table * 64).round() / 64


@each_device
def test_gradients_are_those_of_a_float32_table_of_these_numbers(device):
    positions, table = exact_inputs(device)
    found = []
    for learned, stored in ((table, None), (torch.full_like(table, 9), table.half())):
        leaves = positions.clone().requires_grad_(), learned.clone().requires_grad_()
        features = hash_encode(*leaves, HASH_SPEC, 2, stored)
        features.backward(torch.randn(features.shape, generator=generator(2)).to(device))
        found.append([leaf.grad for leaf in leaves])
    (expected_x, expected_table), (got_x, got_table) = found
    assert got_table.dtype == got_x.dtype == torch.float32
    tolerance = 0 if device == "cpu" else 1e-5  # atomic additions there
    torch.testing.assert_close(got_table, expected_table, rtol=tolerance, atol=tolerance)
    torch.testing.assert_close(got_x, expected_x, rtol=1e-5, atol=1e-4)


@each_device
def test_small_gradients_are_summed_in_float32(device):
    """256 of 1e-9, which float16 has no number for."""
    table = torch.zeros(HASH_SPEC.n_entries, 2, device=device, requires_grad=True)
    corner = torch.zeros(256, 3, device=device)
    (1e-9 * hash_encode(corner, table, HASH_SPEC, 1, table.detach().half()).sum()).backward()
    torch.testing.assert_close(table.grad[0], torch.full((2,), 256e-9, device=device), rtol=1e-4, atol=0)


@each_device
def test_no_gradient_is_rounded(device):
    positions, table, *grid = hash_inputs(device, torch.float32)
    leaf = table.half().requires_grad_()
    for arguments in ((leaf, *grid), (table, *grid, leaf)):
        with pytest.raises(RuntimeError, match="hash_encode: no gradient to"):
            lib.hash_encode(positions, *arguments).sum().backward()
        assert leaf.grad is None


def test_a_table_and_a_copy_of_other_dtypes_or_sizes_are_named():
    positions, table, *grid = hash_inputs("cpu", torch.float32)
    half, double, n = table.half(), table.double(), HASH_SPEC.n_entries
    for arguments, parts in (
        ((positions.double(), half, *grid), ("positions", "float32", "float64")),
        ((positions, half[1:], *grid), ("table", "float16", str(n - 1))),
        ((positions, table, *grid, table.bfloat16()), ("stored must be float16", "bfloat16")),
        ((positions.double(), double, *grid, half), ("stored", "beside a float32 table", "float64")),
        ((positions, table, *grid, half[1:]), ("stored", str(n), str(n - 1))),
    ):
        check_error(lambda: lib.hash_encode(*arguments), "hash_encode", *parts)
    doubles = [x.double() if isinstance(x, torch.Tensor) else x for x in CASES["sdf_values"](torch.float32)]
    check_error(lambda: lib.sdf_values(doubles[0], doubles[1].half(), *doubles[2:]), "sdf_values", "table", "float64")
    check_error(lambda: HashGrid(HASH_SPEC, table_dtype=torch.float64), "table_dtype", "float16", "float64")


def test_the_module_reads_a_copy_that_follows_the_parameter():
    grid, x = HashGrid(HASH_SPEC, 1.0, torch.float16), torch.rand(50, 3, generator=generator())
    assert list(grid.state_dict()) == ["table"] and grid.table.dtype == torch.float32

    def check():
        stored = grid.stored()
        assert stored.dtype == torch.float16 and torch.equal(stored, grid.table.detach().half())
        assert torch.equal(grid(x), hash_encode(x, stored, HASH_SPEC))
        return stored

    stored = check()
    first = stored.clone()
    assert check() is stored and torch.equal(stored, first)  # nothing was written
    optimiser = torch.optim.AdamW(grid.parameters(), lr=0.1, fused=True)
    grid(x).square().sum().backward()
    assert grid.table.grad.dtype == torch.float32
    optimiser.step()
    assert check() is stored and not torch.equal(stored, first)  # a recorded step reads this memory
    second = stored.clone()
    grid.load_state_dict({"table": torch.rand(HASH_SPEC.n_entries, 2)})
    assert not torch.equal(check(), second)
    grid.table = torch.nn.Parameter(torch.rand(HASH_SPEC.n_entries, 2))
    check()


def test_what_16_bits_cannot_hold_becomes_their_largest_number():
    grid = HashGrid(HASH_SPEC, table_dtype=torch.float16)
    beyond = [65504.0, 65519.9, 65520.0, 1e30, 3.4e38, float("inf"), 65504.0, 1e-30]
    with torch.no_grad():
        grid.table[:8, 0], grid.table[:8, 1] = torch.tensor(beyond), -torch.tensor(beyond)
        grid.table[8, 0] = float("nan")
    stored = grid.stored()[:9]
    assert stored[:8].isfinite().all() and stored[8, 0].isnan()
    assert stored[:8, 0].tolist() == [65504.0] * 7 + [0.0]
    assert torch.equal(stored[:8, 1], -stored[:8, 0])


def exact_field(table_dtype=None) -> SdfField:
    torch.manual_seed(0)
    field = SdfField(SDF_SPEC, BOX, table_dtype=table_dtype)
    with torch.no_grad():
        field.grid.table.copy_((torch.randn(field.grid.table.shape) * 16).round() / 64)
    return field


def test_the_field_reads_the_copy():
    plain, rounded = exact_field(), exact_field(torch.float16)
    assert rounded.network().table.dtype == torch.float16
    x = 3 * torch.rand(300, 3, generator=generator()) - 1.5
    with torch.no_grad():
        assert torch.equal(rounded.sdf(x), plain.sdf(x))
    a, b = rounded.sample(x), plain.sample(x)
    assert torch.equal(a.outputs, b.outputs) and torch.equal(a.gradient, b.gradient)
    torch.testing.assert_close(rounded.sdf(x), a.sdf)  # with gradients
    o, d, jitter = (t.float() for t in field_rays())
    samples = [
        sample_rays(o, d, jitter, full_cells(), field.network(), **sampling_settings()) for field in (rounded, plain)
    ]
    assert len(samples[0][0].t_starts) > 30
    for got, expected in zip((*samples[0][0], samples[0][1]), (*samples[1][0], samples[1][1])):
        assert torch.equal(got, expected)


def test_a_copy_made_without_autograd_serves_a_backward_pass():
    grid = HashGrid(HashGridSpec(n_levels=2, log2_table_size=8), table_dtype=torch.float16)
    x = torch.rand(5, 3)
    with torch.inference_mode():
        grid(x)
    grid(x).sum().backward()
    assert grid.table.grad.abs().sum() > 0
