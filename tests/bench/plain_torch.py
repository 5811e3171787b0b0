"""The training step compared with one in plain torch: same networks, losses and schedule, each operator as torch code.

    python tests/bench/plain_torch.py DATA [--steps 60] [--from RUN] [--downscale 1] [--set KEY=VALUE ...]

Runs `splitnerf train` on DATA (or continues from the checkpoint of RUN) twice for the same number of steps: as it is,
and with every operator of a step replaced by the torch code that one would write without this library: hash grid by
indexing, normals by a second pass of autograd, all samples of the occupied cells, padded rays and a cumulative sum of
depths, tables and maps by gather, vertices found among all, and AdamW unfused. What happens only a few times in a run
(marching cubes, tracing the bits) stays. Prints milliseconds a step of both and their ratio; before that, how far the
results of the replacements are from the operators', so that both do the same work.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

import torch
from splitnerf.config import Config, parse_setting
from splitnerf.fields.sdf import SOFTPLUS_BETA, SdfField, SdfSample
from splitnerf.ops import hash_grid as hash_module
from splitnerf.ops import light_pyramid as pyramid_module
from splitnerf.ops import losses as losses_module
from splitnerf.ops import monte_carlo as monte_carlo_module
from splitnerf.ops import rays as rays_module
from splitnerf.ops import shading as shading_module
from splitnerf.ops import visibility as visibility_module
from splitnerf.pipeline import load_run, load_splits
from splitnerf.render.rays import PixelSource
from splitnerf.render.renderer import find_samples, render_rays
from splitnerf.training import loop as training
from splitnerf.training import state
from splitnerf.training.meshes import SurfaceMesh
from torch import Tensor

sys.path.insert(0, str(Path(__file__).parents[1]))
import reference  # noqa: E402

# ---- field ----


def field_outputs(field: SdfField, x: Tensor) -> tuple[Tensor, Tensor]:
    grid, spec = field.grid, field.grid.spec
    features = reference.hash_encode(field._to_unit(x), grid.table, *spec.arguments(grid.n_active))
    hidden, out = field._weights()
    layer = (hidden, field.hidden_bias, out, field.out_bias, SOFTPLUS_BETA)
    return reference.layer_outputs(x, features, *layer), features


def sample(field: SdfField, x: Tensor) -> SdfSample:
    with torch.enable_grad():
        x = x.detach().requires_grad_()
        outputs, features = field_outputs(field, x)
        (gradient,) = torch.autograd.grad(outputs[:, 0].sum(), x, create_graph=True)
    return SdfSample(outputs, features, gradient)


# ---- samples ----


def spread_samples(weights, t, offsets, phase, gap, per_ray, max_shaded=-1, max_stretches=-1, unit=None):
    """All samples are shaded, each for itself."""
    every = torch.arange(len(weights))
    rays = reference.ray_indices(offsets)
    most = torch.zeros(len(offsets) - 1).scatter_reduce(0, rays, weights, "amax")
    heaviest = torch.full((len(offsets) - 1,), -1).scatter_reduce(
        0, rays, torch.where(weights == most[rays], every, -1), "amax"
    )
    heaviest = heaviest[heaviest >= 0]
    sizes = torch.tensor([len(every), len(heaviest), len(every)])
    return every, every, every, torch.zeros_like(weights), heaviest, every, every, sizes


# ---- both runs ----


class Plain:
    """The operator library with these functions in the place of some operators."""

    def __init__(self, library, **replaced):
        self.__dict__.update(replaced)
        self.library = library

    def __getattr__(self, name: str):
        return getattr(self.library, name)


def stacked(losses):
    """As the operators return their terms: all in the first tensor, beside what the backward pass reads."""
    return lambda *inputs: (torch.stack(losses(*inputs)), None)


REPLACED = {
    rays_module: dict(
        march_rays=reference.march_rays,
        surface_weights=reference.surface_weights,
        composite=reference.composite,
        spread_samples=spread_samples,
        interpolate=lambda values, first, second, share: values,
        interpolate_backward=lambda grad, first, second, share, shaded: grad,
    ),
    losses_module: dict(
        quadratic_entropy=lambda x: (reference.quadratic_entropy(x), None),
        pixel_losses=lambda *inputs: torch.stack(reference.pixel_losses(*inputs)),
        gradient_losses=stacked(reference.gradient_losses),
    ),
    shading_module: dict(light_queries=reference.light_queries, split_sum_shade=reference.split_sum_shade),
    monte_carlo_module: dict(
        monte_carlo_light=reference.monte_carlo_light,
        summed_light=reference.summed_light,
        shade_sums=reference.shade_sums,
    ),
    pyramid_module: dict(sparse_product=reference.sparse_product, light_lookup=reference.light_lookup),
    visibility_module: dict(cached_occlusion=reference.cached_occlusion, cached_visibility=reference.cached_visibility),
    hash_module: dict(hash_encode=reference.hash_encode),
}


def use_plain_torch() -> None:
    """From here on every operator of a step is torch code."""
    for module, functions in REPLACED.items():
        module.lib = Plain(module.lib, **functions)
    SdfField.sample = sample
    SdfField.sdf = lambda field, x: field_outputs(field, x)[0][:, 0]
    make = state.make_optimiser

    def unfused(model, config):
        groups = make(model, config).param_groups
        return torch.optim.AdamW(
            [{k: g[k] for k in ("params", "lr", "weight_decay", "rate")} for g in groups], betas=(0.9, 0.99), eps=1e-15
        )

    state.make_optimiser = unfused


UNSKIPPED = dict(**{"sampling.min_weight": 0.0}, shades_per_ray=0, light_step_every=1)


def colours(data: Path, source: Path) -> Tensor:
    """Of 300 rays by the model of a run, nothing skipped."""
    model, grid, content = load_run(source)
    model.config = model.config.replace(UNSKIPPED)
    SurfaceMesh(model).restore(content)
    rays = PixelSource(load_splits(data, DOWNSCALE)[0], 0.85, torch.Generator().manual_seed(0)).draw(300)[:2]
    rays = *rays, torch.full((300,), 0.5)
    with torch.no_grad():
        ray = render_rays(model, model.evaluate_light(), find_samples(model, grid.cells, *rays))
    return ray.colour * ray.opacity[:, None]


def timed_run(data: Path, config: Config, run: Path, resume: bool) -> list[float]:
    """Seconds of each step."""
    times: list[float] = []
    draw = training.draw_batch

    def stamped(*args, **kwargs):
        times.append(time.perf_counter())
        return draw(*args, **kwargs)

    training.draw_batch = stamped
    training.train(load_splits(data, DOWNSCALE)[0], config, run, resume=resume)
    training.draw_batch = draw
    return [b - a for a, b in zip(times, times[1:])]


def start(data: Path, source: Path | None, steps: int, folder: Path, **settings) -> tuple[Config, bool]:
    config = Config()
    if source is None:
        return config.replace({"steps": steps, **settings}), False
    shutil.copy(source / "checkpoint.pt", folder / "checkpoint.pt")
    done = torch.load(source / "checkpoint.pt", weights_only=True)["step"]
    long = {"max_minutes": 0.0, "preview_every": 2.0, "checkpoint_minutes": 1e3}
    return Config.read(source / "config.toml").replace({"steps": done + steps, **long, **settings}), True


def main() -> None:
    global DOWNSCALE
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--from", dest="source", type=Path, help="a run whose last steps are repeated")
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings")
    args = parser.parse_args()
    DOWNSCALE = args.downscale
    changes = dict(parse_setting(text) for text in args.settings)
    results = {}
    ours = colours(args.data, args.source) if args.source else None
    for name, settings in (("this library", {}), ("plain torch", UNSKIPPED)):
        if name == "plain torch":
            use_plain_torch()
            if ours is not None:
                apart = (colours(args.data, args.source) - ours).abs()
                print(f"colours apart by {apart.mean():.1e} in the mean, {apart.max():.1e} at most (sRGB)")
        with tempfile.TemporaryDirectory() as folder:
            config, resume = start(args.data, args.source, args.steps, Path(folder), **changes, **settings)
            times = timed_run(args.data, config, Path(folder), resume)
        results[name] = statistics.median(times)
        print(f"{name:12s} {1e3 * results[name]:8.1f} ms a step, median of {len(times)}")
    print(f"{results['plain torch'] / results['this library']:.1f}x")


DOWNSCALE = 1
if __name__ == "__main__":
    main()
