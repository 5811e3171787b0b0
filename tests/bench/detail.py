"""Detail of the albedo by the photos' own pixels, beside plain projection of the photos, as photogrammetry does it.

    python tests/bench/detail.py RUN DATA [RUN DATA ...] [--averages 1 2 4 7] [--out docs/benchmarks]

A RUN was trained on its DATA, which has true albedo (`splitnerf synth ASSET.glb --size 1400`). To the asset that its training exported,
detail is added from the photos, and from the photos averaged down; the albedo seen in the test views is compared with the truth,
each channel scaled by least squares. "Fine structure" compares what is smaller than FINE pixels. Writes detail.md and
detail.jpg: a test view's middle of the trained asset, projection, detail and truth.
"""

import argparse
import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from scipy.ndimage import gaussian_filter
from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.images import linear_to_srgb
from splitnerf.data.truth import load_view_truths
from splitnerf.ops import MeshScene
from splitnerf.refinement.detail import FineTexels, detail_size, read_texture, with_detail
from splitnerf.refinement.pixels import MIN_ALPHA, Pixels
from splitnerf.refinement.refine import read_source, source_of
from splitnerf_tools.bench.provenance import header, provenance

FINE = 8  # pixels, sigma of a Gaussian
CROP = 200  # half the pixels along the edge of the picture's parts
INSIDE = ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75))  # rays of a pixel


def projected(data: Dataset, asset: Asset, light: np.ndarray, size: int) -> Asset:
    """The asset with the photos' own colours as its albedo: means by pixels on a unit of the surface."""
    texels = FineTexels(asset, torch.from_numpy(light), size)
    sums, weights = torch.zeros_like(texels.albedo), torch.full((len(texels.albedo), 1), 1e-12)
    for view in range(len(data)):
        shown = texels.shown_in(data, view)
        sums[shown.rows] += shown.pixels * shown.colours
        weights[shown.rows] += shown.pixels
    texture = texels.texture((sums / weights).clamp(0, 1))
    return replace(asset, materials=[replace(asset.materials[0], albedo_texture=texture)])


def seen_albedo(asset: Asset, views: Dataset, view: int) -> tuple[np.ndarray, np.ndarray]:
    """[H, W, 3] the albedo that a view shows, and [H, W] the pixels that asset and object cover."""
    scene, (height, width) = MeshScene(asset.vertices, asset.triangles), views.images[view].shape[:2]
    none = np.zeros(0)
    pixels = Pixels(none, none, none, none, none, views.world_poses[:, :3].astype(np.float32), views.intrinsics)
    y, x = np.mgrid[:height, :width].reshape(2, -1)
    points = np.stack([x, y], axis=1)[:, None] + np.array(INSIDE)
    origins, directions = (part.reshape(-1, 3) for part in pixels.rays_through(np.full(len(x), view), points))
    triangle, u, v = scene.trace_closest(origins, directions)
    corners = asset.uv[asset.triangles[triangle]]
    uv = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    albedo = read_texture(asset.materials[0].albedo_texture, uv).numpy() * (triangle >= 0)[:, None]
    hit = (triangle >= 0).reshape(height, width, -1).all(axis=2)
    albedo = albedo.reshape(height, width, len(INSIDE), 3).mean(axis=2)
    return albedo, hit & (views.images[view][..., 3] >= MIN_ALPHA)


def scores(asset: Asset, views: Dataset, truths: list) -> tuple[float, float, np.ndarray]:
    """PSNR of the albedo in sRGB and of its fine structure, over all views; and the first view in sRGB, scaled."""
    seen = [seen_albedo(asset, views, view) for view in range(len(views))]
    found, true = (np.concatenate(x) for x in zip(*((a[m], t.albedo[m]) for (a, m), t in zip(seen, truths))))
    scale = (found * true).sum(axis=0) / np.square(found).sum(axis=0)
    errors, fine = [], []
    for (albedo, mask), truth in zip(seen, truths):
        error = (coded(albedo * scale) - coded(truth.albedo)) * mask[..., None]
        around = gaussian_filter(mask.astype(np.float32), FINE)[..., None].clip(1e-3)
        errors.append(error[mask])
        fine.append((error - gaussian_filter(error, (FINE, FINE, 0)) / around)[mask])
    psnr, psnr_fine = (-10 * np.log10(np.square(np.concatenate(x)).mean()) for x in (errors, fine))
    return psnr, psnr_fine, coded(seen[0][0] * scale)


def coded(linear: np.ndarray) -> np.ndarray:
    return linear_to_srgb(linear.clip(0, 1).astype(np.float32))


def rows_of(run: Path, data: Path, averages: list[int]) -> tuple[list[str], np.ndarray]:
    """The rows of a run, and its picture."""
    source = source_of(run)
    (asset, light), views = read_source(source), load_dataset(data, "test", 1)
    truths, pictures, lines, made = load_view_truths(views), [], [], [("training alone", "-", asset, "-")]
    for average in averages:
        photos = load_dataset(data, "train", average)
        wanted, edge = detail_size(photos, asset, 4096), f"{len(photos)} of {photos.height} x {photos.width}"
        size = wanted or asset.materials[0].albedo_texture.shape[0]
        if average == averages[0]:
            made.append(("projection", edge, projected(photos, asset, light, size), "-"))
        started = time.monotonic()
        detailed = with_detail(photos, asset, light, size, math.inf, lambda share: None)
        label = "detail" if wanted else "detail, which a run leaves out here"
        made.append((label, edge, detailed, f"{time.monotonic() - started:.0f}"))
    for label, edge, result, seconds in made:
        psnr, fine, picture = scores(result, views, truths)
        size = result.materials[0].albedo_texture.shape[0]
        lines.append(f"| {data.name} | {label} | {edge} | {size} | {psnr:.2f} | {fine:.2f} | {seconds} |")
        pictures.append(picture)
        print(lines[-1], flush=True)
    y, x = (int(np.median(part)) for part in np.nonzero(views.images[0][..., 3] > MIN_ALPHA))
    parts = [p[y - CROP : y + CROP, x - CROP : x + CROP] for p in (*pictures[:3], coded(truths[0].albedo))]
    return lines, np.concatenate(parts, axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN DATA")
    parser.add_argument("--averages", type=int, nargs="+", default=[1, 2, 4, 7], help="factors of the photos' averages")
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks"))
    args = parser.parse_args()
    if len(args.runs) % 2:
        parser.error("give each RUN with its DATA")
    facts = provenance(
        ("python/splitnerf/refinement", "python/splitnerf/render/seen.py"), "python tests/bench/detail.py RUN DATA ..."
    )
    lines, pictures = zip(*(rows_of(*pair, args.averages) for pair in zip(args.runs[::2], args.runs[1::2])))
    image = Image.fromarray((255 * np.concatenate(pictures)).round().astype(np.uint8))
    image.save(args.out / "detail.jpg", quality=85)
    columns = "| object | albedo | photos | texels along an edge | albedo, dB | fine structure, dB | seconds |"
    shown = "![Training alone, projection, detail, truth](detail.jpg)"
    table = [columns, "|" + " --- |" * 7, *sum(lines, [])]
    text = "\n".join(["# Detail by the photos' own pixels", "", header(facts), "", shown, "", *table, ""])
    (args.out / "detail.md").write_text(text)


if __name__ == "__main__":
    sys.exit(main())
