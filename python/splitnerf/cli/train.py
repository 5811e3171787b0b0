"""splitnerf train."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from splitnerf.cli.common import (
    DONE,
    INTERRUPTED,
    Stages,
    add_reading_options,
    examples,
    print_scores,
    print_summary,
    reading_options,
)
from splitnerf.errors import InputError
from splitnerf.plugins import installed

if TYPE_CHECKING:
    from splitnerf.training.observer import Observer


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "train",
        help="reconstruct an object from photographs with known cameras",
        description="Trains on DATA (transforms files, COLMAP's, NeuS's and other layouts, see docs/data.md), fits the exported asset and its light "
        "to the photos, and writes mesh.glb, mesh.ply, environment.exr/.hdr, evaluation.json and "
        "report.html into the run's folder.",
        epilog=examples(
            "splitnerf train data --max-minutes 30",
            "splitnerf train data --preset fast --downscale 2 --out runs/fast",
            "splitnerf train data --resume auto --view",
            after="A loss that is not finite stops the run, and so do ten gradients in a row that are not; one such gradient alone skips "
            "its step. The message names its origin; --resume continues from the last checkpoint.",
        ),
    )
    add = parser.add_argument
    add("data", type=Path, metavar="DATA", help="folder of photographs with cameras; without masks the object is found")
    add("--out", type=Path, metavar="RUN", help="the run's folder (default: runs/<data name>)")
    add_training_options(parser)
    add("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    add_reading_options(parser)
    add(
        "--resume",
        nargs="?",
        const=True,
        choices=["auto"],
        metavar="auto",
        help="continue the run in --out from its checkpoint; auto: begin where there is none, leave a finished run alone",
    )
    add("--overwrite", action="store_true", help="replace the run in --out")
    add("--view", nargs="?", const=0, type=port, metavar="PORT", help="show the run in a page while it trains")
    add("--tensorboard", type=Path, metavar="DIR", help="write the curves and previews for TensorBoard, too")
    parser.set_defaults(execute=run)


def port(text: str) -> int:
    """A port's number; 0 is a free one."""
    if not (text.isascii() and text.isdigit() and int(text) < 1 << 16):
        raise argparse.ArgumentTypeError(f"PORT must lie between 0 and 65535, got '{text}'; give DATA before --view")
    return int(text)


def add_training_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "--preset",
        choices=["cpu", "fast", "paper"],
        help="cpu: small, for a few cores (default there); fast: for a GPU (default there); paper: the publication's settings",
    )
    add("--steps", type=int, metavar="N", help="optimiser steps; the schedule adapts to them")
    add("--max-minutes", type=float, metavar="M", help="time of training and refinement; the schedule adapts to it")
    add(
        "--device",
        choices=["auto", "cpu", "cuda"],
        default="auto",
        help="where to train; auto: on the GPU if it passes the operators' test, else on the CPU (default: auto)",
    )
    add("--seed", type=int, help="of all random numbers (default: 0)")
    add(
        "--deterministic",
        action="store_true",
        help="two runs with one seed give the same bits, on one machine with one number of threads",
    )
    add("--no-refine", action="store_true", help="deliver what training exports, and give training all minutes")
    add(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="settings",
        help="change a setting (see `splitnerf info --settings`)",
    )


def run(args: argparse.Namespace) -> int:
    from splitnerf.data.frames import layout_of, what_is_in
    from splitnerf.files import locked

    if args.resume and args.overwrite:
        raise InputError("--resume and --overwrite exclude each other")
    if layout_of(args.data) is None and (instead := what_is_in(args.data)):
        raise InputError(f"{args.data}: {instead}")
    run, settings = args.out or Path("runs") / args.data.resolve().name, settings_of(args)
    with ExitStack() as stack:
        observers = list(map(stack.enter_context, observers_of(args, run)))
        stack.enter_context(locked(run))
        return train_in(run, args, settings, observers)


