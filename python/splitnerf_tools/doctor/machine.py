"""What the machine and the installation offer, and what to do where something is missing."""

from __future__ import annotations

import os
import platform
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import splitnerf
import torch
from splitnerf import _core
from splitnerf.devices import devices, refuse_one_processor
from splitnerf.errors import InputError
from splitnerf.memory import SHARE_OF_PHOTOS, control_group, memory_bytes

from splitnerf_tools.findings import Finding

INSTALL = "pip install --no-build-isolation ."
ISAS = ("base", "avx2", "avx512")  # each holds those before it
TRAINING_GIB, RUN_GIB = 2.0, 0.1  # memory of a training of preset cpu without its photos, and disk of its run
GIB = 2.0**30


class Package(NamedTuple):
    """An optional package: the module that is imported, its own name, the extra that installs it, and what it brings."""

    module: str
    name: str
    extra: str
    brings: str


PACKAGES = (
    Package("pycolmap", "pycolmap", "photos", "camera poses, in prepare"),
    Package("cv2", "opencv-python-headless", "photos", "masks and frames of a video, in prepare"),
    Package("pillow_heif", "pillow-heif", "heic", "HEIC photographs, in prepare"),
    Package("rawpy", "rawpy", "raw", "RAW photographs, in prepare"),
    Package("imageio_ffmpeg", "imageio-ffmpeg", "video", "MP4 files, in relight"),
    Package("pxr", "usd-core", "usd", "USDZ files, in export"),
    Package("ray", "ray", "batch", "many scenes, in batch"),
    Package("tensorboard", "tensorboard", "tensorboard", "TensorBoard's files, in train"),
)


def findings(folder: Path) -> list[Finding]:
    """All findings; ``folder`` is where the runs will be written."""
    system = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    return [
        Finding("splitnerf", splitnerf.__version__),
        Finding("Python", system),
        threads(),
        kernels(),
        cuda(),
        ray_tracing(),
        texture_coordinates(),
        memory(),
        disk(folder),
        *map(optional, PACKAGES),
    ]


def threads() -> Finding:
    """torch, and its threads beside the processors that they may run on."""
    used, allowed = torch.get_num_threads(), processors()
    value = f"{torch.__version__}, {used} threads on {allowed} processors"
    wish = os.environ.get("OMP_NUM_THREADS")
    if used > allowed:
        return Finding("torch", value, f"threads wait for each other: set OMP_NUM_THREADS={allowed}")
    idle = wish is not None and used < allowed
    return Finding("torch", value, f"OMP_NUM_THREADS={wish} leaves processors idle: unset it" if idle else "")


def processors() -> int:
    """The number of processors that this process may use, by its affinity and by its control group's quota."""
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = control_group("cpu.max")  # microseconds in each period, or "max"
    return min(allowed, max(1, int(quota[0]) // int(quota[1]))) if quota and quota[0] != "max" else allowed


def kernels() -> Finding:
    """The instruction set of the operators' kernels beside the processor's."""
    used = _core.instruction_set()
    able = {"AVX2": "avx2", "AVX512": "avx512"}.get(torch.backends.cpu.get_cpu_capability(), "base")
    if ISAS.index(used) >= ISAS.index(able):
        return Finding("kernels", f"{used}, the best of this processor")
    wish = os.environ.get("SPLITNERF_ISA")
    advice = f"SPLITNERF_ISA={wish} chose them: unset it" if wish else f"build for this processor: {INSTALL}"
    return Finding("kernels", f"{used}, slower than this processor's {able}", advice)


def lower_instruction_set() -> str | None:
    """The one below that of the kernels, if there is one."""
    at = ISAS.index(_core.instruction_set())
    return ISAS[at - 1] if at else None


def cuda() -> Finding:
    """The GPUs that the kernels were built for, torch's CUDA, and the GPU."""
    built, version = _core.cuda_architectures(), torch.version.cuda
    parts = [f"kernels for {built}" if built else "no kernels"]
    parts.append(f"torch for CUDA {version}" if version else "torch for the CPU")
    if torch.cuda.is_available():
        number = "".join(map(str, torch.cuda.get_device_capability()))
        value = "; ".join([*parts, f"{torch.cuda.get_device_name()} ({number})"])
        if "cuda" in devices():
            return Finding("CUDA", value)
        build = f"{INSTALL} -C cmake.define.CMAKE_CUDA_ARCHITECTURES={number}"
        return Finding("CUDA", value, f"build kernels for it, where nvcc is found: {build}", failed=bool(built))
    if shutil.which("nvidia-smi") is None:
        return Finding("CUDA", "; ".join([*parts, "no GPU"]))
    advice = "install a newer driver" if version else "install torch for CUDA: https://pytorch.org/get-started"
    return Finding("CUDA", "; ".join([*parts, "a GPU that torch does not see"]), advice)


def ray_tracing() -> Finding:
    version = _core.embree_version()
    if version:
        return Finding("ray tracing", f"Embree {version}")
    value = "embreex, as the build found no Embree"
    if find_spec("embreex") is None:
        return Finding("ray tracing", f"{value}; not installed", "pip install embreex", failed=True)
    return Finding("ray tracing", value, f"for faster rays: apt-get install libembree-dev, then {INSTALL}")


def texture_coordinates() -> Finding:
    try:
        refuse_one_processor()
    except InputError as error:
        return Finding("texture coordinates", "xatlas", str(error), failed=True)
    return Finding("texture coordinates", "xatlas")


def memory() -> Finding:
    total, free = (size / GIB for size in memory_bytes())
    value = (
        f"{total:.1f} GiB, {free:.1f} GiB free; a training takes {TRAINING_GIB:.0f} GiB, its photos up to {SHARE_OF_PHOTOS:.0%} of what is free"
        " (more are read from a file; --max-memory)"
    )
    return Finding("memory", value, "close other programs" if free < TRAINING_GIB else "")


def disk(folder: Path) -> Finding:
    free = shutil.disk_usage(folder).free / GIB
    advice = "" if free > RUN_GIB else f"a run needs {RUN_GIB} GiB: free some, or write elsewhere with --out"
    return Finding("disk", f"{free:.1f} GiB free in {folder}", advice)


def optional(package: Package) -> Finding:
    """Whether an optional package is there; what it would bring is no fault."""
    if find_spec(package.module) is not None:
        return Finding(package.name, f"there: {package.brings}")
    return Finding(package.name, f"missing: {package.brings} (pip install 'splitnerf[{package.extra}]')")
