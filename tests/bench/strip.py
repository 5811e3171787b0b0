"""The first picture of README: a photo, the recovered asset's maps, and the asset under other lights, each with its name.

python tests/bench/strip.py RUN DATA --maps A.hdr B.hdr C.hdr [--view 0] [--size 400] [--spp 256] [--out docs/strip.jpg]

DATA is what RUN was trained on; the camera is that of one of its test views.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from splitnerf.data.dataset import load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.images import over_background, straight_srgb, to_uint8
from splitnerf.relight.rendering import asset_of
from splitnerf.render.path_traced import AssetRenderer

LABEL = 30  # pixels below a picture
COLUMNS = 4


def pictures(run: Path, data: Path, maps: list[Path], view: int, size: int, spp: int) -> list[tuple[str, np.ndarray]]:
    """Names and pictures [size, size, 3], sRGB on white."""
    views, renderer = load_dataset(data, "test"), AssetRenderer(asset_of(run))
    photo = views.images[view]
    left, top, side = square_around(photo[..., 3])
    lens = tuple((views.intrinsics[view] - [0, 0, left, top]) * size / side)

    def rendered(light: np.ndarray) -> dict[str, np.ndarray]:
        return renderer.render(light, views.world_poses[view], lens, size, size, spp=spp)

    flat = Image.fromarray(to_uint8(over_background(photo[..., :3], photo[..., 3])))
    box = (left, top, left + side, top + side)
    named = [("a photo that was held out", np.asarray(flat.resize((size, size), Image.Resampling.BICUBIC, box)) / 255)]
    plain = rendered(np.ones((2, 4, 3), np.float32))
    shown = {
        "albedo": straight_srgb(plain["albedo"] * plain["alpha"][..., None], plain["alpha"]),
        "roughness": np.repeat(plain["roughness"][..., None], 3, axis=2),
        "metallic": np.repeat(plain["metallic"][..., None], 3, axis=2),
        "normals": 0.5 * plain["normal"] + 0.5,
    }
    named += [(name, over_background(values, plain["alpha"])) for name, values in shown.items()]
    for path in maps:
        maps_of = rendered(read_environment(path))
        colours = over_background(straight_srgb(maps_of["radiance"], maps_of["alpha"]), maps_of["alpha"])
        named.append((f"light: {path.stem.removeprefix('blender_').removesuffix('_1k').replace('_', ' ')}", colours))
    return named


def square_around(alpha: np.ndarray) -> tuple[int, int, int]:
    """Left, top and edge in pixels of a square with a margin around what a mask [H, W] covers, within it."""
    rows, columns = (np.flatnonzero((alpha > 0).any(axis=axis)) for axis in (1, 0))
    side = min(round(1.1 * max(np.ptp(rows), np.ptp(columns))), *alpha.shape)
    starts = [(ends[0] + ends[-1] - side) // 2 for ends in (columns, rows)]
    left, top = (int(np.clip(start, 0, n - side)) for start, n in zip(starts, alpha.shape[::-1]))
    return left, top, side


def sheet(named: list[tuple[str, np.ndarray]], size: int, columns: int = COLUMNS) -> Image.Image:
    """The pictures in rows, their names below."""
    rows = -(-len(named) // columns)
    result = Image.new("RGB", (columns * size, rows * (size + LABEL)), "white")
    draw, font = ImageDraw.Draw(result), ImageFont.load_default(size=20)
    for i, (name, picture) in enumerate(named):
        left, top = i % columns * size, i // columns * (size + LABEL)
        result.paste(Image.fromarray(to_uint8(picture)), (left, top))
        draw.text((left + size / 2, top + size), name, "black", font, anchor="ma")
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("--maps", type=Path, nargs="+", required=True)
    parser.add_argument("--view", type=int, default=0)
    parser.add_argument("--size", type=int, default=400)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--out", type=Path, default=Path("docs/strip.jpg"))
    args = parser.parse_args()
    named = pictures(args.run, args.data, args.maps, args.view, args.size, args.spp)
    sheet(named, args.size).save(args.out, quality=88)


if __name__ == "__main__":
    main()
