"""Imports run one way: from the command line down to the compiled library, and never in a circle."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

import grimp
import pytest

# From the top: a unit imports those of lower lines only. Units of one line do not import each other.
LAYERS = [
    {"train", "__main__"},
    {"cli"},
    {"batch", "bench", "demo"},
    {"ablate"},
    {"workflow"},
    {"delivery"},
    {"capture", "view"},
    {"training", "inspection", "separation"},
    {"outputs", "report"},
    {"evaluate", "refinement", "relight", "synth"},
    {"export", "render"},
    {"fields", "config"},
    {"data", "doctor"},
    {"ops", "devices", "files"},
    {"_core", "memory", "notes", "progress"},
    {"errors"},
]


@pytest.fixture(scope="module")
def imports() -> dict[str, set[str]]:
    """Every module of the package and what it imports of the package, the package's own `__init__` aside."""
    graph = grimp.build_graph("splitnerf")
    found = {m: graph.find_modules_directly_imported_by(m) - {"splitnerf"} for m in graph.modules if m != "splitnerf"}
    assert len(found) > 60
    return found


def unit(module: str) -> str:
    return module.split(".")[1]


def wrong_way(imports: dict[str, set[str]]) -> list[str]:
    level = {name: i for i, line in enumerate(LAYERS) for name in line}
    return [
        f"{module} imports {imported}"
        for module, targets in imports.items()
        for imported in targets
        if unit(imported) not in ("_core", unit(module)) and level[unit(imported)] <= level[unit(module)]
    ]


def circle(imports: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle; empty where there is none."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_every_unit_has_a_layer(imports):
    assert {unit(module) for module in imports} | {"_core"} == set().union(*LAYERS)


def test_imports_run_down_the_layers(imports):
    assert wrong_way(imports) == []


def test_no_module_imports_itself_in_a_circle(imports):
    assert circle(imports) == []


def test_a_planted_import_is_found(imports):
    """Of the training in a field: it runs up the layers and closes a circle."""
    planted = {**imports, "splitnerf.fields.sdf": imports["splitnerf.fields.sdf"] | {"splitnerf.training.loop"}}
    assert wrong_way(planted) == ["splitnerf.fields.sdf imports splitnerf.training.loop"]
    assert {"splitnerf.fields.sdf", "splitnerf.training.loop"} <= set(circle(planted))
