"""splitnerf evaluate."""

from __future__ import annotations

import argparse
from pathlib import Path

from splitnerf.cli.common import DONE, add_reading_options, examples, print_scores, reading_of
from splitnerf.errors import InputError

NEEDS_DATA = ("out", "sheet", "views", "lights", "maps", "env", "lpips")


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "evaluate",
        help="score runs or GLB files against the truth, and put the scores into a table",
        description="Path-traces the test views of DATA, of the asset that RUN's refinement fitted or of a GLB file (a RUN "
        "without refinement is rendered from its checkpoint), relights the asset under the data's maps, and writes "
        "evaluation.json and report.html into RUN (for a file FILE_evaluation.json next to it). Without --data it reads the "
        "scores written before, for --table.",
        epilog=examples(
            "splitnerf evaluate runs/a --data data",
            "splitnerf evaluate runs/a runs/b --table table.md",
            "splitnerf evaluate runs/a --data hotdog --lights low --maps lights",
        ),
    )
    add = parser.add_argument
    add("targets", type=Path, nargs="+", metavar="RUN|FILE.glb")
    add(
        "--data",
        type=Path,
        action="append",
        metavar="DATA",
        help="the data that RUN was trained on (default, with options that need them: where they were); once, or once for each RUN",
    )
    add(
        "--downscale",
        type=int,
        metavar="N",
        help="average images down by N (default: as in training; 1 for a file outside a run's own folder)",
    )
    add_reading_options(parser, "as in training")
    add("--spp", type=int, default=128, metavar="N", help="paths a pixel of what is path traced (default: 128)")
    add("--views", type=int, metavar="N", help="test views, evenly spread (default: all; 20 with --lights)")
    add(
        "--lights",
        choices=["low", "high"],
        help="a published relighting protocol, 20 views: low, 8 low-frequency probes; high, 7 maps",
    )
    add(
        "--maps",
        type=Path,
        metavar="FOLDER",
        help="folder of .hdr or .exr maps that DATA has relit images of (default: DATA's relight_*.hdr)",
    )
    add(
        "--env",
        type=Path,
        metavar="MAP",
        help="the light of the photos, for a GLB file (default: the environment.exr or .hdr in its folder)",
    )
    add(
        "--lpips",
        type=Path,
        metavar="VGG16.pth",
        help="compute LPIPS, too, with these weights; needs the package lpips",
    )
    add("--out", type=Path, metavar="FILE.json", help="where to write the scores of one RUN; leaves RUN untouched")
    add("--table", type=Path, metavar="OUT.md", help="write all scores as a markdown table, with their mean")
    add("--sheet", type=Path, metavar="SHEET.png", help="write pictures of one RUN: truth, prediction, error")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    check_usage(args)
    from splitnerf.evaluate.lpips import SOURCE
    from splitnerf.evaluate.scoring import read_evaluation
    from splitnerf.run_folder import refuse_no_run

    data = args.data or []
    evaluations = []
    for i, target in enumerate(args.targets):
        if data:
            scores = evaluate_target(target, data[min(i, len(data) - 1)], args)
        else:
            if target.is_dir():
                refuse_no_run(target)
            scores = read_evaluation(target)
        evaluations.append((scene_name(target), scores))
        if len(args.targets) > 1:
            print(f"{target}:")
        print_scores(scores)
        if args.lights == "low":
            from splitnerf.evaluate.score_table import table_of_lights

            print(table_of_lights(scores, scene_name(target)))
        if args.lights and scores["relight"]["lpips"] is None:
            print(f"note: LPIPS was not computed; give --lpips {Path(SOURCE).name}, from {SOURCE}")
    if args.table:
        from splitnerf.evaluate.score_table import evaluation_table
        from splitnerf.files import atomic_path

        with atomic_path(args.table) as temporary:
            temporary.write_text(evaluation_table(evaluations), encoding="utf-8", errors="backslashreplace")
        print(f"table: {args.table}")
    return DONE


def check_usage(args: argparse.Namespace) -> None:
    """Refuses options that exclude each other, and files of other kinds in the place of results. Raises InputError
    where two options exclude each other, or a file would be lost; the message names them."""
    from splitnerf.evaluate.scoring import evaluation_path, is_asset
    from splitnerf.files import refuse_others
    from splitnerf.run_folder import data_of

    given = [name for name in NEEDS_DATA if getattr(args, name) is not None]
    if not args.data and given:
        known = [data_of(target) if target.is_dir() else None for target in args.targets]
        if None in known:
            raise InputError(f"--{given[0]} needs --data; without it the scores written before are read")
        args.data = [data for data, _ in known]
    if args.data and len(args.data) not in (1, len(args.targets)):
        raise InputError(
            f"--data was given {len(args.data)} times for {len(args.targets)} runs; give it once, or once each"
        )
    for name in ("out", "sheet"):
        if getattr(args, name) is not None and len(args.targets) > 1:
            raise InputError(f"--{name} takes one run, got {len(args.targets)}; evaluate them one by one")
    if args.sheet is not None and args.sheet.suffix.lower() not in (".png", ".jpg"):
        raise InputError(f"{args.sheet}: a sheet must end in .png or .jpg")
    if args.sheet is not None and args.sheet.exists():
        raise InputError(f"{args.sheet}: exists, and would be replaced; give another --sheet")
    assets = [target for target in args.targets if is_asset(target) and args.data]  # a run's scores are in its folder
    if args.table:
        refuse_others(args.table, b"| scene |", option="--table")
    for path in [args.out] if args.out else map(evaluation_path, assets):
        refuse_others(path, b'"novel_view"')


def evaluate_target(target: Path, data: Path, args: argparse.Namespace) -> dict:
    """Scores one run or file, writes the requested files, and returns the scores."""
    from splitnerf.data.json_files import write_json
    from splitnerf.evaluate.scoring import Protocol, evaluate_asset, evaluation_path, is_asset
    from splitnerf.pipeline import evaluate_run
    from splitnerf.run_folder import data_of

    _, trained_at = data_of(target if target.is_dir() else target.parent) or (None, 1)
    downscale = trained_at if args.downscale is None else args.downscale
    protocol = Protocol(downscale, args.views, args.spp, args.lights, args.maps, reading_of(args, target), args.lpips)
    if is_asset(target):
        evaluated = evaluate_asset(target, data, protocol, args.env)
        write_json(args.out or evaluation_path(target), evaluated.scores)
    elif args.env is not None:
        raise InputError(f"{target}: is no GLB file, and a run has its own light; leave --env out")
    else:
        evaluated = evaluate_run(target, data, protocol, args.out)
    if args.sheet:
        from splitnerf.evaluate.sheet import write_sheet

        write_sheet(args.sheet, evaluated)
        print(f"sheet: {args.sheet}")
    return evaluated.scores


def scene_name(target: Path) -> str:
    """The name of a run or a file in tables."""
    target = target.resolve()
    return f"{target.parent.name}/{target.name}" if target.is_file() else target.name
