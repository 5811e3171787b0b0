"""splitnerf batch."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from splitnerf.cli.exit_codes import DONE, FAILED, INTERRUPTED
from splitnerf.cli.help import examples
from splitnerf.cli.reading import add_reading_options
from splitnerf.cli.train import add_training_options, settings_of
from splitnerf.errors import InputError, escaped
from splitnerf.progress import Progress

if TYPE_CHECKING:
    from splitnerf_tools.batch.job import Batch, Told


def training_options() -> argparse.ArgumentParser:
    """The options that go to each scene's `splitnerf train`."""
    parser = argparse.ArgumentParser(add_help=False)
    group = parser.add_argument_group("options of each scene's `splitnerf train`")
    add_training_options(group)
    group.add_argument("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    add_reading_options(group)
    return parser


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "batch", help="reconstruct many scenes, on this machine or on a cluster", parents=[training_options()],
        description="Trains on each of SCENES in a process of its own, DIR/NAME for each, as many at once as the machines of Ray "
        "hold, and writes one table, DIR/batch.md and batch.json. Ctrl-C saves the state of all; the same command continues. Needs "
        "pip install 'splitnerf[batch]'.",
        epilog=examples(
            "splitnerf batch scenes/* --out runs/all --max-minutes 30",
            "splitnerf batch scenes/* --out runs/all --max-minutes 30 --address 10.0.0.1:6379",
        ),
    )  # fmt: skip
    parser.add_argument("scenes", type=Path, nargs="+", metavar="SCENES", help="folders of posed images")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder of the runs and of the table")
    parser.add_argument("--address", metavar="HOST:PORT", help="the Ray cluster to use (default: Ray is started here)")
    parser.add_argument("--cores-per-scene", type=float, metavar="N", help="default: all cores, divided among the scenes")
    parser.add_argument("--gpus-per-scene", type=float, metavar="N", help="default: 0.25 where there are GPUs; preset paper: 1")
    parser.add_argument("--memory-per-scene", type=float, metavar="GB", help="default: 4; photos may take all but 2.15 of it")
    parser.add_argument("--retries", type=int, default=3, metavar="N", help="of a scene whose process was killed (default: 3)")
    parser.add_argument(
        "--retry-refused", action="store_true", help="try again what was refused and has not changed"
    )
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.data.frames import refuse_data
    from splitnerf.files import locked
    from splitnerf_tools.batch.cluster import machines_of, n_at_once, ray_on, share_of
    from splitnerf_tools.batch.job import Batch, run_batch
    from splitnerf_tools.batch.scenes import asked_scenes, known_scenes

    check_usage(args)
    refuse_data(args.out)
    options = given_options(args)
    with locked(args.out):
        known = known_scenes(args.out)
        asked = asked_scenes(known, args.scenes, options)
        batch = Batch(args.out, known, asked, options, args.retries, args.retry_refused)
        left = batch.left()
        all_ended = True
        with shown(batch, len(left)) as told:
            for scene in asked:
                if scene not in left:
                    told.row(scene)
            if left:
                with ray_on(args.address, args.out) as ray:
                    machines = machines_of(ray)
                    share = share_of(
                        machines, len(left), cores=args.cores_per_scene, gpus=args.gpus_per_scene,
                        memory=args.memory_per_scene, photos=args.max_memory, whole_gpu=args.preset == "paper",
                    )  # fmt: skip
                    at_once = min(n_at_once(machines, share), len(left))
                    told.note(f"{len(left)} to do, {at_once} at a time, {share} each")
                    all_ended = run_batch(ray, batch, left, share, told)
        return conclusion(batch, all_ended)


def check_usage(args: argparse.Namespace) -> None:
    """Raises InputError where an option makes no sense, before a scene begins."""
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
        if action.help == argparse.SUPPRESS or value == action.default:  # the former is another name of an option
            continue
        if isinstance(action, argparse._StoreTrueAction):
            words.append(action.option_strings[0])
        else:
            words += [f"{action.option_strings[0]}={part}" for part in (value if isinstance(value, list) else [value])]
    return words


@contextmanager
def shown(batch: Batch, n_left: int) -> Iterator[Told]:
    """Prints the table's rows as they come, under its head, and beside them what goes on."""
    from splitnerf_tools.batch.job import Told
    from splitnerf_tools.batch.table import Rows

    rows, out, err = Rows(batch.asked), sys.stdout, sys.stderr  # Ray's words go elsewhere, see ray_on
    with Progress(1.0 - n_left / len(batch.asked), leave=False) if n_left else nullcontext() as bar:

        def say(text: str, stream: TextIO) -> None:
            with bar.aside() if bar else nullcontext():
                print(escaped(text), file=stream, flush=True)

        say(rows.head(), out)
        yield Told(
            row=lambda scene: say(rows.row(scene), out),
            note=lambda text: say(f"splitnerf: note: {text}", err),
            show=bar.show if bar else lambda share, told: None,
        )


def conclusion(batch: Batch, all_ended: bool) -> int:
    """Prints how many scenes ended how, and what to do about it; returns the exit code."""
    from splitnerf_tools.batch.scenes import DONE as SCENE_DONE
    from splitnerf_tools.batch.scenes import LOGS, REFUSED, TABLE
    from splitnerf_tools.batch.table import UNITS

    counts = Counter(scene.state for scene in batch.asked)
    print(f"{', '.join(f'{count} {state}' for state, count in counts.items())} ({UNITS}); table: {batch.out / TABLE}")
    if not all_ended:
        print("stopped; to continue, repeat the command.")
        return INTERRUPTED
    if counts[SCENE_DONE] == len(batch.asked):
        return DONE
    if counts[REFUSED]:
        print("a refused scene is tried again when its files have changed, or with --retry-refused")
    print(f"output of each scene: {batch.out / LOGS}")
    return FAILED
