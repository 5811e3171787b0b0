"""splitnerf refine."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote

from splitnerf.cli.common import DONE, INTERRUPTED, add_reading_options, examples, reading_of
from splitnerf.errors import InputError


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "refine",
        help="fit an exported asset and its light to the photos: the refinement of train, alone",
        description="Starts from RUN/trained, where the refinement kept what training exported, else from RUN. Moves the "
        "vertices of mesh.glb until its outline is that of the masks, then fits its textures (albedo, roughness, metallic, "
        "normals) and the light of environment.exr to the photos through the path tracer's own model, interreflection "
        "included. Writes mesh.glb, environment.exr and .hdr, and refinement.json into RUN/refined. Ctrl-C "
        "keeps the state there; --resume continues.",
        epilog=examples("splitnerf refine runs/data --minutes 10"),
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="a finished run, or a folder with both files")
    add("--data", type=Path, metavar="DATA", help="the data that RUN was trained on (default: where they were)")
    add("--downscale", type=int, metavar="N", help="average images down by N (default: as in training)")
    add_reading_options(parser, "as in training")
    add("--sweeps", type=int, metavar="N", help="most steps of the fit (default: 16 without --minutes)")
    add("--minutes", type=float, default=0.0, metavar="M", help="begin no step after M (default: no limit)")
    add("--resume", action="store_true", help="continue from the state that an interruption left")
    add("--keep-shape", action="store_true", help="leave the vertices where they are")
    add("--out", type=Path, metavar="DIR", help="where to write (default: RUN/refined)")
    add("--overwrite", action="store_true", help="replace an earlier result in --out")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.config.settings import UNLIMITED
    from splitnerf.refinement.fit import FitSettings
    from splitnerf.refinement.refine import STATE, refine_run, source_of
    from splitnerf.run_folder import REFINED, check_results, data_of, refuse_no_run

    if not args.minutes >= 0:
        raise InputError(f"--minutes must not be negative, got {args.minutes}")
    sweeps = (UNLIMITED if args.minutes > 0 else FitSettings.sweeps) if args.sweeps is None else args.sweeps
    if sweeps < 1:
        raise InputError(f"--sweeps must be at least 1, got {sweeps}")
    if not (args.run / "mesh.glb").is_file():
        refuse_no_run(args.run)
    out = args.out or args.run / REFINED
    if out.resolve() == source_of(args.run).resolve():
        raise InputError(f"{out}: holds the asset to refine, which this would replace; give another --out")
    check_results(out, args.run, overwrite=args.overwrite or (args.resume and (out / STATE).is_file()))
    data, downscale = data_of(args.run) or (None, 1)
    if args.data is None and data is None:
        raise InputError(f"{args.run}: does not say where its data are, or they are gone; give --data")
    settings = FitSettings(sweeps=sweeps, minutes=args.minutes, outline=not args.keep_shape)
    refined = refine_run(
        args.run,
        args.data or data,
        out,
        downscale=downscale if args.downscale is None else args.downscale,
        settings=settings,
        resume=args.resume,
        reading=reading_of(args, args.run),
    )
    if refined is None:
        print(f"stopped; the state is in {out}. To continue, repeat the command with --resume.")
        return INTERRUPTED
    first, last = refined.sweeps[0], refined.sweeps[-1]
    if refined.outline:
        print(f"coverage at the outline, squared error: {refined.outline[0]:.2g} -> {refined.outline[-1]:.2g}")
    print(f"colours, squared error: {first.error:.3g} -> {last.error:.3g} at step {last.number}, {last.seconds:.0f} s")
    print(f"results: {out / 'mesh.glb'}, {out / 'environment.exr'}")
    print(f"look at it: splitnerf view {quote(str(out / 'mesh.glb'))}")
    return DONE
