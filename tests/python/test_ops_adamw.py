"""AdamW as one operator: against torch's, in float64, at the ends of the range; rows left alone; copies; states exchanged."""

import copy
import math

import pytest
import torch
from op_cases import HASH_SPEC
from op_checks import check_error, devices, generator, lib
from splitnerf.ops import AdamW, HashGrid
from splitnerf.ops.sdf import rounded
from splitnerf.training.checkpoint import restore_optimiser

SHAPES = [(), (7,), (1000, 2), (37, 1), (5, 300), (3, 2, 4), (0, 2)]
SETTINGS = {"betas": (0.9, 0.99), "eps": 1e-15, "weight_decay": 0.1}
OF_GROUPS = {}, {"weight_decay": 0.2}, {"weight_decay": 0.0}, {"betas": (0.5, 0.7)}, {"eps": 0.3}
each_device = pytest.mark.parametrize("device", devices("adamw_steps_"))


def fused(*args, **options) -> torch.optim.AdamW:
    return torch.optim.AdamW(*args, **options, fused=True)


def begun(kind, device="cpu", dtype=torch.float32) -> torch.optim.Optimizer:
    """An optimiser of drawn parameters in groups with settings of their own."""
    g = generator(3)
    drawn = (torch.randn(shape, generator=g, dtype=torch.float64).to(device, dtype) for shape in SHAPES)
    groups = [{"params": []} | settings for settings in OF_GROUPS]
    for k, x in enumerate(drawn):
        groups[k % len(groups)]["params"].append(torch.nn.Parameter(x))
    return kind(groups, **SETTINGS)


def run(optimiser: torch.optim.Optimizer, steps: range) -> None:
    """Steps with drawn gradients, some of them 0, under a rate for each group, which changes; each group's gradients begin a
    step after those of the group before."""
    g = generator(4)
    for step in range(steps.stop):
        for k, group in enumerate(optimiser.param_groups):
            group["lr"] = (0.01 + 0.02 * k) / (1 + step)
            for parameter in group["params"]:
                grad = torch.randn(parameter.shape, generator=g, dtype=torch.float64) * 10 ** (step % 5 - 2)
                grad = torch.where(torch.rand(parameter.shape, generator=g) < 0.3, 0, grad)
                parameter.grad = grad.to(parameter) if step >= k else None
        if step in steps:
            optimiser.step()


def close(got: list, expected: list, tolerance: float) -> None:
    for a, b in zip(got, expected):
        torch.testing.assert_close(a.double(), b.double(), rtol=tolerance, atol=tolerance)


def everything(optimiser: torch.optim.Optimizer) -> list[torch.Tensor]:
    """Parameters and moments."""
    ours = [p for group in optimiser.param_groups for p in group["params"]]
    return [x.detach().cpu() for p in ours for x in (p, *(optimiser.state[p][m] for m in ("exp_avg", "exp_avg_sq")))]


@each_device
def test_fifty_steps_are_those_of_torch(device):
    ours, double = begun(AdamW, device), begun(AdamW, device, torch.float64)
    theirs, exact = begun(fused, device), begun(torch.optim.AdamW, "cpu", torch.float64)
    for optimiser in (ours, theirs, exact, double):
        run(optimiser, range(50))
    close(everything(double), everything(exact), 1e-12)
    close(everything(ours), everything(exact), 3e-6)
    close(everything(ours), everything(theirs), 3e-6 if device == "cpu" else 1e-5)  # torch rounds more on a GPU


