"""sdf_field, sdf_values, and sample_rays: what it keeps against all samples, and thin parts."""

import math

import op_cases
import pytest
import torch
from op_cases import (
    BOX,
    CASES,
    HASH_SPEC,
    STEP,
    bumpy_field,
    field_rays,
    full_cells,
    hash_inputs,
    sdf_field_inputs,
    unit,
)
from op_checks import DEVICES, check_error, generator, grad_leaves, lib, on_threads
from splitnerf.fields.surface import SdfField
from splitnerf.ops import HashGrid, HashGridSpec, hash_encode, march_rays, surface_weights
from splitnerf.ops.rays import CELL_EMPTY
from splitnerf.ops.sdf import SdfNetwork, sample_rays


def sampled(field, rays: tuple, cells: torch.Tensor | None = None, **settings) -> tuple:
    """The samples of a field or of its network, the numbers of distances asked for, and the number of samples found."""
    network = field if isinstance(field, SdfNetwork) else field.network()
    settings = op_cases.sampling_settings(**settings)
    return sample_rays(*rays, full_cells() if cells is None else cells, network, **settings)


def depth_between(f, f_next, s: float):
    """Of an interval whose ends have these distances: log Phi(f) - log Phi(f_next), at least 0."""
    log_phi = torch.nn.functional.logsigmoid
    return (log_phi(s * f) - log_phi(s * f_next)).clamp(min=0)


def stretches(field, samples, origins, directions, s: float, anneal: float = 1.0) -> torch.Tensor:
    """The weight that a sample or its successor may have: by the slope between them, or of what may lie between."""
    middle = 0.5 * (samples.t_starts + samples.t_ends)
    x = origins[samples.ray_indices] + directions[samples.ray_indices] * middle[:, None]
    f, apart = field.sdf(x).detach(), middle.diff()
    slope = (f.diff() / apart).clamp(-1, 1)
    half = -0.5 * STEP * ((0.5 - 0.5 * slope) * (1 - anneal) + torch.relu(-slope) * anneal)
    between = depth_between(f[:-1], torch.minimum(f[1:], (f[:-1] + f[1:] - apart) / 2), s)
    drawn = torch.maximum(depth_between(f[:-1] - half, f[:-1] + half, s), depth_between(f[1:] - half, f[1:] + half, s))
    tau, passed = torch.maximum(between, drawn), depth_between(f[:-1], f[1:], s)
    depth, weights = 0.0, torch.zeros(len(x), dtype=torch.float64)
    for i in range(len(x) - 1):
        if samples.ray_indices[i + 1] != samples.ray_indices[i]:
            depth = 0.0
            continue
        weights[i] = math.exp(-depth) * -math.expm1(-tau[i])
        depth += passed[i].item()
    return weights


@pytest.mark.parametrize("anneal", [0.0, 0.4, 1.0])
def test_keeps_the_neighbours_that_may_weigh(anneal):
    field, (o, d, jitter) = bumpy_field(), field_rays()
    samples = march_rays(o, d, jitter, full_cells(), box=BOX, step=STEP)
    weights = stretches(field, samples, o, d, 60.0, anneal)
    heavy = weights > 0.01
    wanted = heavy | torch.cat([torch.tensor([False]), heavy[:-1]])
    kept, evaluated, _ = sampled(field, (o, d, jitter), anneal=anneal)
    assert int(evaluated.sum()) == len(weights)
    assert torch.equal(kept.ray_indices, samples.ray_indices[wanted])
    torch.testing.assert_close(kept.t_starts, samples.t_starts[wanted])
    torch.testing.assert_close(kept.t_ends - kept.t_starts, torch.full_like(kept.t_starts, STEP))
    counts = torch.bincount(kept.ray_indices, minlength=len(o))
    assert torch.equal(kept.offsets, torch.cat([torch.zeros(1, dtype=torch.int64), counts.cumsum(0)]))
    assert 0.03 < wanted.double().mean() < 0.5


def test_far_from_the_surface_it_asks_less_and_keeps_the_same():
    field, rays = bumpy_field(), field_rays()
    with torch.no_grad():  # a field whose gradient is bounded by 1
        x = 3 * torch.rand(4000, 3, generator=generator(), dtype=torch.float64) - 1.5
        bound = field.sample(x).gradient.norm(dim=1).max().item() * 1.1
    everything, all_points, _ = sampled(field, rays)
    some, points, _ = sampled(field, rays, reach=8 / 60.0, lipschitz=bound)
    assert torch.equal(some.ray_indices, everything.ray_indices)
    torch.testing.assert_close(some.t_starts, everything.t_starts)
    assert points.sum() < 0.5 * all_points.sum()


