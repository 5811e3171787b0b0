"""The table of worst errors, as Markdown and CSV, and the run of all operators."""

import multiprocessing
import pickle
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from splitnerf.errors import InputError
from splitnerf_tools.bench.charts import table as table_lines
from splitnerf_tools.bench.charts import write_csv
from splitnerf_tools.bench.provenance import header, provenance

from stability import fields, light, losses, properties, rays, shading, steps
from stability.entry import Entry, Rows
from stability.properties import Property, Verdict, verify
from stability.search import Result, run

ENTRIES: tuple[Entry, ...] = sum((part.ENTRIES for part in (shading, light, rays, fields, losses, steps)), ())
PROPERTIES: tuple[Property, ...] = properties.PROPERTIES + steps.PROPERTIES
NAME = "stability"
SOURCES = (
    "cpp",
    "python/splitnerf/ops",
    "python/splitnerf/refinement/*equations.py",
    "python/splitnerf/training/exposure.py",
)
COLUMNS = (
    "operator, inputs, worst forward, promised, worst gradient, promised gradient, without condition, "
    "gradient without condition, gradient to shared, float64 against exact, float32 against exact, not finite, holds, reason"
).split(", ")


def chosen(names: list[str]) -> list[Entry | Property]:
    """The entries and properties of these operators; all without names.

    Raises:
        InputError: There is no such operator.
    """
    every = (*ENTRIES, *PROPERTIES)
    known = sorted({item.name.split(",")[0] for item in every})
    for name in names:
        if name not in known:
            raise InputError(f"--op {name}: there is no such operator; choose from {', '.join(known)}")
    return [item for item in every if not names or item.name.split(",")[0] in names]


def run_all(
    items: list[Entry | Property], cases: int, seed: int, show: Callable[[str], None], jobs: int = 1
) -> tuple[list[Result], list[Verdict]]:
    """Runs entries and properties, as many at a time as there are jobs; ``show`` is called with a line for each."""
    results, verdicts = [], []
    work = [(item.name, cases, seed) for item in items]
    with multiprocessing.get_context("fork").Pool(jobs, maxtasksperchild=1) if jobs > 1 else nullcontext() as pool:
        for item, written in zip(items, pool.imap(run_one, work, chunksize=1) if pool else map(run_one, work)):
            found = pickle.loads(written)
            if isinstance(item, Entry):
                results.append(replace(found, entry=item))
                show(result_line(results[-1]))
            else:
                verdicts.append(replace(found, claim=item))
                show(verdict_line(verdicts[-1]))
    return results, verdicts


def run_one(work: tuple[str, int, int]) -> bytes:
    """The pickled result of the item of a name, without the item: its functions cannot be sent to another process."""
    name, cases, seed = work
    item = next(item for item in (*ENTRIES, *PROPERTIES) if item.name == name)
    if isinstance(item, Entry):
        return pickle.dumps(replace(run(item, cases, seed), entry=None))
    return pickle.dumps(replace(verify(item, cases, seed), claim=None))


def number(x: float | None) -> str:
    return "-" if x is None else f"{x:.1e}"


def result_line(r: Result) -> str:
    gradient = f"gradient {number(r.gradient)} of {number(r.entry.gradient_bound)}" if r.entry.smooth else ""
    end = "" if r.holds else "  BROKEN"
    return f"{r.entry.name:28s} {r.cases:9d}  forward {number(r.forward)} of {number(r.entry.bound)}  {gradient}{end}"


def verdict_line(v: Verdict) -> str:
    return f"{v.claim.name:28s} {v.cases:9d}  {v.claim.statement}{'' if v.holds else f'  BROKEN {v.broken} times'}"


def row_of(r: Result) -> list[str]:
    return [
        r.entry.name,
        str(r.cases),
        number(r.forward),
        number(r.entry.bound),
        number(r.gradient) if r.entry.smooth else "none",
        number(r.entry.gradient_bound) if r.entry.smooth else "none",
        number(r.plain_forward),
        number(r.plain_gradient) if r.entry.smooth else "none",
        number(r.shared) if r.entry.smooth_shared else "none",
        number(r.exact),
        number(r.single_exact),
        str(r.broken),
        "yes" if r.holds else "NO",
        r.entry.reason,
    ]


def input_text(rows: Rows) -> str:
    """The numbers of one row, as they must be typed to get the same float32."""
    parts = []
    for name, x in rows.items():
        values = [f"{v:.9g}" for v in x.flatten().tolist()]
        parts.append(f"{name} = {' '.join(values[:24])}{f' ... ({len(values)} numbers)' if len(values) > 24 else ''}")
    return "; ".join(parts)


def write(results: list[Result], verdicts: list[Verdict], command: str, folder: Path) -> tuple[Path, Path]:
    """Writes stability.md and stability.csv, with machine, versions and commit in their heads."""
    folder.mkdir(parents=True, exist_ok=True)
    markdown, table = folder / f"{NAME}.md", folder / f"{NAME}.csv"
    facts = provenance(SOURCES, command)
    markdown.write_text(markdown_text(results, verdicts, facts))
    write_csv(table, facts, csv_rows(results, verdicts))
    return markdown, table


def csv_rows(results: list[Result], verdicts: list[Verdict]) -> Iterator[list[object]]:
    yield [*COLUMNS, "worst forward input", "worst gradient input"]
    for r in results:
        yield [*row_of(r), input_text(r.worst_forward), input_text(r.worst_gradient)]
    for v in verdicts:
        holds = "yes" if v.holds else "NO"
        yield [v.claim.name, v.cases, *["-"] * 9, v.broken, holds, v.claim.statement, input_text(v.worst), ""]


def markdown_text(results: list[Result], verdicts: list[Verdict], facts: dict[str, str]) -> str:
    lines = ["# Worst errors of the operators", "", header(facts), "", INTRODUCTION, ""]
    lines += table_lines(COLUMNS, [row_of(r) for r in results])
    claims = [[v.claim.name, v.cases, v.broken, v.claim.statement] for v in verdicts]
    lines += ["", *table_lines(["operator", "cases", "broken", "what must hold"], claims)]
    lines += ["", f"The inputs of the worst errors are in [{NAME}.csv]({NAME}.csv)."]
    return "\n".join(lines) + "\n"


INTRODUCTION = """Each operator in float32 against itself in float64 on the same adversarial numbers: extreme values
crossed with ordinary ones, and a search around the worst. An error is the largest difference in one output or gradient
of a row over the largest number there plus, where the condition counts, how much the true value changes by a relative
change of the inputs; the columns "without condition" leave the latter out. The condition is only computed above the
promised error: an error just below that is an upper bound. "Gradient to shared" is the error of a sum over many rows, of
the rows within their promise. The outputs of the worst thousand inputs were computed again in 50 digits where the operator
has such a formula: "against exact". Gradients are compared with float64 alone. "Not finite" counts rows with NaN or
infinity where the truth has a float32, or whose truth is NaN. Tables of the hash grid may be float16: compared
with float64 on the same numbers. No other input may be: they raise. The last table holds what draws, traces or counts, and
what iterates: there a statement is checked."""
