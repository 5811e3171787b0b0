"""The structure of the code: layers, no circles, and how many files a training step goes through."""

import sys
from collections import Counter
from collections.abc import Callable
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import SimpleNamespace

import grimp
import pytest
import splitnerf
import torch
from splitnerf.data.dataset import load_dataset
from splitnerf.training.loop import Training
from tiny_runs import tiny

# From the top: a unit imports those of later groups only. Units of one group do not import each other.
CORE = (
    "__main__; cli; pipeline; run_folder; training; evaluate refinement relight; export; render; fields config; data; "
    "ops devices files; _core memory plugins progress; errors"
)
TOOLS = "plugin; commands; batch bench capture demo inspection view; ablate doctor report separation synth; findings"
PACKAGES = {"splitnerf": CORE, "splitnerf_tools": TOOLS}
LAYERS = {name: [set(line.split()) for line in lines.split(";")] for name, lines in PACKAGES.items()}
Imports = dict[str, set[str]]


@pytest.fixture(scope="module")
def imports() -> Imports:
    """Every module of both packages and what it imports of them, the packages' own `__init__` aside."""
    graph = grimp.build_graph(*LAYERS)
    found = {m: graph.find_modules_directly_imported_by(m) - set(LAYERS) for m in graph.modules - set(LAYERS)}
    assert len(found) > 60
    return found


def unit(module: str) -> str:
    """The package or module directly in `splitnerf` or `splitnerf_tools` that a module belongs to."""
    return ".".join(module.split(".")[:2])


def wrong_way(imports: Imports) -> list[str]:
    """The imports that run up the layers, or from the core to the tools."""
    level = {f"{part}.{name}": i for part, lines in LAYERS.items() for i, line in enumerate(lines) for name in line}

    def allowed(module: str, imported: str) -> bool:
        here, there = (name.partition(".")[0] for name in (module, imported))
        return here == "splitnerf_tools" if here != there else level[unit(imported)] > level[unit(module)]

    return [
        f"{module} imports {imported}"
        for module, targets in imports.items()
        for imported in targets
        if unit(imported) != unit(module) and imported != "splitnerf._core" and not allowed(module, imported)
    ]


def circle(imports: Imports) -> list[str]:
    """Modules that import each other in a circle; empty where there is none."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return error.args[1]
    return []


@pytest.mark.parametrize("package", LAYERS)
def test_every_unit_has_a_layer(imports, package):
    units = {unit(module) for module in imports if module.startswith(f"{package}.")}
    named = {f"{package}.{name}" for name in set().union(*LAYERS[package])}
    assert units | {"splitnerf._core"} == named | {"splitnerf._core"}


def test_imports_run_down_the_layers_and_none_of_the_core_is_of_a_tool(imports):
    assert wrong_way(imports) == []


def test_no_module_imports_itself_in_a_circle(imports):
    assert circle(imports) == []


# ---- the walk of a step ----

PACKAGE = Path(splitnerf.__file__).parent
MOST = 13  # files beside those of splitnerf/ops/


def files_of(work: Callable[[], None]) -> Counter[str]:
    """The calls within each file of the package while `work` runs."""
    calls: Counter[str] = Counter()

    def count(frame, event, _) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and PACKAGE in path.parents:
            calls[path.relative_to(PACKAGE).as_posix()] += 1

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(before)
    return calls


def test_a_step_goes_through_few_files(data, tmp_path):
    """By now; those of eight steps of preset cpu, with a mesh, in which the light moves and no line is logged."""
    training = Training(load_dataset(data), tiny(steps=200, open_below=0.0), tmp_path, torch.device("cpu"))

    def steps(n: int) -> None:
        for _ in range(n):
            training.refresh()
            training.advance(SimpleNamespace(show=lambda *_: None))

    steps(21)
    training.mesh.request(training.progress)
    steps(2)
    files = files_of(lambda: steps(8))
    assert {"training/loop.py", "training/step.py", "render/renderer.py"} <= files.keys()
    assert len([name for name in files if not name.startswith("ops/")]) <= MOST, sorted(files)