def test_a_ray_ends_where_nothing_gets_through():
    field, (o, d, jitter) = bumpy_field(), field_rays()
    whole, all_points, _ = sampled(field, (o, d, jitter), min_weight=0.0)
    ended, points, _ = sampled(field, (o, d, jitter), min_weight=0.0, min_transmittance=1e-3)
    assert points.sum() < 0.8 * all_points.sum()
    assert len(ended.t_starts) < len(whole.t_starts)
    lost = whole_opacity(field, whole, o, d) - whole_opacity(field, ended, o, d)
    assert -1e-12 < lost.min() and lost.max() < 1e-3


def whole_opacity(field, samples, origins, directions) -> torch.Tensor:
    """[n_rays] 1 - exp(-depth) between the middles of neighbouring samples."""
    middle = 0.5 * (samples.t_starts + samples.t_ends)
    f = field.sdf(origins[samples.ray_indices] + directions[samples.ray_indices] * middle[:, None]).detach()
    same = samples.ray_indices[1:] == samples.ray_indices[:-1]
    depth = torch.zeros(len(origins), dtype=torch.float64)
    return -torch.expm1(-depth.index_add(0, samples.ray_indices[:-1], same * depth_between(f[:-1], f[1:], 60.0)))


def left_out(field, s: float, anneal: float = 1.0, lipschitz: float = 1.25) -> tuple[torch.Tensor, torch.Tensor]:
    """The weights [n] that surface_weights gives to all samples, those kept set to 0, and their sums [n_rays]."""
    o, d, jitter = field_rays()
    samples = march_rays(o, d, jitter, full_cells(), box=BOX, step=STEP)
    at = o[samples.ray_indices] + d[samples.ray_indices] * (0.5 * (samples.t_starts + samples.t_ends))[:, None]
    there = field.sample(at)
    sharp = torch.tensor(s, dtype=torch.float64)
    _, weights, _ = surface_weights(
        there.sdf.detach(), there.gradient.detach(), d, sharp, samples.offsets, step=STEP, anneal=anneal
    )
    kept, _, _ = sampled(field, (o, d, jitter), s=s, anneal=anneal, min_weight=1e-3, reach=7.0 / s, lipschitz=lipschitz)
    lattice = lambda some: some.ray_indices * 100000 + (some.t_starts / STEP * 8).round().long()
    faint = torch.where(torch.isin(lattice(samples), lattice(kept)), 0.0, weights)
    return faint, torch.zeros(len(o), dtype=torch.float64).index_add(0, samples.ray_indices, faint)


