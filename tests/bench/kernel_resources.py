"""What each CUDA kernel takes, as the compiler says: registers, spills and shared memory, as a table.

    python tests/bench/kernel_resources.py --arch sm_90 >docs/benchmarks/kernel_resources.csv

Needs nvcc and no GPU.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = "file,kernel,registers,stack_bytes,spill_store_bytes,spill_load_bytes,static_shared_bytes".split(",")
AS_ON_THE_CPU = ("spread.cu", "bodies_rays.h.cu")  # built without fused multiply-adds


class Kernel(NamedTuple):
    name: str
    registers: int
    stack: int
    stored: int  # bytes spilled
    loaded: int
    shared: int


def compiler_says(source: Path, arch: str, flags: list[str]) -> str:
    command = ["nvcc", "-std=c++17", f"-arch={arch}", f"-I{ROOT}/cpp/include", f"-I{ROOT}/cpp/cuda", "-Xptxas", "-v"]
    done = subprocess.run(
        [*command, *flags, "-cubin", "-o", os.devnull, str(source)], capture_output=True, text=True, check=True
    )
    return subprocess.run(["c++filt"], input=done.stderr, capture_output=True, text=True, check=True).stdout


def short(name: str) -> str:
    """'void splitnerf::cuda::for_each_kernel<splitnerf::ShadeBody<float> >(long, ...)' -> 'ShadeBody<float>'."""
    for part in ("(anonymous namespace)::", "splitnerf::", "cuda::"):
        name = name.replace(part, "")
    name = name.split("(")[0].removeprefix("void ").replace("> >", ">>").replace("> >", ">>")
    launched = re.fullmatch(r"for_each\w*_kernel<(.*)>", name)
    return launched.group(1).strip() if launched else name


def kernels(text: str) -> list[Kernel]:
    found = []
    for block in re.split(r"Compiling entry function '", text)[1:]:
        numbers = {
            key: int(m.group(1)) if (m := re.search(pattern, block)) else 0
            for key, pattern in {
                "registers": r"Used (\d+) registers",
                "stack": r"(\d+) bytes stack frame",
                "stored": r"(\d+) bytes spill stores",
                "loaded": r"(\d+) bytes spill loads",
                "shared": r"(\d+) bytes smem",
            }.items()
        }
        found.append(Kernel(short(block.split("' for '")[0]), **numbers))
    return sorted(found)


def sources(folder: Path) -> list[Path]:
    """The files of kernels, and, written into a folder as the build does, one for each header of bodies."""
    template = (ROOT / "cpp/cuda/bodies.cu.in").read_text()
    written = []
    for header in sorted((ROOT / "cpp/include/splitnerf/bodies").glob("*.h")):
        written.append(folder / f"bodies_{header.name}.cu")
        written[-1].write_text(template.replace("@header@", header.name))
    return [*sorted((ROOT / "cpp/cuda").glob("*.cu")), *written]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arch", default="sm_90")
    parser.add_argument("--only", default="", metavar="TEXT", help="files whose names hold this text")
    arguments = parser.parse_args()
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(COLUMNS)
    with tempfile.TemporaryDirectory() as folder:
        for source in sources(Path(folder)):
            if arguments.only in source.name:
                flags = ["-fmad=false"] if source.name in AS_ON_THE_CPU else []
                table.writerows((source.name, *kernel) for kernel in kernels(compiler_says(source, arguments.arch, flags)))


if __name__ == "__main__":
    main()
