"""The cost of many large photos: the time to the first step, the memory, the file, and the time of a step.

    python tests/bench/large_inputs.py [--photos 100 300 1000] [--max-memory GB ...] [--folder DIR]

Each row is one `splitnerf train` on photos of 12 megapixels, JPEG with masks, of a striped ball that looks the same
from all sides; it is ended after STEPS steps. The memory is the process's largest resident set before the end.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image
from splitnerf.relight.cameras import look_at

WIDTH, HEIGHT, FOCAL = 4000, 3000, 4200.0
DISTANCE = 3.0
ELEVATIONS = 0.2, 0.5, 0.9, 1.2  # radians
FIRST, STEPS = 20, 220  # steps that are not timed, and the last one
TIMEOUT = 3600.0  # seconds to the first step


class Row(NamedTuple):
    """What one training says: seconds to the first step, GiB of memory and of the file, ms of a step."""

    start: float
    memory: float
    file: float
    step: float


def photo(elevation: float) -> tuple[Image.Image, Image.Image]:
    """A photo and its mask of a unit ball with horizontal stripes, before a rough background."""
    camera = look_at(np.zeros(3), 0.0, elevation, DISTANCE)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32) + 0.5
    local = np.stack([(x - WIDTH / 2) / FOCAL, (HEIGHT / 2 - y) / FOCAL, -np.ones_like(x)], axis=-1)
    rays = local @ camera[:3, :3].T.astype(np.float32)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    half = rays @ camera[:3, 3].astype(np.float32)
    inside = half**2 - (DISTANCE**2 - 1)
    z = camera[2, 3] + (-half - np.sqrt(np.maximum(inside, 0))) * rays[..., 2]
    value = np.where(inside > 0, 120 + 90 * np.sin(20 * z), 60).astype(np.float32)
    noise = np.random.default_rng(0).normal(size=value.shape).astype(np.float32)
    grey = (value + 4 * noise).clip(0, 255).astype(np.uint8)
    return Image.fromarray(np.dstack([grey] * 3)), Image.fromarray((255 * (inside > 0)).astype(np.uint8))


def write_photos(folder: Path, n: int) -> None:
    """Data of n photos: links to one photo and mask for each elevation."""
    kept = folder.parent / "kept"
    if not kept.is_dir():
        kept.mkdir()
        for i, elevation in enumerate(ELEVATIONS):
            image, mask = photo(elevation)
            image.save(kept / f"{i}.jpg", quality=92)
            mask.save(kept / f"{i}.png")
    folder.mkdir()
    frames = []
    for i in range(n):
        kind = i % len(ELEVATIONS)
        for suffix in ("jpg", "png"):
            os.link(kept / f"{kind}.{suffix}", folder / f"{i:04d}.{suffix}")
        matrix = look_at(np.zeros(3), 2 * np.pi * i / n, ELEVATIONS[kind], DISTANCE).tolist()
        frames.append({"file_path": f"{i:04d}.jpg", "mask_path": f"{i:04d}.png", "transform_matrix": matrix})
    lens = {"w": WIDTH, "h": HEIGHT, "fl_x": FOCAL, "fl_y": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2}
    (folder / "transforms.json").write_text(json.dumps(lens | {"mask_kind": "object", "frames": frames}))


def largest_memory(process: int) -> float:
    """The largest resident set of a process in GiB."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return float(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 2**20


def unnamed_file(process: int) -> float:
    """The size of the largest deleted file that a process holds open, in GiB."""
    sizes = [0]
    for link in Path(f"/proc/{process}/fd").iterdir():
        try:
            if "(deleted)" in os.readlink(link):
                sizes.append(link.stat().st_size)
        except OSError:
            continue
    return max(sizes) / 2**30


def measure(data: Path, run: Path, budget: float | None) -> Row:
    """Trains until the last step and ends the process."""
    command = [
        sys.executable,
        "-m",
        "splitnerf.train",
        str(data),
        "--out",
        str(run),
        "--steps",
        "100000",
        "--eval-mode",
        "all",
    ]
    command += [] if budget is None else ["--max-memory", str(budget)]
    started = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        lines: list[dict] = []
        first = None
        while not lines or lines[-1]["step"] < STEPS:
            time.sleep(0.1)
            if process.poll() is not None or (first is None and time.monotonic() - started > TIMEOUT):
                raise SystemExit(
                    f"{data}: the training ended before its first step; run the command alone: {' '.join(command)}"
                )
            log = run / "metrics.jsonl"
            text = log.read_text() if log.is_file() else ""
            lines = [json.loads(line) for line in text.splitlines() if line.endswith("}")]
            if lines and first is None:
                first = time.monotonic() - started
        timed = [line for line in lines if line["step"] in (FIRST, STEPS)]
        step = (timed[1]["seconds"] - timed[0]["seconds"]) / (STEPS - FIRST)
        return Row(first, largest_memory(process.pid), unnamed_file(process.pid), 1000 * step)
    finally:
        process.kill()
        process.wait()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=int, nargs="+", default=[100, 300, 1000])
    parser.add_argument("--max-memory", type=float, nargs="+", default=[None], metavar="GB")
    parser.add_argument(
        "--folder", type=Path, default=None, help="where data are written for the time of the measurement"
    )
    args = parser.parse_args()
    print("| photos | --max-memory | to the first step | memory | file | step |\n|---|---|---|---|---|---|", flush=True)
    if args.folder is not None:
        args.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=args.folder) as folder:
        for n in args.photos:
            data = Path(folder) / f"photos_{n}"
            write_photos(data, n)
            for budget in args.max_memory:
                row = measure(data, Path(folder) / "run", budget)
                told = "default" if budget is None else f"{budget:g} GB"
                times = f"{row.start:.0f} s | {row.memory:.1f} GiB | {row.file:.1f} GiB | {row.step:.0f} ms"
                print(f"| {n} | {told} | {times} |", flush=True)
                shutil.rmtree(Path(folder) / "run")
    return 0


if __name__ == "__main__":
    sys.exit(main())
