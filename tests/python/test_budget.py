"""The count of lines, packages and arrows that `make budget` holds against the budgets."""

from __future__ import annotations

import budget

LAYERS = {
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
    assert {m.split(".", 1)[1]: p for m, p in budget.packages(LAYERS).items()} == {
        "errors": "base",
        "data.photos": "data",
        "data.lens": "data",
        "pipeline": "run",
        "cli.train": "cli",
        "__main__": "cli",
    }
    assert budget.arrows(LAYERS) == {
        ("data", "base"),
        ("run", "data"),
        ("run", "base"),
        ("cli", "run"),
        ("cli", "data"),
    }


def test_a_part_that_outgrows_its_budget_fails(tmp_path, capsys):
    (tmp_path / "one.py").write_text("1\n" * 7)
    limits = '[lines]\ncore = {{ files = ["*.py"], most = {}, aim = 2 }}\n[core]\npackages = {{ most = 99, aim = 1 }}\n'
    limits += "arrows = {{ most = 999, aim = 1 }}\n"
    for most, code in ((7, 0), (6, 1)):
        (tmp_path / "budget.toml").write_text(limits.format(most))
        assert budget.main(tmp_path, tmp_path / "budget.toml") == code
        said = capsys.readouterr().out
        assert said.startswith("core             7 of") and ("exceeds" in said) == bool(code)
