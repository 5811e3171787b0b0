"""The command line: ``splitnerf train | demo | evaluate | info``.

Exit codes: 0 done, 1 failed, 2 bad input or usage, 130 interrupted (state saved).
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import splitnerf
from splitnerf.errors import InputError

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
UNLIMITED_STEPS = 10**9


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="splitnerf", description="From posed images of one object to a mesh, PBR materials and the HDR environment."
    )
    parser.add_argument("--version", action="version", version=f"splitnerf {splitnerf.__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    train = commands.add_parser(
        "train", help="reconstruct an object from posed images",
        description="Trains on DATA (NeRF-Blender layout, or a transforms.json with masks) and writes mesh.glb, mesh.ply, "
        "environment.exr/.hdr, evaluation.json and report.html into the run's folder.",
    )  # fmt: skip
    train.add_argument("data", type=Path, metavar="DATA", help="folder with transforms_train.json or transforms.json")
    train.add_argument("--out", type=Path, metavar="RUN", help="the run's folder (default: runs/<data name>)")
    _add_training_options(train)
    train.add_argument("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    train.add_argument("--resume", action="store_true", help="continue the run in --out from its checkpoint")
    train.add_argument("--overwrite", action="store_true", help="replace a run that stands in --out")

    demo = commands.add_parser(
        "demo", help="render a small scene, reconstruct it and print the errors against its truth",
        description="Makes a scene with known shape, materials and sky, renders it with the built-in path tracer, "
        "trains on it and prints the errors. Nothing is downloaded.",
    )  # fmt: skip
    demo.add_argument("--out", type=Path, default=Path("runs/demo"), metavar="RUN", help="the run's folder (default: runs/demo)")
    demo.add_argument("--max-minutes", type=float, default=4.0, metavar="M", help="training time (default: 4)")
    demo.add_argument("--seed", type=int, default=0)

    evaluate = commands.add_parser(
        "evaluate", help="score a run's test views again",
        description="Renders the test views of DATA from RUN's checkpoint and rewrites its assets, evaluation.json and "
        "report.html.",
    )  # fmt: skip
    evaluate.add_argument("run", type=Path, metavar="RUN")
    evaluate.add_argument("--data", type=Path, required=True, metavar="DATA", help="the data that RUN was trained on")
    evaluate.add_argument("--downscale", type=int, default=1, metavar="N", help="as in training (default: 1)")

    info = commands.add_parser("info", help="show versions, the build, and the settings of a preset")
    info.add_argument("--settings", metavar="PRESET", nargs="?", const="cpu", help="print every setting of a preset (default: cpu)")
    return parser


def _add_training_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--preset", choices=["cpu", "paper"], help="cpu: small, for a few cores (default); paper: the publication's settings")
    parser.add_argument("--steps", type=int, metavar="N", help="optimiser steps; the schedule fits itself to them")
    parser.add_argument("--max-minutes", type=float, metavar="M", help="training time; the schedule fits itself to it")
    parser.add_argument("--device", choices=["cpu"], default="cpu", help="where to train (the operators run on the CPU)")
    parser.add_argument("--seed", type=int, help="of all random numbers (default: 0)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings", help="change one setting; `splitnerf info --settings` lists them")


def run_train(args: argparse.Namespace) -> int:
    from splitnerf.checkpoint import config_of, load_checkpoint
    from splitnerf.config import parse_setting, preset
    from splitnerf.workflow import reconstruct

    if args.resume and args.overwrite:
        raise InputError("--resume and --overwrite exclude each other")
    if args.max_minutes is not None and args.max_minutes <= 0:
        raise InputError(f"--max-minutes must be positive, got {args.max_minutes}")
    run = args.out or Path("runs") / args.data.resolve().name
    settings = dict(parse_setting(text) for text in args.settings)
    settings |= _budget(args.steps, args.max_minutes)
    if args.seed is not None:
        settings["seed"] = args.seed
    if args.resume:
        if args.preset:
            raise InputError("--preset cannot change in a run that is resumed")
        base = config_of(load_checkpoint(run / "checkpoint.pt"))
    else:
        base = preset(args.preset or "cpu")
    trained, evaluation = reconstruct(
        args.data, run, base.replace(settings), downscale=args.downscale, resume=args.resume, overwrite=args.overwrite
    )
    if evaluation is None:
        print(f"stopped at step {trained.step}; the state is in {run}. To go on, repeat the command with --resume.")
        return INTERRUPTED
    print_summary(run, evaluation, trained.step, trained.seconds)
    return DONE


def _budget(steps: int | None, minutes: float | None) -> dict[str, object]:
    """The settings that end a run: of steps and minutes what was asked for alone counts, both count together."""
    if minutes is None:
        return {} if steps is None else {"steps": steps, "max_minutes": 0.0}
    return {"steps": UNLIMITED_STEPS if steps is None else steps, "max_minutes": minutes}


def run_demo(args: argparse.Namespace) -> int:
    from splitnerf.config import preset
    from splitnerf.demo.scene import write_demo_dataset
    from splitnerf.workflow import prepare_run, reconstruct

    prepare_run(args.out, resume=False, overwrite=True)
    data = args.out / "data"
    print(f"rendering the demo scene into {data} ...", file=sys.stderr)
    write_demo_dataset(data, seed=args.seed)
    config = preset("cpu").replace({"seed": args.seed, **_budget(None, args.max_minutes)})
    trained, evaluation = reconstruct(data, args.out, config, overwrite=True)
    if evaluation is None:
        print("stopped; run the demo again to start over.")
        return INTERRUPTED
    print_summary(args.out, evaluation, trained.step, trained.seconds)
    return DONE


def run_evaluate(args: argparse.Namespace) -> int:
    from splitnerf.workflow import evaluate_run

    print_summary(args.run, evaluate_run(args.run, args.data, args.downscale))
    return DONE


def run_info(args: argparse.Namespace) -> int:
    import dataclasses

    import torch

    from splitnerf import _core
    from splitnerf.config import preset

    if args.settings:
        for key, value in dataclasses.asdict(preset(args.settings)).items():
            print(f"{key} = {value!r}")
        return DONE
    print(f"splitnerf {splitnerf.__version__}")
    print(f"torch {torch.__version__}, {torch.get_num_threads()} threads")
    print(f"kernels: {_core.instruction_set()}")
    print(f"ray tracing: {'Embree ' + _core.embree_version() if _core.embree_version() else 'embreex (build without Embree)'}")
    return DONE


def print_summary(run: Path, evaluation: dict, step: int | None = None, seconds: float | None = None) -> None:
    """The errors against whatever truth the data hold, and where the results lie."""
    if step is not None and seconds is not None:
        print(f"{step} steps in {seconds:.0f} s")
    rows = [("novel views", evaluation["novel_view"], "dB"), ("albedo", evaluation["albedo"], "dB")]
    for name, part, unit in rows:
        if part:
            scores = part.get("lsq", part)
            print(f"{name:22s} PSNR {scores['psnr']:.2f} {unit}, SSIM {scores['ssim']:.4f}")
    for name, key, unit in (
        ("normals, mean angle", "normal_mae_deg", "degrees"), ("roughness, mean error", "roughness_mae", ""),
        ("metallic, bal. accuracy", "metallic_balanced_accuracy", ""), ("light PSNR", "light_psnr", "dB"),
        ("mesh chamfer", "chamfer", ""), ("mesh F-score", "f_score", ""),
    ):  # fmt: skip
        if evaluation.get(key) is not None:
            print(f"{name:22s} {evaluation[key]:.4g} {unit}".rstrip())
    print(f"results: {run / 'report.html'}, {run / 'mesh.glb'}, {run / 'environment.exr'}")


def main(argv: list[str] | None = None) -> int:
    # torch's OpenMP threads spin for milliseconds before they sleep; on a machine that others use too, each
    # barrier would then wait for a whole time slice. A short spin costs nothing where the machine is ours.
    os.environ.setdefault("GOMP_SPINCOUNT", "30000")
    args = build_parser().parse_args(argv)
    run = {"train": run_train, "demo": run_demo, "evaluate": run_evaluate, "info": run_info}[args.command]
    try:
        return run(args)
    except InputError as error:
        print(f"splitnerf: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("splitnerf: interrupted", file=sys.stderr)
        return INTERRUPTED
    except (RuntimeError, OSError) as error:
        print(f"splitnerf: {error}", file=sys.stderr)
        return FAILED
