"""The picture of docs/photos.md: photographs of a flower pot that help, and some that do not; or README's kinds of objects.

python tests/bench/photos_figure.py [--out docs/photos.jpg]
python tests/bench/photos_figure.py --kinds DATA ASSETS --out docs/suits.jpg

The photos are those of `real/flowerpot` in the folder SPLITNERF_DATA; the last two bad ones are made from a good one.
DATA is that of examples/blender_kinds.py. ASSETS/KIND has the test views of the runs that were trained on it:
`splitnerf relight RUN --env RUN/environment.exr --data DATA/KIND --out ASSETS/KIND`.
"""

import argparse
import os
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from splitnerf.data.images import linear_to_srgb, over_background, read_image, srgb_to_linear

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench.strip import sheet  # noqa: E402

KINDS = ("matte", "glossy", "glass", "hair", "thin")
SIZE, SHAKE, STOPS = 300, 41, 2.0  # pixels of a picture; pixels that the camera moved; of too much light


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/photos.jpg"))
    parser.add_argument("--kinds", type=Path, nargs=2)
    args = parser.parse_args()
    if args.kinds:
        files = [(f"{kind}: a photo", args.kinds[0] / kind / "test/000.png") for kind in KINDS]
        files += [("the asset", args.kinds[1] / kind / "000.png") for kind in KINDS]
        read = [(name, read_image(file)) for name, file in files]
        flat = [(name, over_background(x[..., :3], x[..., 3])) for name, x in read]
        return sheet(flat, flat[0][1].shape[0], len(KINDS)).save(args.out, quality=88)
    folder = Path(os.environ.get("SPLITNERF_DATA", "../shared/data")) / "real/flowerpot"
    low, high, cut = (Image.open(folder / f"pot_0{number}.jpg") for number in (35, 43, 71))
    streak = np.pad(np.asarray(low, np.float32), ((0, 0), (SHAKE, 0), (0, 0)), "edge").cumsum(axis=1)
    shaken = Image.fromarray(((streak[:, SHAKE:] - streak[:, :-SHAKE]) / SHAKE).astype(np.uint8))
    burnt = linear_to_srgb(np.clip(2**STOPS * srgb_to_linear(np.asarray(low, np.float32) / 255), 0, 1))
    named = (
        ("the whole object, on a pattern", low),
        ("from above: its inside", high),
        ("bad: cut off", cut),
        ("bad: shaken", shaken),
        ("bad: burnt out", Image.fromarray((255 * burnt).astype(np.uint8))),
    )
    sheet([(name, squared(picture)) for name, picture in named], SIZE, len(named)).save(args.out, quality=85)


def squared(picture: Image.Image) -> np.ndarray:
    """[SIZE, SIZE, 3] in [0, 1]: the middle of a photo, upright photos from the top."""
    side = min(picture.size)
    left = (picture.width - side) // 2
    return np.asarray(picture.crop((left, 0, left + side, side)).resize((SIZE, SIZE), Image.Resampling.LANCZOS)) / 255


if __name__ == "__main__":
    main()