@each_device
@pytest.mark.parametrize("some", [True, False])
@pytest.mark.parametrize("shape", SHAPES)
def test_rows_without_gradient_are_left_alone(device, shape, some):
    """Where all have one it is the dense step."""
    g = generator()
    start = [torch.randn(shape, generator=g) for _ in range(2)] + [torch.rand(shape, generator=g)]
    grad = torch.randn(shape, generator=g)
    if shape and grad.numel() and some:
        rows = grad.view(-1, shape[-1])
        rows[torch.rand(len(rows), generator=g) < 0.6] = 0.0
        rows[:, 0] *= torch.rand(len(rows), generator=g) < 0.5  # one number of a row may be 0
        rows[-1] = -0.0
    found = []
    for sparse in (False, True):
        now = [x.clone().to(device) for x in start]
        param, *moments = ([x] for x in now)
        lib.adamw_steps_(param, [grad.to(device)], *moments, [0.1], 0.9, 0.99, 1e-8, [0.1], [5], [sparse], [], [])
        found.append([x.cpu() for x in now])
    still = (grad == 0) if not shape else (grad == 0).all(-1, keepdim=True).expand(shape)
    for before, dense, sparse in zip(start, *found):
        assert torch.equal(sparse, torch.where(still, before, dense))
        assert torch.equal(sparse, dense) == (not grad.numel() or not shape or not some)


@each_device
def test_the_ends_of_the_range(device):
    """As with torch: a NaN and infinity over infinity show; where a square overflows nothing moves any more."""
    grads, sides = torch.tensor([1e18, -1e18, 1e-30, 1e-44, 0.0, math.nan, 1e30, math.inf]), []
    for kind, there in ((AdamW, device), (fused, "cpu")):
        param = torch.nn.Parameter(torch.ones(8, device=there))
        optimiser = kind([param], lr=0.01, **SETTINGS | {"weight_decay": 0.0})
        for _ in range(3):
            param.grad = grads.to(there)
            optimiser.step()
        sides.append([x.detach().cpu() for x in (param, optimiser.state[param]["exp_avg_sq"])])
    torch.testing.assert_close(*sides, equal_nan=True)
    (moved, squares), _ = sides
    assert moved.isnan().nonzero().flatten().tolist() == [5, 7] and moved[2:5].eq(1).all()
    assert moved[6] == 1 and squares[6].isinf()


# ---- copies of 16 bits ----


@each_device
def test_a_copy_is_rounded_as_torch_rounds_and_never_infinite(device):
    """At a rate of 0, on numbers of all magnitudes, and on those halfway between two of the copy's."""
    bits = torch.randint(-(2**31), 2**31, (100_000,), generator=generator()).to(torch.int32)
    bits[::4] &= -0x1000
    bits[1::4] = 0x33000000 + bits[1::4].remainder(0x17000000)  # what float16 has numbers for
    bits[2::4] = 0x33000000 + (bits[2::4].remainder(0x17000000) & -0x1000)
    param = bits.view(torch.float32).clone()
    param[:6] = torch.tensor([65504.0, 65520.0, 1e30, math.inf, -math.inf, math.nan])
    param, zeros = param.to(device), torch.zeros(len(param), device=device)
    copy = rounded(param) * 0
    tensors = [param], [torch.ones_like(zeros)], [zeros], [zeros.clone()]
    lib.adamw_steps_(*tensors, [0.0], 0.9, 0.99, 1e-8, [0.0], [1], [False], [copy], [0])
    torch.testing.assert_close(copy, rounded(param), rtol=0, atol=0, equal_nan=True)
    assert not copy.isinf().any() and copy[5].isnan()


@pytest.mark.parametrize("sparse", [False, True])
def test_grids_take_the_copies_that_the_step_wrote(sparse, monkeypatch):
    """And none is rounded anew, but after another optimiser's step or another write."""
    grids = [HashGrid(HASH_SPEC, 1.0, torch.float16) for _ in range(2)]
    tables = [grid.table for grid in grids]
    optimiser = AdamW(tables, lr=0.1, sparse=sparse, copies={grid.table: grid.copy for grid in grids})
    x, first = torch.rand(5, 3, generator=generator()), [grid.stored() for grid in grids]
    before = [copied.clone() for copied in first]
    with monkeypatch.context() as patch:
        patch.setattr("splitnerf.ops.sdf.rounded", None)
        for _ in range(3):
            optimiser.zero_grad()
            sum(grid(x).square().sum() for grid in grids).backward()
            optimiser.step()
            for grid, copied in zip(grids, first):
                assert grid.stored() is copied and torch.equal(copied, grid.table.detach().half())
    assert not any(map(torch.equal, before, first))
    torch.optim.SGD(tables, lr=0.1).step()
    assert torch.equal(grids[0].stored(), tables[0].detach().half())
    with torch.no_grad():
        tables[0].zero_()
    assert not grids[0].stored().any()