def observers_of(args: argparse.Namespace, run: Path) -> list[AbstractContextManager[Observer]]:
    """The observers that the options request."""
    found = []
    if args.tensorboard:
        from splitnerf.training.observer import TensorBoard

        found.append(TensorBoard(args.tensorboard))
    if args.view is not None:
        if (watch := installed().watch) is None:
            raise InputError("--view: the package splitnerf_tools, which shows a training, is not there; leave it out")
        found.append(watch(run.resolve().name, args.view))
    return found


def settings_of(args: argparse.Namespace) -> dict[str, object]:
    """The settings that the options give, by name."""
    from splitnerf.config import parse_setting

    settings = dict(parse_setting(text) for text in args.settings)
    settings |= budget(args.steps, args.max_minutes) | reading_options(args)
    if args.seed is not None:
        settings["run.seed"] = args.seed
    if args.no_refine:
        settings["refinement.enabled"] = False
    if args.deterministic:
        settings["run.deterministic"] = True
    return settings


def train_in(
    run: Path, args: argparse.Namespace, settings: dict[str, object], observers: Sequence[Observer] = ()
) -> int:
    """Trains in a locked folder, calls the observers, prints the outcome and returns the exit code. Raises InputError where the
    options do not fit the existing run."""
    from splitnerf.config import preset
    from splitnerf.devices import choose_device
    from splitnerf.evaluate.scoring import read_evaluation
    from splitnerf.pipeline import reconstruct
    from splitnerf.run_folder import begin_or_resume, is_finished
    from splitnerf.training.checkpoint import config_of, load_checkpoint
    from splitnerf.training.observer import Event, together

    resume, overwrite = begin_or_resume(run) if args.resume == "auto" else (bool(args.resume), args.overwrite)
    begun = config_of(load_checkpoint(run / "checkpoint.pt")) if resume else None
    repeatable = (begun or preset("cpu")).replace(settings).run.deterministic
    device = choose_device(device_for(args.device, repeatable))
    base = begun or preset(args.preset or ("cpu" if device.type == "cpu" else "fast"))
    if begun and args.preset and not (args.resume == "auto" and args.preset == base.run.preset):
        raise InputError("--preset cannot change in a run that is resumed")
    config, observer = base.replace(settings), together([Stages(), *observers])
    if args.resume == "auto" and config == base and is_finished(run):
        observer(Event("evaluation", path=run))
        print(f"{run}: is finished")
        print_scores(read_evaluation(run))
        return DONE
    options = {"downscale": args.downscale, "device": device, "resume": resume, "overwrite": overwrite}
    try:
        trained, evaluation = reconstruct(args.data, run, config, observer=observer, **options)
    except KeyboardInterrupt:
        if (run / "checkpoint.pt").is_file():
            raise
        again = "" if args.resume or args.overwrite else " with --overwrite"
        raise KeyboardInterrupt(f"interrupted, nothing to continue from; repeat the command{again}") from None
    if evaluation is None:
        where = "in the refinement" if trained.finished else f"at step {trained.step}"
        print(f"stopped {where}; the state is in {run}. To continue, repeat the command with --resume.")
        return INTERRUPTED
    print_summary(run, evaluation, trained.step, trained.seconds, device.type)
    return DONE


def device_for(wanted: str, deterministic: bool) -> str:
    """The name of the requested device; for ``auto`` of a usable one, with a note on the reason where torch finds a
    GPU."""
    import torch

    from splitnerf.devices import fit_device
    from splitnerf.errors import note

    if wanted != "auto":
        return wanted
    device, why = ("cpu", "no GPU repeats bits") if deterministic else fit_device(installed().failing_operators)
    if torch.cuda.is_available():
        note(f"trains on the {'GPU' if device == 'cuda' else 'CPU'}: {why}")
    return device


def budget(steps: int | None, minutes: float | None, option: str = "--max-minutes") -> dict[str, object]:
    """The settings that end a run: steps, minutes, or both. Raises InputError where the minutes, of this option, are not
    positive."""
    from splitnerf.config.settings import UNLIMITED

    if minutes is not None and not minutes > 0:
        raise InputError(f"{option} must be positive, got {minutes}")
    if minutes is None:
        return {} if steps is None else {"run.steps": steps, "run.max_minutes": 0.0}
    return {"run.steps": UNLIMITED if steps is None else steps, "run.max_minutes": minutes}
