"""splitnerf export."""

from __future__ import annotations

import argparse
from pathlib import Path

from splitnerf.cli.exit_codes import DONE
from splitnerf.errors import InputError

MAX_TEXTURE_SIZE = 8192
MIN_FACES = 100


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "export", help="write a run's textured mesh and light",
        description="Writes mesh.glb (watertight where the object is, decimated, UV-unwrapped, with albedo, "
        "occlusion-roughness-metallic and normal textures), mesh.ply (full resolution, vertex colours), environment.exr "
        "and environment.hdr. Components with less than 1 % of the largest one's faces are dropped.",
    )  # fmt: skip
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--out", type=Path, metavar="DIR", help="where to write (default: RUN)")
    parser.add_argument("--faces", type=int, default=50000, metavar="N", help="faces of the textured mesh, 0 keeps all (default: 50000)")
    parser.add_argument("--texture-size", type=int, default=2048, metavar="N", help="texels along an edge (default: 2048)")
    parser.add_argument("--resolution", type=int, metavar="N", help="nodes along an edge of the grid that is meshed (default: the run's export_resolution)")
    parser.add_argument("--formats", default="glb,ply", metavar="LIST", help="of glb, ply, obj and usdz, by commas (default: glb,ply); usdz needs the extra 'usd'")
    parser.add_argument("--data", type=Path, metavar="DATA", help="the data that RUN was trained on, for runs of older versions")
    parser.add_argument("--downscale", type=int, default=1, metavar="N", help="as in training, with --data (default: 1)")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.config import MIN_EXPORT_SIZE
    from splitnerf.outputs import FORMATS
    from splitnerf.workflow import export_run

    formats = [name.strip() for name in args.formats.split(",")]
    unknown = [name for name in formats if name not in FORMATS]
    if unknown:
        raise InputError(f"--formats: unknown {unknown[0]!r}; there are {', '.join(FORMATS)}")
    if args.faces != 0 and args.faces < MIN_FACES:
        raise InputError(f"--faces must be 0 or at least {MIN_FACES}, got {args.faces}")
    if not MIN_EXPORT_SIZE <= args.texture_size <= MAX_TEXTURE_SIZE:
        raise InputError(f"--texture-size must be in [{MIN_EXPORT_SIZE}, {MAX_TEXTURE_SIZE}], got {args.texture_size}")
    if args.resolution is not None and args.resolution < MIN_EXPORT_SIZE:
        raise InputError(f"--resolution must be at least {MIN_EXPORT_SIZE}, got {args.resolution}")
    out = args.out or args.run
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; give --out a folder")
    exported = export_run(
        args.run, out, formats=formats, n_faces=args.faces, texture_size=args.texture_size, resolution=args.resolution,
        data=args.data, downscale=args.downscale,
    )  # fmt: skip
    closed = "watertight" if exported.watertight else "not watertight"
    plural = "" if exported.n_dropped == 1 else "s"
    print(f"mesh: {closed}, {exported.n_faces} faces of {len(exported.mesh.faces)}, {exported.n_dropped} floating component{plural} dropped")
    print(f"results: {', '.join(str(out / f'mesh.{name}') for name in formats)}, {out / 'environment.exr'}")
    return DONE