@pytest.mark.parametrize("anneal", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("s", [15.0, 60.0, 400.0])
def test_what_is_left_out_weighs_little(s, anneal):
    """A sample at most a few times min_weight, as far as the field's slope is not 1; a ray no more than its faint tails."""
    faint, of_rays = left_out(bumpy_field(0.005), s, anneal)
    assert 0 < faint.max() < 4e-3
    assert of_rays.max() < 0.02 and of_rays.mean() < 5e-3


def test_where_the_field_is_steeper_than_promised_the_walk_goes_back():
    o, d, _ = field_rays()
    with torch.no_grad():
        steepest = bumpy_field().sample(o - d * (o * d).sum(1, keepdim=True)).gradient.norm(dim=1).max()
    faint, _ = left_out(bumpy_field(), 400.0, lipschitz=1.0)
    assert steepest > 1.5 and faint.max() < 4e-3


def test_empty_cells_are_not_asked():
    samples, evaluated, _ = sampled(bumpy_field(), field_rays(), torch.full_like(full_cells(), CELL_EMPTY))
    assert len(samples.t_starts) == 0 and int(evaluated.sum()) == 0


def test_neither_side_of_empty_cells_is_kept():
    """Rays that pass a ball of radius 0.7 by 0.25 and more: where cells are empty the distance does not fall to the surface."""
    o = torch.tensor([[-1.4, 0.95, 0.0], [-1.4, 0.0, 1.0], [0.0, -1.4, -0.97]], dtype=torch.float64)
    d, jitter = unit(torch.tensor([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])).double(), torch.rand(3).double()
    middles = (torch.arange(48) + 0.5) / 48 * 2 * BOX - BOX
    far = torch.stack(torch.meshgrid(middles, middles, middles, indexing="ij")).norm(dim=0) > 1.15
    cells = torch.where(far, full_cells(48), CELL_EMPTY)
    kept, evaluated, _ = sampled(bumpy_field(0.0), (o, d, jitter), cells)
    assert (evaluated > 20).all() and len(kept.t_starts) == 0


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_room_cuts_the_samples_or_is_filled_up(dtype):
    """Cut samples are those of the last rays, and no offset points behind the capacity."""
    field, rays = bumpy_field().to(dtype), field_rays(30, dtype)
    free, asked, found = sampled(field, rays)
    n = len(free.t_starts)
    assert int(found) == n > 60
    for capacity in (1, n - 5, n, n + 7, 3 * n + 1):
        samples, evaluated, found = sampled(field, rays, capacity=capacity)
        assert int(found) == n and torch.equal(evaluated, asked)
        assert torch.equal(samples.offsets, free.offsets.clamp(max=capacity))
        for ours, all_ in zip(samples[:3], free[:3]):
            assert torch.equal(ours, torch.nn.functional.pad(all_, (0, 2 * n + 1))[:capacity])
    empty = torch.full_like(full_cells(), CELL_EMPTY)
    samples, _, found = sampled(field, rays, empty, capacity=9)
    assert int(found) == 0 and not samples.offsets.any() and not any(x.any() for x in samples[:3])
    assert all(len(x) == 9 for x in samples[:3])


def test_a_nan_is_kept_for_the_loss_to_see():
    network = bumpy_field().network()._replace(out_bias=torch.full((13,), math.nan, dtype=torch.float64))
    samples, evaluated, _ = sampled(network, field_rays(8))
    assert len(samples.t_starts) == int(evaluated.sum()) > 0


# ---- sdf_field ----

LEARNED = range(1, 8)  # the arguments to which there is a gradient


def gradients(function, inputs: tuple) -> tuple[tuple, list[torch.Tensor]]:
    """The outputs, and the gradients of a sum with drawn weights."""
    leaves = grad_leaves(inputs, LEARNED)
    outputs = function(*leaves)
    total = sum(
        (torch.randn(x.shape, generator=generator(i), dtype=torch.float64) * x).sum() for i, x in enumerate(outputs)
    )
    return outputs, list(torch.autograd.grad(total, leaves[1:8]))


def test_field_reads_the_copy_of_the_table():
    inputs = sdf_field_inputs(70, torch.float32)
    stored = inputs[1].half()
    got = gradients(lambda *x: lib.sdf_field(*x, stored), inputs)
    expected = gradients(lib.sdf_field, (inputs[0], stored.float(), *inputs[2:]))
    for a, b in zip([*got[0], *got[1]], [*expected[0], *expected[1]]):
        assert torch.equal(a, b)
    for a, b in zip(lib.sdf_field(inputs[0], stored, *inputs[2:]), expected[0]):
        assert torch.equal(a, b)
    leaf = stored.clone().requires_grad_()
    with pytest.raises(RuntimeError, match="no gradient to stored"):
        lib.sdf_field(*inputs, leaf)[0].sum().backward()
    with pytest.raises(RuntimeError, match="no gradient to a table of"):
        lib.sdf_field(inputs[0], leaf, *inputs[2:])[0].sum().backward()
    with pytest.raises(Exception, match="sdf_field: stored must be float16 beside"):
        lib.sdf_field(*sdf_field_inputs(3), stored)


def test_field_has_the_same_bits_on_any_number_of_threads():
    inputs = sdf_field_inputs(3000, torch.float32)
    first, *others = (on_threads(n, lambda: gradients(lib.sdf_field, inputs)) for n in (1, 2, 2))
    for outputs, grads in others:
        assert all(map(torch.equal, [*first[0], *first[1]], [*outputs, *grads]))


each_device = pytest.mark.parametrize("device", DEVICES)


IMPOSSIBLE = {"n_levels": (0, 33), "n_features": (3,), "base_resolution": (0, 2**40), "log2_table_size": (0, 64)}
IMPOSSIBLE |= {"growth": (0.9, float("nan"))}


@pytest.mark.parametrize(("name", "value"), [(name, x) for name, values in IMPOSSIBLE.items() for x in values])
def test_an_impossible_shape_raises(name, value):
    check_error(lambda: HashGridSpec(**{name: value}), "finest level" if value == 2**40 else name, "got")


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


def exact_field(table_dtype=None) -> SdfField:
    torch.manual_seed(0)
    field = SdfField(op_cases.SDF_SPEC, BOX, table_dtype=table_dtype)
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
    samples = [sampled(field, tuple(t.float() for t in field_rays())) for field in (rounded, plain)]
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