def test_writing_is_seen_by_autograd():
    param = torch.nn.Parameter(torch.ones(3))
    loss = param.square().sum()
    param.grad = torch.ones(3)
    AdamW([param]).step()
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        loss.backward()


# ---- states ----


@pytest.mark.parametrize(("first", "second"), [(AdamW, fused), (fused, AdamW), (AdamW, AdamW)])
def test_states_pass_from_one_to_the_other_by_a_checkpoint(first, second):
    """Five steps of one and five of the other are ten of either."""
    whole, before, after = begun(fused), begun(first), begun(second)
    run(whole, range(10))
    run(before, range(5))
    with torch.no_grad():
        for a, b in zip(before.param_groups, after.param_groups):
            for x, y in zip(a["params"], b["params"]):
                y.copy_(x)
    restore_optimiser(after, {"optimiser": before.state_dict()}, None)
    run(after, range(5, 10))
    close(everything(after), everything(whole), 3e-6)
    for k, group in enumerate(after.param_groups):
        for parameter in group["params"]:
            state = after.state[parameter]
            assert list(state) == ["step", "exp_avg", "exp_avg_sq"]
            assert state["step"].dtype == torch.float32 and state["step"] == 10 - k


def test_a_group_may_be_sparse():
    table, other = (torch.nn.Parameter(torch.ones(4, 2)) for _ in range(2))
    optimiser = AdamW([{"params": [table], "sparse": True}, {"params": [other]}], lr=0.1)
    (table[0].sum() + other[0].sum()).backward()
    optimiser.step()
    assert (table[1:] == 1.0).all() and (table[0] < 1.0).all() and (other < 1.0).all()
    optimiser.load_state_dict(optimiser.state_dict())
    assert [group["sparse"] for group in optimiser.param_groups] == [True, False]


def test_a_copy_of_an_optimiser_goes_on():
    weight = torch.nn.Parameter(torch.ones(3, 2))
    optimiser = AdamW([weight], lr=0.1)
    weight.grad = torch.ones(3, 2)
    optimiser.step()
    twin = copy.deepcopy(optimiser)
    twin.param_groups[0]["params"][0].grad = torch.ones(3, 2)
    twin.step()
    assert twin.param_groups[0]["params"][0][0, 0] < weight[0, 0]


def test_a_state_of_torch_brings_its_settings_and_leaves_those_it_does_not_have():
    weight = torch.nn.Parameter(torch.ones(3, 2))
    ours = AdamW([weight], lr=0.1, sparse=True)
    ours.load_state_dict(torch.optim.AdamW([weight], lr=0.2).state_dict())
    assert ours.param_groups[0]["sparse"] and ours.param_groups[0]["lr"] == 0.2


# ---- steps that are not allowed ----


@each_device
@pytest.mark.parametrize("sparse", [False, True])
def test_a_step_that_is_not_allowed_moves_nothing(device, sparse):
    """Neither parameters nor moments nor copies, of more arrays than one launch takes; one that is allowed moves all."""
    g, count = generator(), 30
    for allowed in (False, True):
        tensors = [[torch.rand(6, 2, generator=g).to(device) for _ in range(count)] for _ in range(4)]
        tensors[1][3][0, 0] = math.nan
        copies = [torch.zeros(6, 2, dtype=torch.float16, device=device) for _ in range(2)]
        before = [[x.clone() for x in kind] for kind in tensors]
        numbers = [0.1] * count, 0.9, 0.99, 1e-8, [0.1] * count, [1] * count, [sparse] * count
        lib.adamw_steps_(*tensors, *numbers, copies, [0, 29], torch.tensor(allowed, device=device))
        for kind in (0, 2, 3):
            assert all(torch.equal(a, b) != allowed for a, b in zip(tensors[kind], before[kind]))
        assert all(bool(copy.any()) == allowed for copy in copies)


