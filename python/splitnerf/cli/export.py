"""splitnerf export."""

from __future__ import annotations

import argparse
from pathlib import Path

from splitnerf.cli.common import DONE, examples
from splitnerf.errors import InputError

MIN_FACES = 100


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "export",
        help="write a run's textured mesh and light",
        description="Writes what RUN delivers into --out or, without --out or with a size, what it trained, before its refinement: mesh.glb (watertight where the object is, decimated, "
        "UV-unwrapped, with albedo, occlusion-roughness-metallic and normal textures), mesh.ply (full resolution, vertex "
        "colours), environment.exr and environment.hdr. Components with less than 1 % of the largest one's faces and "
        "the walls of cavities are dropped; what no photo shows is a cap between its edges.",
        epilog=examples(
            "splitnerf export runs/data --formats glb,obj --out asset",
            "splitnerf export runs/data --faces 20000 --texture-size 1024 --out small",
            "splitnerf export runs/data --pivot foot --height 0.25 --out vase",
        ),
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN")
    add("--out", type=Path, metavar="DIR", help="where to write (default: RUN, or RUN/trained if it was refined)")
    for option, kind, default, name, text in (
        ("--faces", int, None, "N", "faces of the textured mesh, 0 keeps all (default: as in training)"),
        ("--texture-size", int, None, "N", "texels along an edge (default: as in training)"),
        ("--resolution", int, None, "N", "nodes along an edge of the grid that is meshed (default: as in training)"),
        ("--formats", str, "glb,ply", "LIST", "of glb, ply, obj, usdz (default: glb,ply); usdz needs the extra 'usd'"),
    ):
        add(option, type=kind, default=default, metavar=name, help=text)
    add(
        "--pivot",
        choices=["data", "foot"],
        default="data",
        help="the asset's origin: that of the data (default), or its foot, the middle of its lowest height",
    )
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--scale", type=float, default=1.0, metavar="S", help="units of the files for one of the data's")
    size.add_argument("--height", type=float, metavar="H", help="how high the asset is in the files, in their units")
    add("--overwrite", action="store_true", help="replace an earlier export in --out")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.config import FIELDS
    from splitnerf.export.scene import FORMATS, Placing
    from splitnerf.pipeline import export_run
    from splitnerf.run_folder import export_folder

    formats = [name.strip() for name in args.formats.split(",")]
    unknown = [name for name in formats if name not in FORMATS]
    if unknown:
        raise InputError(f"--formats: unknown {unknown[0]!r}; there are {', '.join(FORMATS)}")
    if args.faces is not None and args.faces != 0 and args.faces < MIN_FACES:
        raise InputError(f"--faces must be 0 or at least {MIN_FACES}, got {args.faces}")
    sizes = {}
    for option in ("faces", "texture_size", "resolution"):
        value, limits = getattr(args, option), FIELDS[f"export.{option}"].metadata["limits"]
        if value is not None and not limits.allow(value):
            raise InputError(f"--{option.replace('_', '-')} must be {limits}, got {value}")
        sizes |= {} if value is None else {f"export.{option}": value}
    for option in ("scale", "height"):
        value = getattr(args, option)
        if value is not None and not 1e-6 <= value <= 1e6:
            raise InputError(f"--{option} must lie between 1e-6 and 1e6, got {value:g}")
    out = args.out or export_folder(args.run)
    if out.exists() and not out.is_dir():  # before the checkpoint is read
        raise InputError(f"{out}: is a file; give --out a folder")
    exported = export_run(
        args.run,
        out,
        formats=formats,
        sizes=sizes,
        placing=Placing(args.pivot == "foot", args.scale, args.height),
        overwrite=args.overwrite,
    )
    closed = "watertight" if exported.watertight else "not watertight"
    dropped = (
        f"{exported.n_dropped} floating, enclosed or unseen component{'' if exported.n_dropped == 1 else 's'} dropped"
    )
    print(f"mesh: {closed}, {exported.n_faces} faces of {len(exported.mesh.faces)}, {dropped}")
    if exported.origin.any() or exported.scale != 1:
        where = ", ".join(f"{x:.6g}" for x in exported.origin)
        print(
            f"placed: origin at ({where}) of the data, times {exported.scale:.6g}; cameras of the data no longer fit it"
        )
    print(f"results: {', '.join(str(out / f'mesh.{name}') for name in formats)}, {out / 'environment.exr'}")
    return DONE
