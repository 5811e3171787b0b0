"""splitnerf ablate."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from splitnerf.cli.common import DONE, INTERRUPTED, examples
from splitnerf.cli.train import budget
from splitnerf.errors import InputError


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "ablate",
        help="measure what each part of the method is worth",
        description="Trains on each DATA with the full method and with one part at a time taken out or exchanged, each for "
        "the same time, and writes ablation.csv, ablation.md and the runs into OUT. Repeat the command to continue.",
        epilog=examples("splitnerf ablate data --minutes 6", "splitnerf ablate --list"),
    )
    add = parser.add_argument
    add("data", type=Path, nargs="*", metavar="DATA")
    add("--out", type=Path, default=Path("runs/ablation"), metavar="OUT", help="default: runs/ablation")
    add("--minutes", type=float, metavar="M", help="training time of each run (default: 6, or --steps)")
    add("--steps", type=int, metavar="N", help="optimiser steps of each run")
    add("--rows", metavar="LIST", help="names of rows, by semicolons (default: all; --list names them)")
    add("--list", action="store_true", help="print the rows and what they set, and train nothing")
    add(
        "--seeds",
        type=int,
        default=1,
        metavar="N",
        help="runs of rows within 0.3 dB of what they are compared with, 3 or more (default: 1)",
    )
    add("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    add("--views", type=int, metavar="N", help="test views to score (default: all)")
    add("--spp", type=int, default=32, metavar="N", help="paths a pixel of relit views (default: 32)")
    add("--lights", choices=["low", "high"], help="a published relighting protocol, 20 views; see evaluate")
    add("--maps", type=Path, metavar="FOLDER", help="folder of maps that DATA has relit images of")
    add("--lpips", type=Path, metavar="VGG16.pth", help="compute LPIPS, too; see evaluate")
    add("--preset", choices=["cpu", "paper"], default="cpu", help="the full method (default: cpu)")
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings", help="change a setting of all rows")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.config import parse_setting, preset

    from splitnerf_tools.ablate.rows import PAPER, SWITCHES, make_rows

    if args.seeds != 1 and args.seeds < 3:
        raise InputError(f"--seeds must be 1, or 3 and more, as two do not show their spread; got {args.seeds}")
    minutes = 6.0 if args.minutes is None and args.steps is None else args.minutes
    settings = dict(parse_setting(text) for text in args.settings) | budget(args.steps, minutes, "--minutes")
    names = None if args.rows is None else [name.strip() for name in args.rows.split(";") if name.strip()]
    rows = make_rows(preset(args.preset).replace({"run.cuda_graphs": False} | settings), names)  # not all rows can
    for name in names or []:
        if all(row.name != name for row in rows):
            print(f"{name}: changes nothing here, left out", file=sys.stderr)
    if args.list:
        for row in rows[1:]:
            print(f"{row.name}: {', '.join(f'{k} = {v}' for k, v in (PAPER | SWITCHES)[row.name].items())}")
        return DONE
    if not args.data:
        raise InputError("give at least one DATA folder, or --list")

    from splitnerf.data.frames import read_frames, refuse_data
    from splitnerf.evaluate.scoring import Protocol
    from splitnerf.files import atomic_path, locked, refuse_others

    from splitnerf_tools.ablate.runs import AblationPlan, Interrupted, ablate
    from splitnerf_tools.ablate.scores import csv_table, markdown_table

    scenes = {scene.resolve().name: scene for scene in args.data}
    if len(scenes) < len(args.data):
        raise InputError("two DATA folders have the same name; ablate them into different --out")

    tables = args.out / "ablation.csv", args.out / "ablation.md"

    def show(scores: list) -> None:
        for path, text in zip(tables, (csv_table(scores), markdown_table(scores))):
            with atomic_path(path) as temporary:
                temporary.write_text(text, encoding="utf-8")

    protocol = Protocol(args.downscale, args.views, args.spp, args.lights, args.maps, lpips=args.lpips)
    plan = AblationPlan(list(scenes.values()), rows, args.seeds, protocol, args.out)
    refuse_data(args.out)
    protocol.distance()
    refuse_others(tables[0], b"scene,row,seed,", tables[1])
    for scene in plan.scenes:  # before the first is trained on
        read_frames(scene, "train", rows[0].config.reading)
    try:
        with locked(args.out):
            scores = ablate(plan, show)
    except Interrupted:
        print(f"stopped; the state is in {args.out}. To continue, repeat the command.")
        return INTERRUPTED
    print(markdown_table(scores))
    print(f"results: {tables[1]}, {tables[0]}")
    return DONE
