"""The scripts that build wheels, with a Python that only notes what it is asked for: nothing is compiled or downloaded."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

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
        environment = (
            os.environ | {"TORCH_PYTHON": sys.executable, "TMPDIR": str(tmp_path), "INSIDE": inside} | settings
        )
        command = ["sh", str(THIRD_PARTY / "build_wheels.sh"), str(tmp_path / "out"), str(python)]
        done = subprocess.run(command, check=False, env=environment, capture_output=True, text=True)
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
    # The programs that build run on this machine.
    assert all(line.startswith("here ") for line in lines if line != wheel)


def test_a_wheel_for_this_processor_is_named_for_no_other(build):
    done, lines = build()
    assert done.returncode == 0, done.stderr
    assert all(line.startswith("here ") for line in lines)
    assert not any("aarch64" in line or "CMAKE_SYSTEM" in line or "MODULE_EXTENSION" in line for line in lines)


def test_a_library_that_names_a_folder_of_this_machine_stops_the_build(build):
    done, _ = build(inside="/other/usr/lib", CROSS="/other")
    assert done.returncode == 1
    assert "library.so" in done.stdout and "these files name folders of this machine" in done.stderr


def test_without_the_cross_compiler_one_line_says_what_to_install(tmp_path):
    for program in ("sh", "dirname"):
        (tmp_path / program).symlink_to(shutil.which(program))
    script = THIRD_PARTY / "build_aarch64_wheels.sh"
    done = subprocess.run(
        ["sh", str(script), str(tmp_path / "out")],
        check=False,
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stderr == "the cross compiler is missing: apt-get install g++-aarch64-linux-gnu\n"
    assert not (tmp_path / "out").exists()
