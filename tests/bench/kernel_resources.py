"""What each CUDA kernel takes, as the compiler says: registers, spills and shared memory, as a table for docs/cuda.md.

    python tests/bench/kernel_resources.py --arch sm_90

Needs nvcc and no GPU.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arch", default="sm_90")
    arguments = parser.parse_args()
    print(
        "| file | kernel | registers | stack, bytes | spilled, bytes (stores / loads) | static shared memory, bytes |"
    )
    print("|---|---|---|---|---|---|")
    for source in sorted((ROOT / "cpp/cuda").glob("*.cu")):
        flags = ["-fmad=false"] if source.name == "rays.cu" else []
        for k in kernels(compiler_says(source, arguments.arch, flags)):
            print(f"| {source.name} | `{k.name}` | {k.registers} | {k.stack} | {k.stored} / {k.loaded} | {k.shared} |")


if __name__ == "__main__":
    main()
