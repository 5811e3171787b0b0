"""Resources of the CUDA kernels of a training step by the compiler: registers, stack, spills and static shared memory.

    python tests/bench/kernel_resources.py            prints the table of the present sources
    python tests/bench/kernel_resources.py --write    renews tests/cuda/kernel_resources.tsv

Kernels in float64, and those for other than two features a level, are in no step and are left out. Takes a minute of
one core, nvcc and no GPU. tests/python/test_kernel_resources.py compares the sources with the table.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "tests/cuda/kernel_resources.tsv"
BODIES = ROOT / "cpp/include/splitnerf/bodies"
ARCHITECTURE = "sm_90"
AS_ON_THE_CPU = ("spread.cu", "rays.h")  # built without fused multiply-adds
IN_NO_STEP = re.compile(r"\bdouble\b|<float, [148]\b")
NUMBERS = {  # columns of the table, and where the compiler says them
    "registers": r"Used (\d+) registers",
    "stack": r"(\d+) bytes stack frame",
    "spill stores": r"(\d+) bytes spill stores",
    "spill loads": r"(\d+) bytes spill loads",
    "shared": r"(\d+) bytes smem",
}


class Kernel(NamedTuple):
    """A line of the table: the names of the source and of the kernel, or of the body that it runs; the columns of
    `NUMBERS`."""

    source: str
    name: str
    numbers: tuple[int, ...]

    def __str__(self) -> str:
        return "\t".join([self.source, self.name, *map(str, self.numbers)])

    @property
    def bare(self) -> str:
        """The name without template arguments: a kernel's own, or that of the body which a launcher runs."""
        return re.match(r"(?:(?:add_up|finish)_kernel<)?(\w+)", self.name)[1]


def compiler() -> str | None:
    """The version of nvcc; None without one."""
    try:
        said = subprocess.run(["nvcc", "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return None
    return re.search(r"V([\d.]+)", said)[1]


def head(version: str) -> str:
    """The table's first line."""
    return f"# nvcc {version} for {ARCHITECTURE}; written by tests/bench/kernel_resources.py --write"


def sources() -> list[Path]:
    """The files that kernels are compiled from: those of cpp/cuda, and the headers of bodies."""
    return [*sorted((ROOT / "cpp/cuda").glob("*.cu")), *sorted(BODIES.glob("*.h"))]


def compiler_says(source: Path, folder: Path) -> str:
    """What ptxas says of a source's kernels; that of a header of bodies is written into the folder first, as the build
    does."""
    file = source
    if source.parent == BODIES:
        file = folder / f"bodies_{source.name}.cu"
        file.write_text((ROOT / "cpp/cuda/bodies.cu.in").read_text().replace("@header@", source.name))
    flags = ["-fmad=false"] if source.name in AS_ON_THE_CPU else []
    command = ["nvcc", "-std=c++17", f"-arch={ARCHITECTURE}", f"-I{ROOT}/cpp/include", f"-I{ROOT}/cpp/cuda", *flags]
    done = subprocess.run(
        [*command, "-Xptxas", "-v", "-cubin", "-o", os.devnull, str(file)], capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(f"{source.name}: {done.stderr[-2000:]}")
    return subprocess.run(["c++filt"], input=done.stderr, capture_output=True, text=True, check=True).stdout


def short(name: str) -> str:
    """'void splitnerf::cuda::for_each_kernel<splitnerf::ShadeBody<float> >(long, ...)' -> 'ShadeBody<float>'."""
    for part in ("(anonymous namespace)::", "splitnerf::", "cuda::"):
        name = name.replace(part, "")
    name = name.split("(")[0].removeprefix("void ").replace("> >", ">>").replace("> >", ">>")
    launched = re.fullmatch(r"for_each\w*_kernel<(.*)>", name)
    return launched.group(1).strip() if launched else name


def kernels(source: str, text: str) -> list[Kernel]:
    """The kernels of a step of which the compiler's text speaks."""
    found = []
    for block in re.split(r"Compiling entry function '", text)[1:]:
        numbers = tuple(int(m[1]) if (m := re.search(pattern, block)) else 0 for pattern in NUMBERS.values())
        kernel = Kernel(source, short(block.split("' for '")[0]), numbers)
        if not IN_NO_STEP.search(kernel.name):
            found.append(kernel)
    return sorted(found)


def compiled() -> list[Kernel]:
    """The kernels of the present sources."""
    with tempfile.TemporaryDirectory() as folder:
        return [k for source in sources() for k in kernels(source.name, compiler_says(source, Path(folder)))]


def committed() -> tuple[str, list[Kernel]]:
    """The table's first line and its kernels."""
    first, _, *lines = TABLE.read_text().splitlines()
    cells = [line.split("\t") for line in lines]
    return first, [Kernel(source, name, tuple(map(int, numbers))) for source, name, *numbers in cells]


def defined() -> set[str]:
    """The kernels that the sources define, without template arguments, as far as their text says."""
    texts = {source: source.read_text() for source in [*sources(), *(ROOT / "cpp/cuda").glob("*.cuh")]}
    found: set[str] = set()
    for source, text in texts.items():
        if source.parent == BODIES:
            found |= set(re.findall(r"^SPLITNERF_ON_GPU(?:_TYPE)?\((\w+)\)", text, re.MULTILINE))
        elif source.name != "launch.cuh":  # which runs the bodies
            found |= set(re.findall(r"__global__[^{]*?\b(\w+_kernel)\(", text)) | set(re.findall(r"\b\w+Body\b", text))
    alias = dict(re.findall(r"\busing (\w+Body) =\s+(\w+)<", "\n".join(texts.values())))
    return {alias.get(name, name) for name in found}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="into the table beside the tests of the kernels")
    arguments, version = parser.parse_args(), compiler()
    if version is None:
        sys.exit("nvcc was not found")
    text = "\n".join([head(version), "\t".join(["source", "kernel", *NUMBERS]), *map(str, compiled())]) + "\n"
    TABLE.write_text(text) if arguments.write else print(text, end="")


if __name__ == "__main__":
    main()