def test_a_step_that_was_not_allowed_can_be_taken_back():
    """Then the optimiser goes on as if there had been none; a parameter without a gradient in that step keeps its count."""
    params = [torch.nn.Parameter(torch.linspace(-1, 1, 4) + i) for i in range(2)]
    alone = [torch.nn.Parameter(p.detach().clone()) for p in params]
    optimiser, other = AdamW(params, lr=0.1), AdamW(alone, lr=0.1)
    for step, allowed in enumerate((True, False, True)):
        for sides in (params, alone):
            for i, param in enumerate(sides):
                param.grad = torch.full_like(param, 1.0 + step) if i == 0 or step != 1 else None
        optimiser.step(allowed=torch.tensor(allowed))
        assert len(optimiser.counted) == (1 if step == 1 else 2)
        if allowed:
            other.step()
        else:
            optimiser.take_back(optimiser.counted)
    assert all(torch.equal(a, b) for a, b in zip(params, alone))
    assert [int(optimiser.state[p]["step"]) for p in params] == [2, 2]


# ---- the operator ----


def given(device="cpu") -> list:
    tensors = [[torch.ones(3, 2, device=device), torch.ones(4, device=device)] for _ in range(4)]
    copies = [torch.ones(4, dtype=torch.float16, device=device)]
    return [*tensors, [0.1, 0.1], 0.9, 0.99, 1e-8, [0.0, 0.0], [1, 1], [True, False], copies, [1]]


@each_device
def test_opcheck(device):
    torch.library.opcheck(lib.adamw_steps_, tuple(given(device)))


@each_device
def test_a_gradient_need_not_be_contiguous(device):
    found = []
    for turned in (lambda x: x, lambda x: x.t().contiguous().t()):
        arguments, grad = given(device), torch.rand(3, 2, generator=generator()).to(device)
        arguments[1][0] = turned(grad)
        lib.adamw_steps_(*arguments)
        found.append(arguments[0][0])
    assert torch.equal(*found)


ONE, FOUR = torch.ones(3, 2), torch.ones(4)
WRONG = [
    (0, [ONE.long(), FOUR], "param", "float32 or float64", "int64"),
    (0, [ONE.t().contiguous().t(), FOUR], "param", "contiguous"),
    (0, [ONE, FOUR.double()], "params must be [4] float32", "float64"),
    (1, [ONE], "grads must hold 2, got 1"),
    (1, [ONE[:2], FOUR], "grad", "[3, 2] float32", "[2, 2] float32"),
    (1, [ONE.double(), FOUR], "grad", "float32", "float64"),
    (2, [ONE, torch.ones(5)], "exp_avg must be [4]", "[5]"),
    (3, [ONE.t().contiguous().t(), FOUR], "exp_avg_sq", "contiguous"),
    (4, [0.1] * 3, "lrs must hold 2, got 3"),
    (4, [0.1, -0.1], "lr", "-0.1"),
    (4, [math.nan, 0.1], "lr", "nan"),
    (5, 1.0, "beta1", "[0, 1)", "1.0"),
    (6, -0.5, "beta2", "[0, 1)"),
    (7, -1.0, "eps"),
    (8, [0.0, -1.0], "weight_decay"),
    (9, [1, 0], "step must be at least 1, got 0"),
    (10, [True], "sparse must hold 2, got 1"),
    (11, [FOUR], "copy must be [4] float16", "float32"),
    (11, [torch.ones(3).half()], "copy must be [4] float16", "[3]"),
    (12, [2], "copied must hold positions in params"),
    (12, [0, 1], "copied must hold 1, got 2"),
    ((11, 12), lambda x: x * 2, "copied must hold no position twice"),
    (13, torch.tensor([True]), "allowed must be [] bool"),
]


@pytest.mark.parametrize(("position", "value", "parts"), [(p, v, parts) for p, v, *parts in WRONG])
def test_errors_name_what_is_wrong(position, value, parts):
    changed = [*given(), None]
    for i in position if isinstance(position, tuple) else (position,):
        changed[i] = value(changed[i]) if callable(value) else value
    check_error(lambda: lib.adamw_steps_(*changed), "adamw_steps_", *parts)
