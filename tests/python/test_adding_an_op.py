"""docs/adding-an-op.md: its code compiles against this checkout, and its test passes."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from splitnerf import _core

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "adding-an-op.md"
COMPILER = shutil.which(os.environ.get("CXX", "c++"))
LIBRARIES = Path(_core.__file__).parent

# Where the page's files stand in the example's own folder.
FOLDERS = {"cpp/include/": "include/", "cpp/torch/": "", "python/splitnerf/ops/": "ops/", "tests/python/": ""}

LOAD = """
import torch
import splitnerf.ops

torch.ops.load_library("{library}")
splitnerf.ops.__path__.append("{ops}")
"""
OP_CASES = "import torch\nfrom op_checks import generator, unit\n\nCASES = {{\n{lines}}}\n"


def pages_files() -> dict[str, str]:
    """The page's code: path in the checkout -> what the block under that heading holds."""
    blocks = re.findall(r"^## \d\. [^\n]*`([^`]+)`\n.*?^```\w+\n(.*?)^```$", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    return dict(blocks)


def write_example(folder: Path) -> None:
    for path, code in pages_files().items():
        start = next(start for start in FOLDERS if path.startswith(start))
        to = folder / (FOLDERS[start] + path.removeprefix(start))
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_text(OP_CASES.format(lines=code) if to.name == "op_cases.py" else code)
    text = LOAD.format(library=folder / "example.so", ops=folder / "ops")
    (folder / "conftest.py").write_text(text)


def compile_example(folder: Path) -> None:
    library = Path(torch.__file__).parent
    command = [COMPILER, "-std=c++17", "-O1", "-Wall", "-Wextra", "-Werror", "-fPIC", "-fvisibility=hidden", "-shared"]
    command += ["-DTORCH_TARGET_VERSION=0x020b000000000000", f"-I{folder / 'include'}", f"-I{ROOT / 'cpp' / 'include'}"]
    command += [f"-I{ROOT / 'cpp' / 'torch'}", "-isystem", str(library / "include"), *map(str, folder.glob("*.cpp"))]
    command += ["-o", str(folder / "example.so"), str(next(LIBRARIES.glob("libsplitnerf_core.*")))]
    command += [f"-L{library / 'lib'}", "-ltorch", "-ltorch_cpu", "-lc10", f"-Wl,-rpath,{library / 'lib'}:{LIBRARIES}"]
    built = subprocess.run(command, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr


def test_the_page_names_six_places():
    names = [Path(path).parent.as_posix() for path in pages_files()]
    compiled = ["cpp/include/splitnerf", "cpp/include/splitnerf/bodies", "cpp/torch"]
    assert names == [*compiled, "python/splitnerf/ops", "tests/python", "tests/python"]


@pytest.mark.skipif(COMPILER is None, reason="no C++ compiler is there to build the page's operator")
def test_the_page_s_operator_compiles_and_passes_its_own_test(tmp_path):
    """In a process of its own: an operator, once registered, stays."""
    write_example(tmp_path)
    compile_example(tmp_path)
    paths = os.pathsep.join([str(tmp_path), str(ROOT / "tests" / "python"), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", ".", "."]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths})
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "3 passed" in ran.stdout
