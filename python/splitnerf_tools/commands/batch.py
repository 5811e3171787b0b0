"""splitnerf batch."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from splitnerf.cli.common import DONE, FAILED, INTERRUPTED, add_reading_options, examples
from splitnerf.cli.train import add_training_options, settings_of
from splitnerf.errors import InputError, escaped

if TYPE_CHECKING:
    from splitnerf_tools.batch.scenes import Scene


def training_options() -> argparse.ArgumentParser:
    """The options of each scene's `splitnerf train`."""
    parser = argparse.ArgumentParser(add_help=False)
    group = parser.add_argument_group("options of each scene's `splitnerf train`")
    add_training_options(group)
    group.add_argument("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    add_reading_options(group)
    return parser


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "batch",
        help="reconstruct many scenes, on this machine or on a cluster",
        parents=[training_options()],
        description="Trains on each of SCENES in a process of its own, DIR/NAME for each, as many at once as the machines of Ray "
        "hold, and writes one table, DIR/batch.md and batch.json. Ctrl-C saves the state of all; the same command goes on. Needs "
        "pip install 'splitnerf[batch]'.",
        epilog=examples(
            "splitnerf batch scenes/* --out runs/all --max-minutes 30",
            "splitnerf batch scenes/* --out runs/all --max-minutes 30 --address 10.0.0.1:6379",
        ),
    )
    add = parser.add_argument
    add("scenes", type=Path, nargs="+", metavar="SCENES", help="folders of photographs with cameras")
    add("--out", type=Path, required=True, metavar="DIR", help="the folder of the runs and of the table")
    add("--address", metavar="HOST:PORT", help="the Ray cluster to use (default: Ray is started here)")
    add("--cores-per-scene", type=float, metavar="N", help="default: all cores, divided among the scenes")
    add("--gpus-per-scene", type=float, metavar="N", help="default: 0.25 where there are GPUs; preset paper: 1")
    add("--memory-per-scene", type=float, metavar="GB", help="default: 4; photos may take all but 2.15 of it")
    add("--retries", type=int, default=3, metavar="N", help="of a scene whose process was killed (default: 3)")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.data.frames import refuse_data
    from splitnerf.files import locked, refuse_foreign, refuse_others

    from splitnerf_tools.batch.cluster import machines_of, ray_on, share_of
    from splitnerf_tools.batch.scenes import DONE as SCENE_DONE
    from splitnerf_tools.batch.scenes import LOGS, STATE, TABLE, UNITS, known_scenes, requested_scenes, terminal_row
    from splitnerf_tools.batch.tasks import BatchPlan, run_batch

    check_usage(args)
    refuse_data(args.out)
    with locked(args.out):
        known = known_scenes(args.out)
        refuse_others(args.out / STATE, b'"scenes"', args.out / TABLE)
        refuse_foreign(args.out / LOGS)
        requested = requested_scenes(known, args.scenes)
        out, err = sys.stdout, sys.stderr  # Ray's output goes elsewhere, see ray_on

        def note(text: str) -> None:
            print(f"splitnerf: note: {escaped(text)}", file=err, flush=True)

        def row(scene: Scene) -> None:
            print(escaped(terminal_row(scene)), file=out, flush=True)

        batch = BatchPlan(args.out, known, requested, given_options(args), args.retries, row, note)
        with ray_on(args.address, args.out) as ray:
            share = share_of(
                machines_of(ray),
                len(requested),
                cores=args.cores_per_scene,
                gpus=args.gpus_per_scene,
                memory=args.memory_per_scene,
                photos=args.max_memory,
                whole_gpu=args.preset == "paper",
            )
            note(f"{len(requested)} scenes, {share} each")
            print(terminal_row(), file=out, flush=True)
            all_ended = run_batch(ray, batch, share)
    counts = Counter(scene.state for scene in requested)
    print(f"{', '.join(f'{count} {state}' for state, count in counts.items())} ({UNITS}); table: {args.out / TABLE}")
    if not all_ended:
        print("stopped; to continue, repeat the command.")
        return INTERRUPTED
    if counts[SCENE_DONE] == len(requested):
        return DONE
    print(f"what each scene said: {args.out / LOGS}")
    return FAILED


def check_usage(args: argparse.Namespace) -> None:
    """Raises InputError where an option is invalid, before a scene begins."""
    from splitnerf.config import preset

    for name in ("cores_per_scene", "memory_per_scene"):
        if getattr(args, name) is not None and not getattr(args, name) > 0:
            raise InputError(f"--{name.replace('_', '-')} must be positive, got {getattr(args, name)}")
    for name, value in (("gpus-per-scene", args.gpus_per_scene), ("retries", args.retries)):
        if value is not None and not value >= 0:
            raise InputError(f"--{name} must not be negative, got {value}")
    preset(args.preset or "cpu").replace(settings_of(args))


def given_options(args: argparse.Namespace) -> list[str]:
    """The options for `splitnerf train` that differ from their defaults, as words."""
    words = []
    for action in training_options()._actions:
        value = getattr(args, action.dest)
        if value != action.default and isinstance(action, argparse._StoreTrueAction):
            words.append(action.option_strings[0])
        elif value != action.default:
            words += [f"{action.option_strings[0]}={part}" for part in (value if isinstance(value, list) else [value])]
    return words
