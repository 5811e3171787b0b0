"""The source archive holds every source and nothing that was built."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
