"""The swap table: what limits a reconstructed asset. Its parts are replaced by the truth, and each variant is scored.

    python tests/bench/limits.py RUN SCENE [--views 2] [--spp 32] [--texture 2048] [--downscale 1] [--sweeps 0] [--out table.md]

RUN is a run's folder or a GLB file with the recovered light in its folder; SCENE a dataset with the truth as asset.glb,
light.hdr and relit test views. With --out the scene's table is appended to a page, which is made where it is missing.

The first and the last row are the files as they are; between them parts come from the nearest points of the other
surface (tests/bench/swap.py). `all true` is the limit by noise and by the data's own renderer. Scores are those of
`splitnerf evaluate`; novel views have a factor per channel, too; "less noise" is by two renderings, at most 50 dB.
With --sweeps N rows follow that say what N sweeps of the refinement, without outline, make of starts that are true in
part: whether it stays at the truth, and whether a true part pulls the rest along; give RUN/trained.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import srgb_to_linear
from splitnerf.data.truth import OPAQUE, ViewTruth, load_scene_truth, load_view_truths
from splitnerf.evaluate import metrics, scoring
from splitnerf.evaluate.protocol import ScaledView, evaluate_maps, on_white, scaled_scores
from splitnerf.evaluate.scoring import Protocol, RelitViews, asset_predictions, choose_views, relight, relight_scores
from splitnerf.refinement.fit import FitSettings
from splitnerf.refinement.stage import Stage
from splitnerf.relight.rendering import asset_of
from splitnerf.render.path_traced import AssetRenderer
from splitnerf_tools.bench.provenance import header, provenance

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench.swap import MATERIALS, PARTS, Canvas  # noqa: E402

ROWS = (
    ("ours", ()),
    *((f"true {part}", (part,)) for part in (*PARTS, "mesh")),
    ("true materials", MATERIALS),
    ("true mesh, normals", ("mesh", "normals")),
    *((f"all true but {part}", {*PARTS, "mesh"} - {part}) for part in (*PARTS, "mesh")),
    ("all true", (*PARTS, "mesh")),
)
STARTS = ("ours", "true mesh", "true normals", "true materials", "true light", "all true")
SOURCES = ("tests/bench/limits.py", "tests/bench/swap.py", "python/splitnerf/evaluate", "python/splitnerf/refinement")
QUIET_FLOOR = 1e-5  # least squared error that is told from noise
COLUMNS = (
    ("relit", "relit, dB"),
    ("relit_quiet", "less noise"),
    ("relit_raw", "without scale"),
    ("novel", "novel, our light"),
    ("novel_true", "true light"),
    ("albedo", "albedo, dB"),
    ("roughness", "roughness"),
    ("metallic", "metal"),
    ("shading", "shading normals, deg"),
    ("smooth", "mesh's normals, deg"),
)


class Reseeded:
    """A renderer with other random numbers."""

    def __init__(self, renderer: AssetRenderer):
        self._renderer = renderer

    def render(self, *arguments: object, seed: int, **options: object) -> dict[str, np.ndarray]:
        return self._renderer.render(*arguments, seed=seed ^ (1 << 30), **options)


def quiet_psnr(first: RelitViews, second: RelitViews, scale: list[float]) -> float:
    """Mean PSNR of relit views with most of the noise of the paths taken out.

    The squared error is estimated as the product of two renderings' errors, whose noise is independent. What remains
    is the shift that clipping and the curve of sRGB give to the mean of noisy values.
    """
    scores = []
    for a, b in zip(first.views(), second.views()):
        truth = on_white(a.truth, a.truth_alpha)
        errors = [on_white(v.prediction, v.alpha, np.array(scale)) - truth for v in (a, b)]
        scores.append(-10 * np.log10(max(np.mean(errors[0] * errors[1]), QUIET_FLOOR)))
    return float(np.mean(scores))


@dataclass
class Scene:
    """What variants are scored against.

    Attributes:
        views: The test views.
        maps: The maps of the relit views.
        truths: The views' truth.
        lights: The recovered light (None where there is none) and the true one, [h, w, 3].
        shading_normals: Per view the true shading normals [H, W, 3] and where they count [H, W].
        spp: Paths a pixel.
    """

    views: Dataset
    maps: dict[str, Path]
    truths: list[ViewTruth]
    lights: dict[str, np.ndarray | None]
    shading_normals: list[tuple[np.ndarray, np.ndarray]]
    spp: int

    def scores(self, asset: Asset) -> dict[str, float | None]:
        """The columns of the table, None where the data have no truth."""
        renderer = AssetRenderer(asset)
        relit = relight(renderer, self.views, self.maps, self.spp)
        relit_part = relit and relight_scores(relit)
        again = relit and relight(Reseeded(renderer), self.views, self.maps, max(1, self.spp // 2))
        lights = {name: light for name, light in self.lights.items() if light is not None}
        seen = {name: asset_predictions(renderer, self.views, light, self.spp) for name, light in lights.items()}
        predictions = seen["novel_true"]
        errors = evaluate_maps(predictions, self.views, self.truths)
        pairs = [
            (p["shading_normal"][mask & (p["alpha"] > OPAQUE)], normals[mask & (p["alpha"] > OPAQUE)])
            for p, (normals, mask) in zip(predictions, self.shading_normals)
        ]
        return {name: self.novel_psnr(maps) for name, maps in seen.items()} | {
            "relit": relit_part and relit_part["psnr"],
            "relit_quiet": relit_part and quiet_psnr(relit, again, relit_part["lsq"]["scale"]),
            "relit_raw": relit_part and relit_part["raw"]["psnr"],
            "albedo": errors["albedo"] and errors["albedo"]["psnr"],
            "roughness": errors["roughness_mae"],
            "metallic": errors["metallic_balanced_accuracy"],
            "shading": metrics.normal_mae_deg(*map(np.concatenate, zip(*pairs))),
            "smooth": errors["normal_mae_deg"],
        }

    def novel_psnr(self, predictions: list[dict[str, np.ndarray]]) -> float:
        """PSNR of rendered photos with one factor per channel."""
        pairs = list(zip(predictions, self.views.images))
        views = [
            ScaledView("", srgb_to_linear(p["rgb"]), p["alpha"], srgb_to_linear(image[..., :3]), image[..., 3])
            for p, image in pairs
        ]
        return scaled_scores(lambda: views)[0]["psnr"]


def refined(photos: Dataset, asset: Asset, light: np.ndarray, sweeps: int) -> tuple[Asset, str]:
    """What sweeps of the refinement make of an asset and a light, and the errors of photos held out before and after them, in 1e-4."""
    stage = Stage(photos, asset, light, FitSettings(sweeps=sweeps, outline=False, albedo_size=0))
    while len(stage.sweeps) < sweeps:
        stage.advance()
    errors = f"{1e4 * stage.held_start:.2f} to {1e4 * stage.sweeps[-1].held:.2f}"
    return stage.fit.texels.asset_with(stage.fit.maps()), errors


def load_scene(root: Path, light: Path | None, truth: Asset, protocol: Protocol) -> Scene:
    """The scene's views, maps and truth; the true shading normals are rendered."""
    views, maps = choose_views(load_dataset(root, "test", protocol.downscale), protocol)
    lights = {"novel": None if light is None else read_environment(light), "novel_true": load_scene_truth(root).light}
    rendered = asset_predictions(AssetRenderer(truth), views, None, protocol.spp)
    normals = [(p["shading_normal"], p["alpha"] > OPAQUE) for p in rendered]
    return Scene(views, maps, load_view_truths(views), lights, normals, protocol.spp)


