"""splitnerf prepare."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from pathlib import Path

from splitnerf.cli.common import DONE, examples
from splitnerf.errors import InputError

PACKAGES = {"pycolmap": "pycolmap", "cv2": "opencv-python-headless"}

# What a step takes of the whole time, roughly; masks: where they are to be found, and where they are given.
STEPS = {
    "frames": 0.02,
    "photos": 0.01,
    "features": 0.06,
    "matches": 0.14,
    "cameras": 0.12,
    "exposures": 0.02,
    "images": 0.03,
    "masks": 0.6,
}
GIVEN_MASKS = 0.02


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "prepare",
        help="find cameras, masks and exposures of photographs",
        description="Reads a folder of photographs, or a video, of one object that does not move, or turns on a turntable, and writes DATA, which train "
        "reads: images without lens distortion, masks, transforms.json, and prepare.html to look at. The same command continues "
        "where it was interrupted.",
        epilog=examples(
            "splitnerf prepare photos --out data",
            "splitnerf prepare turn.mp4 --frames 150 --out data",
            "splitnerf prepare photos --masks masks --max-size 1600 --out data",
        ),
    )
    add = parser.add_argument
    add("photos", type=Path, metavar="PHOTOS", help="folder of photos, or a video file")
    add("--out", type=Path, required=True, metavar="DATA", help="folder to write")
    add("--masks", type=Path, metavar="DIR", help="masks of the photos, NAME.png, white on the object")
    add("--max-size", type=int, default=0, metavar="N", help="longest edge in pixels (0: the photos')")
    add("--frames", type=int, default=100, metavar="N", help="frames taken of a video (default: 100)")
    add(
        "--turntable",
        action="store_true",
        help="the object turned before a camera on a stand, which may be moved up and down: features are taken of what "
        "moves, and each photo gets the rotation of its light",
    )
    add("--seed", type=int, default=0, help="seed of all random choices (default: 0)")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    missing = [name for module, name in PACKAGES.items() if find_spec(module) is None]
    if missing:
        raise InputError(f"prepare needs {' and '.join(missing)}; pip install 'splitnerf[photos]'")
    if not 0 <= args.seed < 1 << 31:
        raise InputError(f"--seed must be at least 0 and less than {1 << 31}, got {args.seed}")
    if args.frames < 3 or args.max_size < 0:
        wrong = f"--frames must be at least 3, got {args.frames}"
        raise InputError(wrong if args.frames < 3 else f"--max-size must not be negative, got {args.max_size}")
    from splitnerf.progress import Progress, ended_by_signals

    from splitnerf_tools.capture.prepare import PrepareSettings, prepare

    settings = PrepareSettings(args.max_size, args.masks, args.frames, args.seed, args.turntable)
    steps = STEPS | ({"masks": GIVEN_MASKS} if args.masks else {})
    with ended_by_signals(), Progress(0.0) as bar:  # again: pycolmap, just imported, has taken SIGTERM
        most = 0.0

        def report(step: str, share: float) -> None:
            nonlocal most
            done = sum(list(steps.values())[: list(steps).index(step)]) + share * steps[step]
            most = max(most, min(done / sum(steps.values()), 1.0))  # cameras may be searched for again
            bar.show(most, step)

        try:
            scene, left_out = prepare(args.photos, args.out, settings, report)
        except KeyboardInterrupt:
            raise KeyboardInterrupt("interrupted; the same command continues: features and matches are kept") from None
    n, lost = len(scene.names), len(left_out)
    print(f"{n} of {n + lost} photos, reprojection error {scene.error:.2f} pixels: {args.out}")
    print(f"look at {args.out / 'prepare.html'}, then: splitnerf train {args.out}")
    return DONE
