"""The structure of the code: layers, budgets, and the walk of a step."""

from graphlib import CycleError, TopologicalSorter

import budget
import grimp
import pytest

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
    level = {
        f"{package}.{name}": i for package, lines in LAYERS.items() for i, line in enumerate(lines) for name in line
    }

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
    assert units | {"splitnerf._core"} == {f"{package}.{name}" for name in set().union(*LAYERS[package])} | {
        "splitnerf._core"
    }


def test_imports_run_down_the_layers_and_none_of_the_core_is_of_a_tool(imports):
    assert wrong_way(imports) == []


def test_no_module_imports_itself_in_a_circle(imports):
    assert circle(imports) == []


def test_a_planted_import_is_found(imports):
    """Of the training in a field: it runs up the layers and closes a circle."""
    planted = {**imports, "splitnerf.fields.surface": imports["splitnerf.fields.surface"] | {"splitnerf.training.loop"}}
    assert wrong_way(planted) == ["splitnerf.fields.surface imports splitnerf.training.loop"]
    assert {"splitnerf.fields.surface", "splitnerf.training.loop"} <= set(circle(planted))


def test_a_planted_import_of_a_tool_is_found(imports):
    planted = {**imports, "splitnerf.pipeline": imports["splitnerf.pipeline"] | {"splitnerf_tools.view.training_page"}}
    assert wrong_way(planted) == ["splitnerf.pipeline imports splitnerf_tools.view.training_page"]


# ---- budgets ----


SMALL_LAYERS = {
    "splitnerf.errors": set(),
    "splitnerf.data.photos": {"splitnerf.errors"},
    "splitnerf.data.lens": {"splitnerf.data.photos"},
    "splitnerf.pipeline": {"splitnerf.data.photos", "splitnerf.errors"},
    "splitnerf.cli.train": {"splitnerf.pipeline", "splitnerf.data.lens"},
    "splitnerf.__main__": {"splitnerf.cli.train"},
}


def test_lines_are_counted_once_each(tmp_path):
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "a/one.py").write_text("1\n2\n")
    (tmp_path / "a/b/two.py").write_text("1\n\n3")
    (tmp_path / "a/b/other.md").write_text("1\n")
    assert budget.n_lines(tmp_path, ["a/**/*.py", "a/*.py"]) == 5


def test_loose_modules_join_packages_and_arrows_within_one_do_not_count():
    found = {m.split(".", 1)[1]: p for m, p in budget.packages(SMALL_LAYERS).items()}
    packages = {"data.photos": "data", "data.lens": "data", "pipeline": "run", "cli.train": "cli", "__main__": "cli"}
    assert found == packages | {"errors": "base"}
    arrows = {f"{a} {b}" for a, b in budget.arrows(SMALL_LAYERS)}
    assert arrows == {"data base", "run data", "run base", "cli run", "cli data"}


def test_a_part_that_outgrows_its_budget_fails(tmp_path, capsys):
    (tmp_path / "one.py").write_text("1\n" * 7)
    limits = '[lines]\ncore = {{ files = ["*.py"], most = {}, aim = 2 }}\n[core]\npackages = {{ most = 99, aim = 1 }}\n'
    limits += "arrows = {{ most = 999, aim = 1 }}\n"
    for most, code in ((7, 0), (6, 1)):
        (tmp_path / "budget.toml").write_text(limits.format(most))
        assert budget.main(tmp_path, tmp_path / "budget.toml") == code
        said = capsys.readouterr().out
        assert said.startswith("core             7 of") and ("exceeds" in said) == bool(code)