def section(run: Path, root: Path, protocol: Protocol, texture: int, sweeps: int = 0) -> str:
    """The scene's table as markdown, its rows printed as they come."""
    ours, truth = asset_of(run), read_asset(root / "asset.glb")
    scene = load_scene(root, scoring.environment_beside(run / "mesh.glb" if run.is_dir() else run), truth, protocol)
    canvases = {"ours": Canvas(ours, truth, texture), "true": Canvas(truth, ours, texture)}
    light = scene.lights["novel"]
    light_error = "none" if light is None else f"{metrics.light_psnr(light, scene.lights['novel_true']):.1f} dB"
    lines = [
        f"## {root.name}: {'/'.join(run.resolve().parts[-2:])}",
        f"{len(scene.views)} test views, {len(scene.maps)} maps, {protocol.spp} paths a pixel, "
        f"textures of {texture} x {texture}; our light has {light_error}.",
        "| | " + " | ".join(title for _, title in COLUMNS) + " |\n|---" + "|--:" * len(COLUMNS) + "|",
    ]
    print("\n\n".join(lines), flush=True)
    for name, replaced in ROWS:
        replaced = set(replaced)
        if name in ("ours", "all true"):
            asset = ours if name == "ours" else truth
        elif "mesh" in replaced:
            asset = canvases["true"].painted(set(PARTS) - replaced)
        else:
            asset = canvases["ours"].painted(replaced)
        lines.append(row(name, scene.scores(asset)))
        print(lines[-1], flush=True)
    photos, replaced = load_dataset(root, "train", protocol.downscale), dict(ROWS) | {"true light": ()}
    for name in STARTS if sweeps else ():
        parts = set(replaced[name])
        start = canvases["true"].painted(set(PARTS) - parts) if "mesh" in parts else canvases["ours"].painted(parts)
        light = scene.lights["novel_true" if name in ("true light", "all true") else "novel"]
        asset, errors = refined(photos, start, light, sweeps)
        lines.append(row(f"{name}, {sweeps} sweeps, held out {errors}", scene.scores(asset)))
        print(lines[-1], flush=True)
    text = "\n\n".join(lines[:3]) + "\n" + "\n".join(lines[3:])
    return f"{text}\n\n{header(provenance(SOURCES))}\n"


def row(name: str, scores: dict[str, float | None]) -> str:
    """A line of the table."""
    digits = {"roughness": 3, "metallic": 3}
    cells = ["" if scores.get(key) is None else f"{scores[key]:.{digits.get(key, 2)}f}" for key, _ in COLUMNS]
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--views", type=int, default=2)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--texture", type=int, default=2048, help="texels along an edge of the baked textures")
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--sweeps", type=int, default=0, help="of the refinement from starts that are true in part")
    parser.add_argument("--out", type=Path, help="page that the table is appended to")
    args = parser.parse_args()
    text = section(args.run, args.scene, Protocol(args.downscale, args.views, args.spp), args.texture, args.sweeps)
    if args.out is not None:
        before = args.out.read_text() if args.out.is_file() else "# What limits the relit images\n"
        args.out.write_text(f"{before}\n{text}")


if __name__ == "__main__":
    main()
