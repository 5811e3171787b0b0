"""What is shipped: requirements and licences, wheels, the source archive."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version
from splitnerf.config.settings import tomllib as toml

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
    listed = re.findall(r"^\| ([a-z0-9-]+) \| [^|]+ \| ([^|]+) \|", (ROOT / "docs" / "licences.md").read_text(), re.M)
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


# ---- wheels ----


THIRD_PARTY = Path(__file__).parents[2] / "third_party"
# A Python whose venv is a copy of itself, and whose pip and auditwheel write an archive with the text of $INSIDE.
PYTHON = """#!{real}
import os, shutil, subprocess, sys, zipfile
words = sys.argv[1:]
with open({log!r}, "a") as log:
    print(os.environ.get("_PYTHON_HOST_PLATFORM", "here"), *words, file=log)
if words[:2] == ["-m", "venv"]:
    os.makedirs(words[2] + "/bin")
    shutil.copy(__file__, words[2] + "/bin/python")
elif words[:2] == ["-m", "pip"] and "wheel" in words:
    with zipfile.ZipFile(words[words.index("--wheel-dir") + 1] + "/built.whl", "w") as wheel:
        wheel.writestr("library.so", os.environ["INSIDE"])
elif words[:2] == ["-m", "auditwheel"]:
    shutil.copy(words[-1], words[words.index("--wheel-dir") + 1])
elif words[0] in ("-c", "-") or words[:2] == ["-m", "zipfile"]:
    sys.exit(subprocess.run(["{real}", *words]).returncode)
"""


@pytest.fixture
def build(tmp_path):
    """Runs build_wheels.sh; returns its result, and the lines that Python was called with."""
    python, log = tmp_path / "python", tmp_path / "log"
    python.write_text(PYTHON.format(real=sys.executable, log=str(log)))
    python.chmod(0o755)

    def run(inside: str = "", **settings: str) -> tuple[subprocess.CompletedProcess, list[str]]:
        own = os.environ | {"TORCH_PYTHON": sys.executable, "TMPDIR": str(tmp_path), "INSIDE": inside} | settings
        command = ["sh", str(THIRD_PARTY / "build_wheels.sh"), str(tmp_path / "out"), str(python)]
        done = subprocess.run(command, check=False, env=own, capture_output=True, text=True)
        return done, log.read_text().splitlines()

    return run


def test_a_wheel_for_another_processor_is_compiled_and_named_for_it(build):
    done, lines = build(CROSS="/other")
    assert done.returncode == 0, done.stderr
    (wheel,) = (line for line in lines if " wheel " in line)
    version = f"{sys.version_info[0]}{sys.version_info[1]}"
    assert wheel.startswith("linux-aarch64 ")
    for setting in (
        "CMAKE_SYSTEM_NAME=Linux",
        "CMAKE_SYSTEM_PROCESSOR=aarch64",
        "CMAKE_CXX_COMPILER=aarch64-linux-gnu-g++",
        "CMAKE_FIND_ROOT_PATH=/other",
        "SPLITNERF_TORCH=/other/torch",
        f"PYTHON_MODULE_EXTENSION=.cpython-{version}-aarch64-linux-gnu.so",
    ):
        assert f"-C cmake.define.{setting}" in wheel
    assert all(line.startswith("here ") for line in lines if line != wheel)


def test_a_library_that_names_a_folder_of_this_machine_stops_the_build(build):
    done, _ = build(inside="/other/usr/lib", CROSS="/other")
    assert done.returncode == 1
    assert "library.so" in done.stdout and "these files name folders of this machine" in done.stderr


def test_without_the_cross_compiler_one_line_says_what_to_install(tmp_path):
    for program in ("sh", "dirname"):
        (tmp_path / program).symlink_to(shutil.which(program))
    script = THIRD_PARTY / "build_aarch64_wheels.sh"
    words, alone = ["sh", str(script), str(tmp_path / "out")], {"PATH": str(tmp_path)}
    done = subprocess.run(words, check=False, env=alone, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == "the cross compiler is missing: apt-get install g++-aarch64-linux-gnu\n"
    assert not (tmp_path / "out").exists()


# ---- the source archive ----


LEFT_OUT = (".ci/",)  # what runs the checks of this repository
ADDED = {"PKG-INFO"}
BUILD = "import sys; sys.path.insert(0, 'third_party'); import build_backend; build_backend.build_sdist(sys.argv[1])"


def git_files(*flags: str) -> set[str]:
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout: nothing says which files are sources")
    listed = subprocess.run(["git", "ls-files", "-z", *flags], cwd=ROOT, check=True, capture_output=True, text=True)
    return set(listed.stdout.split("\0")) - {""}


def test_the_source_archive_is_complete_and_holds_nothing_built(tmp_path):
    pytest.importorskip("scikit_build_core", reason="scikit-build-core writes the source archive")
    tracked = {name for name in git_files() if not name.startswith(LEFT_OUT) and os.path.lexists(ROOT / name)}
    new = git_files("--others", "--exclude-standard")
    subprocess.run([sys.executable, "-c", BUILD, str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    (archive,) = tmp_path.glob("splitnerf-*.tar.gz")
    with tarfile.open(archive) as files:
        packed = {name.split("/", 1)[1] for name in files.getnames()}
    assert tracked - packed == set(), "left out of the source archive"
    assert packed - tracked - new - ADDED == set(), "in the source archive, yet no sources"
