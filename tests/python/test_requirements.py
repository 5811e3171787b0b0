"""What an installation brings: pinned, with hashes, and with a licence that is listed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

if sys.version_info >= (3, 11):
    import tomllib as toml
else:
    import tomli as toml

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.10", "3.11", "3.12", "3.13")


@pytest.fixture(scope="module")
def project() -> dict:
    return toml.loads((ROOT / "pyproject.toml").read_text())


@pytest.fixture(scope="module")
def locked() -> list[tuple[Requirement, str]]:
    """The lock file's requirements, each with the text of its lines."""
    blocks = re.split(r"\n(?=\S)", (ROOT / "third_party" / "requirements.lock").read_text())
    return [(Requirement(block.split("\\")[0].strip()), block) for block in blocks if not block.startswith("#")]


def holds(requirement: Requirement, environment: dict[str, str]) -> bool:
    return requirement.marker is None or requirement.marker.evaluate(environment)


@pytest.mark.parametrize("python", PYTHONS)
def test_each_requirement_has_one_locked_version_that_fits(project, locked, python):
    wanted = [*project["project"]["dependencies"], *project["project"]["optional-dependencies"]["test"]]
    wanted += [*project["build-system"]["requires"], "cmake>=3.22", "ninja"]
    environment = {"python_version": python, "python_full_version": f"{python}.1", "extra": ""}
    environment |= {"sys_platform": "linux", "platform_machine": "x86_64"}
    pins = [(canonicalize_name(r.name), str(r.specifier)) for r, _ in locked if holds(r, environment)]
    names = [name for name, _ in pins]
    assert len(names) == len(set(names))
    versions = {name: Version(pin.removeprefix("==")) for name, pin in pins}
    for requirement in map(Requirement, wanted):
        name = canonicalize_name(requirement.name)
        if name == "torch" or not holds(requirement, environment):
            continue
        assert name in versions, f"{name} is not locked; run make lock"
        assert requirement.specifier.contains(versions[name]), f"{name} {versions[name]}; run make lock"


def test_every_locked_package_has_hashes(locked):
    assert len(locked) > 40
    for requirement, block in locked:
        assert str(requirement.specifier).startswith("=="), requirement
        assert re.search(r"--hash=sha256:[0-9a-f]{64}", block), requirement


def test_torch_is_chosen_for_each_machine(locked):
    brought = ("torch", "triton", "nvidia-", "cuda-")
    assert not [str(r) for r, _ in locked if canonicalize_name(r.name).startswith(brought)]


def test_what_the_program_requires_has_a_listed_licence(project):
    listed = re.findall(
        r"^\| ([a-z0-9-]+) \| [^|]+ \| ([^|]+) \|", (ROOT / "docs" / "licences.md").read_text(), re.MULTILINE
    )
    licences = dict(listed)
    needed = {canonicalize_name(Requirement(line).name) for line in project["project"]["dependencies"]}
    assert needed - {"tomli"} <= set(licences), "run python third_party/list_licences.py"
    assert "not stated" not in {text.strip() for text in licences.values()}


def test_a_wheel_brings_the_licences_of_what_it_carries(project):
    files = {path for pattern in project["project"]["license-files"] for path in ROOT.glob(pattern)}
    assert {"LICENSE", "Apache-2.0.txt", "bundled.txt", "LICENSES"} <= {path.name for path in files}


def test_all_files_name_one_version(project):
    version = project["project"]["version"]
    cmake = re.search(r"project\(splitnerf VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())
    citation = re.search(r"^version: (\S+)", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    newest = re.search(r"^## (\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert {cmake[1], citation[1], newest[1]} == {version}


def test_the_list_of_changes_names_the_formats_of_files():
    from splitnerf.refinement.refine import STATE_FORMAT
    from splitnerf.training.checkpoint import FORMAT

    table = (ROOT / "CHANGELOG.md").read_text()
    assert f"| `checkpoint.pt` | `format`, now {FORMAT} |" in table
    assert f"| `refinement.pt` | `format`, now {STATE_FORMAT} |" in table
