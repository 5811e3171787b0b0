"""Every operator on inputs made to break it, a hundredth of `make stability`, and its command."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from op_cases import OPERATORS
from splitnerf import ops
from stability import cases, fields, light, losses, properties, rays, search, shading, steps, table
from stability.__main__ import BAD_INPUT, BROKEN, DONE, main
from stability.entry import Entry
from stability.measure import cast, evaluate
from torch.utils._python_dispatch import TorchDispatchMode

PAGE = Path(__file__).parents[2] / "docs/benchmarks/stability.md"
CASES, EXACT = 100_000, 50
FEWER = {
    "sparse_product": 50_000,
    "NormalEquations.step": 2400,
    "LightEquations.step": 600,
    "PhotoExposures.learn": 4800,
    "find_exposures": 1920,
}
BY_NAME = {entry.name: entry for entry in table.ENTRIES}
NAN, INF = math.nan, math.inf


def rows_of(name: str, n: int, seed: int = 0) -> dict:
    return cast(BY_NAME[name].draw(cases.Draw(seed), n), torch.float32)


@pytest.mark.parametrize("name", BY_NAME)
def test_errors_stay_within_the_promise(name):
    """Errors of outputs and gradients against float64, of float64 against 50 digits, and nothing not finite."""
    found = search.run(BY_NAME[name], FEWER.get(name, CASES), exact=EXACT)
    worst = (table.input_text(rows) for rows in (found.worst_forward, found.worst_gradient))
    assert found.holds, "\n".join([f"{table.result_line(found)} not finite {found.broken} exact {found.exact}", *worst])


@pytest.mark.parametrize("claim", table.PROPERTIES, ids=lambda claim: claim.name)
def test_properties_hold(claim):
    found = properties.verify(claim, FEWER.get(claim.name, CASES // 5))
    assert found.holds, f"{table.verdict_line(found)}\n{table.input_text(found.worst)}"


class Called(TorchDispatchMode):
    """Writes down which operators of the library run within the block."""

    def __enter__(self):
        self.names = set()
        return super().__enter__()

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        if function.namespace == "splitnerf":
            self.names.add(function._schema.name.partition("::")[2])
        return function(*args, **kwargs or {})


def test_every_registered_operator_has_a_row():
    """By the names of entries and properties, all of which the page has; and by what these call, forward and backward."""
    for module in (fields, light, losses, properties, rays, shading, steps):
        for made in vars(module).values():  # what another test has made would not be made here
            if hasattr(made, "cache_clear"):
                made.cache_clear()
    with Called() as called:
        for entry in table.ENTRIES:
            evaluate(entry, cast(entry.draw(cases.Draw(0), 4), torch.float32), torch.float32)
        for claim in properties.PROPERTIES:
            properties.verify(claim, 4 * claim.size)
    assert OPERATORS - called.names == set()
    rows = {item.name for item in (*table.ENTRIES, *table.PROPERTIES)}
    named = {re.sub("_backward(_positions)?$", "", name) for name in OPERATORS}
    assert named - {name.partition(",")[0] for name in rows} == set()
    assert rows == set(re.findall(r"(?m)^\| (.+?) \| \d+ \|", PAGE.read_text()))


def test_the_condition_forgives_cancellation_but_no_other_error():
    """x - y of nearly equal numbers made by rounding x + 1 first: the error is a rounding of the inputs."""
    draw = lambda source, n: {"x": 1 + 1e-4 * source.uniform(n, 1), "y": 1 + 1e-4 * source.uniform(n, 1)}

    def difference(size):
        def call(rows, shared):
            x, y = rows["x"], rows["y"]
            return {"d": x * (1 + size) - y if x.dtype == torch.float32 else x - y}

        return call

    entry = Entry("difference", draw=draw, call=difference(6e-8), bound=1e-6, reason="")
    assert search.run(entry, 500).holds and search.run(entry, 500).plain_forward > 1e-5
    broken = Entry("difference", draw=draw, call=difference(1e-4), bound=1e-6, reason="")
    assert not search.run(broken, 500).holds


# ---- the command -------------------------------------------------------------------------------


def test_the_command_writes_both_tables(tmp_path, capsys):
    names = ["--op", "srgb_to_linear", "--op", "occlusion_factors"]
    assert main(["--cases", "500", "--out", str(tmp_path), *names]) == DONE
    assert "srgb_to_linear" in capsys.readouterr().out
    text = (tmp_path / "stability.md").read_text()
    for part in (
        "processor ",
        "torch ",
        "commit ",
        "date ",
        "measures `cpp ",
        "command `make stability STABILITY_CASES=500 STABILITY_OPTIONS='--seed 0 --op srgb_to_linear --op oc",
        "| srgb_to_linear | ",
    ):
        assert part in text
    lines = (tmp_path / "stability.csv").read_text().splitlines()
    assert lines[0].startswith("# processor: ") and any(line.startswith("operator,inputs,") for line in lines)
    (row,) = (line for line in lines if line.startswith("srgb_to_linear,"))
    assert "srgb = " in row and "srgb = " not in text


@pytest.mark.parametrize("promise", ["bound", "gradient_bound", "exact_bound"])
def test_a_broken_promise_is_exit_code_1(tmp_path, monkeypatch, capsys, promise):
    monkeypatch.setattr(table, "ENTRIES", (replace(BY_NAME["linear_to_srgb"], **{promise: 1e-20}),))
    assert main(["--cases", "500", "--out", str(tmp_path), "--op", "linear_to_srgb"]) == BROKEN
    assert "BROKEN" in capsys.readouterr().out and "| NO |" in (tmp_path / "stability.md").read_text()


@pytest.mark.parametrize("arguments, part", [(["--op", "no_such"], "no such operator"), (["--cases", "0"], "--cases")])
def test_bad_arguments_are_refused(arguments, part, capsys):
    assert main(arguments) == BAD_INPUT
    assert part in capsys.readouterr().err


# ---- what cannot be answered -------------------------------------------------------------------

ENTRY_OF_EACH = {name: entry for name, entry in BY_NAME.items() if "," not in name}
ROW_BY_ROW = [
    name
    for name, entry in ENTRY_OF_EACH.items()
    if entry.size == 1 or name in ("monte_carlo_light", "composite", "summed_light")
]


@pytest.mark.parametrize("value", [NAN, INF, -INF])
@pytest.mark.parametrize("name", ROW_BY_ROW)
def test_a_number_that_is_not_finite_stays_in_its_row(name, value):
    """The other rows are bit for bit what they were, and nothing crashes."""
    entry, given = ENTRY_OF_EACH[name], rows_of(name, 40)
    before = entry.call(given, entry.shared)
    for key, x in given.items():
        spoiled = given | {key: x.clone()}
        spoiled[key][7].view(-1)[0] = value
        after = entry.call(spoiled, entry.shared)
        others = torch.arange(40) != 7
        for output in before:
            assert torch.equal(before[output][others], after[output][others]), (key, output)


@pytest.mark.parametrize("name", ["hash_encode", "linear_to_srgb", "srgb_to_linear", "light_lookup", "sdf_values"])
def test_nan_gives_nan(name):
    entry, given = ENTRY_OF_EACH[name], rows_of(name, 20)
    for key in given:
        spoiled = given | {key: given[key].clone()}
        spoiled[key][7].view(-1)[0] = NAN
        assert all(bool(torch.isnan(x[7]).any()) for x in entry.call(spoiled, entry.shared).values()), key


def test_a_grazing_light_of_denormal_cosine_has_finite_gradients():
    normals = torch.tensor([[0.0, 0.0, 1.0]], requires_grad=True)
    roughness = torch.tensor([[0.3]], requires_grad=True)
    light_dirs, views = torch.tensor([[[1.0, 0.0, 1e-45]]]), torch.tensor([[-0.6, 0.0, 0.8]])
    sums = ops.shading.monte_carlo_light(normals, views, roughness, light_dirs, torch.ones(1, 1), torch.ones(1, 1, 3))
    gradients = torch.autograd.grad(sum(x.sum() for x in sums), (normals, roughness))
    assert all(bool(torch.isfinite(x).all()) for x in gradients)
