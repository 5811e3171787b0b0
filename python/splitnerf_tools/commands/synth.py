"""splitnerf synth."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from splitnerf.cli.common import DONE, examples
from splitnerf.errors import InputError

LAYOUTS = ("blender", "nerfactor")
SHAPES = ("bowl", "mug", "box", "vase", "shell", "rings", "plinth", "mask")
MATERIALS = ("matte", "glossy", "metal")


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "synth",
        help="render a dataset with full truth from a GLB file or a built-in shape",
        description="Renders ASSET or a built-in shape, brought to the unit sphere, from cameras around it under the light MAP, "
        "with true albedo and normals (layout blender: roughness and metallic, too) and, with --relight, relit views.",
        epilog=examples(
            "splitnerf synth chair.glb --light studio.hdr --out data",
            "splitnerf synth chair.glb --light studio.hdr --relight field.hdr city.hdr --size 400 --out data",
            "splitnerf synth --shape mug --material glossy --light studio.hdr --out data",
        ),
    )
    rendered = parser.add_mutually_exclusive_group(required=True)
    rendered.add_argument("asset", type=Path, nargs="?", metavar="ASSET.glb")
    rendered.add_argument(
        "--shape",
        choices=SHAPES,
        metavar="NAME",
        help=f"a built-in shape, hollow, pierced or touching: {', '.join(SHAPES)}",
    )
    add = parser.add_argument
    add("--material", choices=MATERIALS, help="of the shape, under a painted pattern (default: matte)")
    add("--light", type=Path, required=True, metavar="MAP", help="environment map of the photos, .hdr or .exr")
    add("--relight", type=Path, nargs="+", default=[], metavar="MAP", help="maps of the relit test views")
    add("--out", type=Path, required=True, metavar="DATA", help="folder to write, absent or empty")
    add("--size", type=int, default=200, metavar="N", help="width and height in pixels (default: 200)")
    add("--train", type=int, default=100, metavar="N", help="number of train views (default: 100)")
    add("--test", type=int, default=20, metavar="N", help="number of test views (default: 20)")
    add("--spp", type=int, default=256, metavar="N", help="paths a pixel (default: 256)")
    add(
        "--layout",
        choices=LAYOUTS,
        metavar="SET",
        default="blender",
        help=f"whose files the data look like (default: blender): {', '.join(LAYOUTS)}",
    )
    add(
        "--turntable",
        action="store_true",
        help="the object turns before the camera, so that the light turns with the camera",
    )
    add("--seed", type=int, default=0, help="of the noise and the first camera (default: 0)")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.export.writers import write_glb

    from splitnerf_tools.synth.rendering import SynthSettings, synthesise
    from splitnerf_tools.synth.shapes import shape_asset

    if args.material and not args.shape:
        raise InputError("--material is that of a built-in shape; give --shape, or leave it out")
    settings = SynthSettings(args.size, args.train, args.test, args.spp, args.layout, args.seed, args.turntable)
    with tempfile.TemporaryDirectory() as folder:
        asset = args.asset
        if args.shape:
            asset = Path(folder) / f"{args.shape}.glb"
            write_glb(asset, shape_asset(args.shape, args.material or MATERIALS[0]))
        out = synthesise(asset, args.light, args.relight, args.out, settings)
    print(f"{args.train} train and {args.test} test views under {1 + len(args.relight)} lights: {out}")
    return DONE
