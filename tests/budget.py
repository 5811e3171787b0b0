"""Prints how large each part of the project is beside its budget, tests/budget.toml, and fails where one is exceeded.

python tests/budget.py        (make budget)
"""

import sys
from collections.abc import Mapping
from pathlib import Path

import grimp

if sys.version_info >= (3, 11):
    import tomllib as toml
else:
    import tomli as toml

ROOT = Path(__file__).parents[1]


def n_lines(patterns: list[str]) -> int:
    """The number of lines of the files that match."""
    files = {path for pattern in patterns for path in ROOT.glob(pattern) if path.is_file()}
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def core_imports() -> dict[str, set[str]]:
    """Every module of the core and what it imports of it."""
    graph = grimp.build_graph("splitnerf")
    modules = graph.modules - {"splitnerf"}
    return {module: graph.find_modules_directly_imported_by(module) & modules for module in modules}


def packages(imports: Mapping[str, set[str]]) -> dict[str, str]:
    """The package of each module; a loose module is of `cli` if it imports that, of `run` if it imports another, else of `base`."""
    folders = {module.split(".")[1] for module in imports if module.count(".") > 1}

    def of(module: str) -> str:
        name = module.split(".")[1]
        if name in folders:
            return name
        used = {target.split(".")[1] for target in imports[module]} & folders
        return "cli" if "cli" in used else "run" if used else "base"

    return {module: of(module) for module in imports}


def arrows(imports: Mapping[str, set[str]]) -> set[tuple[str, str]]:
    """Which package imports which."""
    package = packages(imports)
    return {(package[a], package[b]) for a, targets in imports.items() for b in targets if package[a] != package[b]}


def counts(budget: Mapping) -> dict[str, tuple[int, int, int]]:
    """What there is, the most that there may be, and the aim, by name."""
    imports = core_imports()
    found = {name: n_lines(part["files"]) for name, part in budget["lines"].items()}
    found |= {"packages": len(set(packages(imports).values())), "arrows": len(arrows(imports))}
    return {name: (found[name], part["most"], part["aim"]) for name, part in (budget["lines"] | budget["core"]).items()}


def main() -> int:
    """Prints a line for each part; returns 1 where one exceeds its budget."""
    found = counts(toml.loads((ROOT / "tests/budget.toml").read_text()))
    for name, (count, most, aim) in found.items():
        print(f"{name:10}{count:8,} of {most:6,}, aim {aim:6,}{'   exceeds its budget' if count > most else ''}")
    return int(any(count > most for count, most, _ in found.values()))


if __name__ == "__main__":
    sys.exit(main())
