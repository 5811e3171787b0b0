"""Pictures of what the parts of the method recover, from runs of one scene with truth.

    python tests/bench/figures.py DATA --mlp RUN --pyramid RUN --no-loss RUN --out FOLDER [--view 0]

The runs: `--set light.kind=mlp --set occlusion.kind=mlp --set shading.method=split`, the defaults, and the first with
`--set occlusion_weight=0`. Any may be left out, and what needs it with it.

    lights.png       the recovered light of both models beside the truth, one factor per channel taken out
    prefilter.png    the network's g(w, rho) beside the integral of its own g(w, 0), by roughness
    occlusion.png    albedo and occlusion of a test view with and without the occlusion loss, and the true albedo
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import resize_environment
from splitnerf.data.images import linear_to_srgb, over_background, write_image
from splitnerf.data.truth import load_scene_truth, load_view_truths
from splitnerf.evaluate.metrics import lsq_scale, solid_angle_weights
from splitnerf.evaluate.sheet import picture_grid
from splitnerf.render.renderer import render_maps
from splitnerf.workflow import load_run, load_splits
from splitnerf_tools.report.run import light_panels

HEIGHT = 128


def shown(radiance: np.ndarray, white: float) -> np.ndarray:
    return linear_to_srgb(np.clip(radiance / white, 0, 1).astype(np.float32))


def lights(truth: np.ndarray, runs: dict[str, Path]) -> np.ndarray:
    """The truth above the recovered lights."""
    truth = resize_environment(truth, HEIGHT, 2 * HEIGHT)
    white, weights = np.percentile(truth, 99), np.repeat(solid_angle_weights(HEIGHT), 2 * HEIGHT)
    rows = [("truth", [shown(truth, white)])]
    for name, run in runs.items():
        light = load_run(run)[0].light.panorama(HEIGHT).numpy()
        scale = lsq_scale(light.reshape(-1, 3), truth.reshape(-1, 3), weights)
        rows.append((name, [shown(light * scale, white)]))
    return picture_grid(["light"], rows)


def prefilter(run: Path) -> np.ndarray:
    """Rows by roughness: g, gbar."""
    panels = light_panels(load_run(run)[0])
    white = np.percentile(panels[0]["g"], 99)
    rows = [(f"roughness {p['roughness']:g}", [shown(p["g"], white), shown(p["g_bar"], white)]) for p in panels]
    return picture_grid(["g(w, rho)", "integral of g(w, 0)"], rows)


def occlusion(test: Dataset, view: int, runs: dict[str, Path]) -> np.ndarray:
    """Rows by run: albedo with the truth's scale, o_d, o_s."""
    truth, alpha = load_view_truths(test)[view].albedo, test.images[view][..., 3]
    white = np.ones_like(test.images[view][..., :3])
    rows = [("truth", [over_background(linear_to_srgb(truth), alpha), white, white])]
    for name, run in runs.items():
        model, grid, _ = load_run(run)
        maps = render_maps(model, grid, test, view)
        solid = (maps["alpha"] > 0.9) & (alpha > 0.9)
        scale = lsq_scale(maps["albedo"][solid], truth[solid])
        grey = [np.repeat(maps[key][..., None], 3, axis=-1) for key in ("occlusion_d", "occlusion_s")]
        colours = linear_to_srgb(np.clip(maps["albedo"] * scale, 0, 1).astype(np.float32))
        rows.append((name, [over_background(picture, maps["alpha"]) for picture in (colours, *grey)]))
    return picture_grid(["albedo", "o_d", "o_s"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--mlp", type=Path)
    parser.add_argument("--pyramid", type=Path)
    parser.add_argument("--no-loss", type=Path)
    parser.add_argument("--view", type=int, default=0)
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    both = {name: run for name, run in (("pyramid", args.pyramid), ("MLP", args.mlp)) if run}
    truth = load_scene_truth(args.data).light
    if both and truth is None:
        parser.error(f"{args.data}: has no light.hdr")
    if both:
        write_image(args.out / "lights.png", lights(truth, both))
    if args.mlp:
        write_image(args.out / "prefilter.png", prefilter(args.mlp))
    if args.mlp and args.no_loss:
        test = load_splits(args.data, args.downscale)[1]
        if test is None:
            parser.error(f"{args.data}: has no test views")
        runs = {"with the loss": args.mlp, "without": args.no_loss}
        write_image(args.out / "occlusion.png", occlusion(test, args.view, runs))


if __name__ == "__main__":
    main()
