"""splitnerf relight."""

from __future__ import annotations

import argparse
from dataclasses import fields
from pathlib import Path

from splitnerf.cli.common import DONE, add_reading_options, examples, reading_of
from splitnerf.errors import InputError


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "relight",
        help="render an asset under other lights",
        description="Path-traces RUN's mesh.glb, or any metallic-roughness glTF file, under environment maps and "
        "writes NNN.png (sRGB, straight alpha) and NNN.exr (linear, associated alpha) for each frame.",
        epilog=examples(
            "splitnerf relight runs/data --env studio --env sunset --out lit",
            "splitnerf relight chair.glb --env studio.hdr --turntable 48 --rotate light --gif --out turn",
        ),
    )
    add = parser.add_argument
    add("source", type=Path, metavar="RUN|FILE.glb", help="a run's folder, a .glb or a .gltf")
    add(
        "--env",
        type=Path,
        action="append",
        required=True,
        metavar="MAP",
        help="equirectangular .exr or .hdr, or a built-in light: studio, overcast, sunny, sunset, window; repeated, each has "
        "a sub-folder",
    )
    add("--rotate-env", type=float, default=0.0, metavar="DEG", help="turn the light, counter-clockwise from above")
    cameras = parser.add_mutually_exclusive_group()
    cameras.add_argument("--turntable", type=int, metavar="N", help="a full turn in N frames (default: 1, the front)")
    cameras.add_argument("--data", type=Path, metavar="DATA", help="the cameras of a data set")
    cameras.add_argument("--path", type=Path, metavar="CAMERAS.json", help="the cameras of a file like transforms.json")
    add("--split", choices=["train", "test"], default="test", help="of --data (default: test)")
    add_reading_options(parser, "as in training")
    add("--elevation", type=float, default=20.0, metavar="DEG", help="of the turntable's camera (default: 20)")
    add("--rotate", choices=["camera", "light"], default="camera", help="what the turntable turns (default: camera)")
    add("--out", type=Path, required=True, metavar="DIR", help="the folder to write to")
    add("--size", metavar="W[xH]", help="pixels (default: the data's or the path's, else 512)")
    add("--spp", type=int, default=128, metavar="N", help="paths a pixel (default: 128)")
    add("--bounces", type=int, default=4, metavar="N", help="scattering events after the first (default: 4)")
    add("--background", default="transparent", metavar="WHAT", help="transparent (default), white, environment, image")
    add("--shadow-catcher", action="store_true", help="show the shadow on the ground below the object")
    add("--exposure", type=float, default=0.0, metavar="EV", help="stops brighter (default: 0)")
    add("--gif", action="store_true", help="write animation.gif too")
    add("--mp4", action="store_true", help="write animation.mp4 too (needs splitnerf[video])")
    add("--fps", type=float, default=12.0, help="of GIF and MP4 (default: 12)")
    add("--seed", type=int, default=0, help="of the first frame's random numbers (default: 0)")
    add("--overwrite", action="store_true", help="replace frames that stand in --out")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.data.asset import Asset
    from splitnerf.relight.cameras import View, data_views, parse_size, path_views, turntable
    from splitnerf.relight.rendering import Settings, relight

    check_ranges(args)
    size = parse_size(args.size) if args.size else None

    def views_of(asset: Asset) -> list[View]:
        if args.data:
            return data_views(args.data, args.split, size, reading_of(args, args.source))
        if args.path:
            return path_views(args.path, size)
        count = 1 if args.turntable is None else args.turntable
        return turntable(asset, count, elevation=args.elevation, rotate=args.rotate, size=size)

    settings = Settings(**{known.name: getattr(args, known.name) for known in fields(Settings)})
    for folder in relight(args.source, args.env, views_of, args.out, settings, overwrite=args.overwrite):
        print(folder)
    return DONE


def check_ranges(args: argparse.Namespace) -> None:
    """Raises InputError where a number is out of its range."""
    from splitnerf.render.path_traced import MOST_SPP

    limits = (
        ("--spp", args.spp, 1, MOST_SPP),
        ("--bounces", args.bounces, 0, 64),
        ("--fps", args.fps, 0.1, 50),
        ("--exposure", args.exposure, -20, 20),
        ("--rotate-env", args.rotate_env, -3600, 3600),
        ("--seed", args.seed, 0, 1 << 31),
    )
    for name, value, low, high in limits:
        if not low <= value <= high:
            raise InputError(f"{name} must lie between {low:g} and {high:g}, got {value:g}")
