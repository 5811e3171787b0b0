"""Plants a fault in the kernels, one at a time, and says what finds it.

    python tests/cuda/faults.py [NAME ...]

Each fault is planted in a copy of the sources, built into the tests of tests/cuda/ with the sanitizer that it is meant for, and
has to make them fail. Needs cmake, ninja and GoogleTest; about half an hour on one core. Exit code 1 where a fault is not found.
"""

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build" / "faults"
CUDA, BODIES = "cpp/cuda/", "cpp/include/splitnerf/"


class Fault(NamedTuple):
    """A change of one file, and the build that finds it: "" (values and what a GPU refuses), "address" or "thread"; and the tests
    that are run, as ThreadSanitizer takes minutes for all."""

    name: str
    finder: str
    file: str
    old: str
    new: str
    tests: str = "*"


def no_barrier(where: str, file: str, behind: str, indent: int, finder: str = "", tests: str = "*") -> Fault:
    """A barrier that is not there, in the line below the text."""
    barrier = f"\n{' ' * indent}__syncthreads();"
    return Fault(f"no barrier {where}", finder, CUDA + file, behind + barrier, behind, tests)


FAULTS = (
    no_barrier("before the totals of a scan's warps are read", "device.cu", "totals[number] = total;", 4),
    no_barrier("after these were read", "device.cu", "carried += warp.sum(of_warp);", 4, "thread", "*.SampledRays"),
    no_barrier("between the warps of a block that adds up", "launch.cuh", "= sum;\n  }", 2),
    no_barrier(
        "after a tile of the light was cleared", "light_pyramid.cu", "= T(0);", 4, "thread", "LightKernels.Lookup"
    ),
    no_barrier("before the prefilter's next tile is written", "prefilter.cu", "items[k].add(source);\n    }", 4),
    no_barrier("between units of the field and their sums", "sdf_field.cu", "units(layer, tile, given);", 6),
    no_barrier("before the units' memory is used again", "sdf_field.cu", "units, sum);\n      });", 6),
    no_barrier("before the copies of summed light are added", "summed_light.cu", "to_copy(Warp{}, p);", 2),
    Fault(
        "walk: no barrier between a round's inputs and the network",
        "",
        BODIES + "bodies/sdf_layer.h",
        "    group.sync();\n    const T of_part",
        "    const T of_part",
    ),
    Fault(
        "a warp's running sum starts with the own value in lane 0",
        "",
        CUDA + "launch.cuh",
        "    if (lane() == 0) running = T(0);\n",
        "",
    ),
    Fault(
        "a thread an item: one item too many",
        "address",
        CUDA + "launch.cuh",
        "  if (i < n) body(i);\n}\ntemplate <class Body> void for_each(",
        "  if (i <= n) body(i);\n}\ntemplate <class Body> void for_each(",
    ),
    Fault(
        "field: a full tile is written where it has fewer points",
        "address",
        CUDA + "sdf_field.cu",
        "tile.each(here * tile.n_outputs,",
        "tile.each(tile.points * tile.n_outputs,",
    ),
    Fault(
        "a gradient that blocks share is added to without an atomic",
        "thread",
        BODIES + "accumulate.h",
        "  atomicAdd(to, value);",
        "  *to += value;",
        "LightKernels.Lookup",
    ),
    Fault(
        "cached visibility: only the first 32 vertices are looked at",
        "",
        BODIES + "bodies/visibility_cache.h",
        "first < total; first += Group::size",
        "first < total && first == 0; first += Group::size",
    ),
    Fault(
        "sparse product: only one lane takes part in the sum",
        "",
        BODIES + "bodies/light_pyramid.h",
        "    sum = sum3(group, sum);",
        "    if (group.lane() == 0) sum = sum3(group, sum);",
    ),
)


def build(finder: str) -> Path:
    """Builds the tests with a sanitizer; the path of their program."""
    folder = WORK / (finder or "plain")
    options = (
        "-G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DSPLITNERF_BUILD_PYTHON=OFF -DSPLITNERF_BUILD_TESTS=ON".split()
    )
    words = ["cmake", "-S", WORK / "source", "-B", folder, *options, f"-DSPLITNERF_SANITIZE={finder}"]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    subprocess.run(
        ["cmake", "--build", folder, "--target", "splitnerf_cuda_tests"], check=True, stdout=subprocess.DEVNULL
    )
    return folder / "tests" / "splitnerf_cuda_tests"


def first_finding(program: Path, tests: str) -> str | None:
    """The first line that tells of a failure; None where all tests pass."""
    options = {"ASAN_OPTIONS": "halt_on_error=1", "TSAN_OPTIONS": "halt_on_error=1"}
    repeat = 1 if "thread" in program.parts else 3  # a race is one in any order
    command = [program, "--gtest_brief=1", f"--gtest_repeat={repeat}", f"--gtest_filter={tests}"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | options)
    if done.returncode == 0:
        return None
    lines = (done.stdout + done.stderr).splitlines()
    marks = ("ERROR: AddressSanitizer", "WARNING: ThreadSanitizer", "what():", "[  FAILED  ]")
    return next((line.strip() for mark in marks for line in lines if mark in line), f"exit code {done.returncode}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="parts of names of the faults to plant (default: all)")
    names = parser.parse_args().names
    chosen = [fault for fault in FAULTS if not names or any(name in fault.name for name in names)]
    shutil.rmtree(WORK / "source", ignore_errors=True)
    for folder in ("cpp", "tests", "third_party"):
        shutil.copytree(ROOT / folder, WORK / "source" / folder)
    shutil.copy(ROOT / "CMakeLists.txt", WORK / "source")
    missed = 0
    for finder in sorted({fault.finder for fault in chosen}):
        here = [fault for fault in chosen if fault.finder == finder]
        program = build(finder)
        for tests in sorted({fault.tests for fault in here}):
            if (found := first_finding(program, tests)) is not None:
                sys.exit(f"faults.py: without a fault the tests fail: {found}")
        for fault in here:
            path = WORK / "source" / fault.file
            right = path.read_text()
            if right.count(fault.old) != 1:
                sys.exit(
                    f"faults.py: {fault.file} has the text of '{fault.name}' {right.count(fault.old)} times, not once"
                )
            path.write_text(right.replace(fault.old, fault.new))
            found = first_finding(build(finder), fault.tests)
            path.write_text(right)
            missed += found is None
            print(f"{fault.name}: {found or 'NOT FOUND'}", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
