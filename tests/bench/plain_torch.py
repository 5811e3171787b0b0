"""The training step beside one in plain torch: same networks, losses and schedule, each operator as torch code.

    python tests/bench/plain_torch.py DATA [--steps 60] [--from RUN] [--downscale 1]

Runs `splitnerf train` on DATA (or goes on from the checkpoint of RUN) twice for the same number of steps: as it is, and
with every operator of a step replaced by the torch code that one would write without this library: hash grid by indexing,
normals by a second pass of autograd, all samples of the occupied cells, padded rays and a cumulative product, tables and
maps by gather, vertices found by distance, and AdamW unfused. What happens a few times in a run alone (marching cubes,
tracing the bits) stays. Prints milliseconds a step of both and their ratio; before that, how far the results of the
replacements are from the operators', so that both do the same work.
"""

from __future__ import annotations

import argparse
import functools
import math
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

import torch
from torch import Tensor
from torch.nn import functional as F

sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
import reference  # noqa: E402

import splitnerf.ops as ops  # noqa: E402
from splitnerf.training import loop as training
from splitnerf.bench.eager import hash_encode, lobe_terms, query_direction, split_sum_shade, turned
from splitnerf.config import Config
from splitnerf.fields.sdf import SOFTPLUS_BETA, SdfField, SdfSample
from splitnerf.ops import hash_grid as hash_module
from splitnerf.ops import light_pyramid as pyramid_module
from splitnerf.ops import monte_carlo as monte_carlo_module
from splitnerf.ops import losses as losses_module
from splitnerf.ops import rays as rays_module
from splitnerf.ops import shading as shading_module
from splitnerf.ops import visibility as visibility_module
from splitnerf.render.rays import PixelSource
from splitnerf.render.renderer import find_samples, render_rays
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.workflow import load_run, load_splits

# ---- field ----


def field_outputs(field: SdfField, x: Tensor) -> tuple[Tensor, Tensor]:
    grid, spec = field.grid, field.grid.spec
    features = hash_encode(field._to_unit(x), grid.table, *spec.arguments(grid.n_active))
    hidden, out = field._weights()
    h = F.softplus(F.linear(torch.cat([x, features], 1), hidden, field.hidden_bias), SOFTPLUS_BETA)
    return F.linear(h, out, field.out_bias), features


def sample(field: SdfField, x: Tensor) -> SdfSample:
    with torch.enable_grad():
        x = x.detach().requires_grad_()
        outputs, features = field_outputs(field, x)
        (gradient,) = torch.autograd.grad(outputs[:, 0].sum(), x, create_graph=True)
    return SdfSample(outputs, features, gradient)


# ---- rays ----


def march_rays(o, d, jitter, cells, box, step, max_samples):
    inverse = 1.0 / torch.where(d == 0, torch.full_like(d, 1e-12), d)
    a, b = (-box - o) * inverse, (box - o) * inverse
    near, far = torch.minimum(a, b).amax(1).clamp(min=0), torch.maximum(a, b).amin(1)
    k = torch.arange(int(2 * math.sqrt(3) * box / step) + 2)
    start = near[:, None] + (k + jitter[:, None] - 1) * step
    middle = start + 0.5 * step
    points = o[:, None] + d[:, None] * middle[..., None]
    n = len(cells)
    index = ((points + box) * (n / (2 * box))).long().clamp(0, n - 1)
    state = cells[index[..., 0], index[..., 1], index[..., 2]]
    inside = (middle > near[:, None]) & (middle < far[:, None])
    state = torch.where(inside, state, torch.zeros_like(state))
    taken = (state == ops.CELL_OCCUPIED) & ((state == ops.CELL_OPAQUE).cumsum(1) == 0)
    rays, which = taken.nonzero(as_tuple=True)
    starts = start[rays, which]
    offsets = torch.cat([torch.zeros(1, dtype=torch.int64), taken.sum(1).cumsum(0)])
    return rays, starts, starts + step, offsets


def padded(values: Tensor, offsets: Tensor, fill: float) -> tuple[Tensor, tuple[Tensor, Tensor]]:
    counts = offsets.diff()
    rows = torch.repeat_interleave(torch.arange(len(counts)), counts)
    columns = torch.arange(len(values)) - offsets[rows]
    full = torch.full((len(counts), max(1, int(counts.max()) if len(counts) else 1)), fill)
    return full.index_put((rows, columns), values), (rows, columns)


def surface_weights(sdf, gradient, rays_d, s, offsets, step, anneal, min_transmittance):
    normals = F.normalize(gradient, dim=1)
    rays = torch.repeat_interleave(torch.arange(len(rays_d)), offsets.diff())
    c = (rays_d[rays] * normals).sum(1)
    half = 0.5 * step * -(torch.relu(0.5 - 0.5 * c) * (1 - anneal) + torch.relu(-c) * anneal)
    before, after = torch.sigmoid(s * (sdf - half)), torch.sigmoid(s * (sdf + half))
    alpha, where = padded(((before - after + 1e-5) / (before + 1e-5)).clamp(0, 1), offsets, 0.0)
    passed = torch.cumprod(torch.cat([torch.ones(len(alpha), 1), 1 - alpha + 1e-7], 1), 1)[:, :-1]
    weights = (alpha * passed)[where]
    return normals, weights, torch.zeros(len(rays_d)).index_add(0, rays, weights)


def composite(weights, values, offsets):
    rays = torch.repeat_interleave(torch.arange(len(offsets) - 1), offsets.diff())
    return torch.zeros(len(offsets) - 1, values.shape[1]).index_add(0, rays, weights[:, None] * values)


def spread_samples(weights, t, offsets, phase, gap, per_ray, max_shaded=-1, max_stretches=-1):
    every = torch.arange(len(weights))
    rays = torch.repeat_interleave(torch.arange(len(offsets) - 1), offsets.diff())
    most = torch.zeros(len(offsets) - 1).scatter_reduce(0, rays, weights, "amax")
    heaviest = torch.full((len(offsets) - 1,), -1).scatter_reduce(
        0, rays, torch.where(weights == most[rays], every, -1), "amax"
    )
    heaviest = heaviest[heaviest >= 0]
    sizes = torch.tensor([len(every), len(heaviest), len(every)])
    return every, every, every, torch.zeros_like(weights), heaviest, every, every, sizes


# ---- shading ----


def shade_sums(normals, view_dirs, albedo, roughness, metallic, specular, grazing, diffuse, lut, compensate):
    f0, gain, energy = lobe_terms(normals, view_dirs, albedo, roughness, metallic, lut, compensate)
    return gain * (f0 * (specular - grazing) + grazing) + (1 - metallic) * (1 - energy) * albedo * diffuse


def monte_carlo_light(normals, view_dirs, roughness, light_dirs, pdf, radiance):
    normals, cosine = turned(normals, view_dirs)
    a2 = (roughness**2).clamp(min=2e-3) ** 2
    half = F.normalize(light_dirs + view_dirs[:, None], dim=-1)
    n_l = (light_dirs * normals[:, None]).sum(-1).clamp(min=0)
    n_v, n_h, v_h = cosine.clamp(min=1e-4), (half * normals[:, None]).sum(-1), (half * view_dirs[:, None]).sum(-1)
    d = a2 / (math.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    smith = 0.5 / (n_l * torch.sqrt(n_v**2 * (1 - a2) + a2) + n_v * torch.sqrt(n_l**2 * (1 - a2) + a2)).clamp(min=1e-9)
    share = radiance / (light_dirs.shape[1] * pdf)[..., None]
    w = d * smith * n_l
    weights = torch.stack([w, w * (1 - v_h).clamp(0, 1) ** 5, n_l / math.pi], 1)
    return weights @ share


def summed_light(normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent):
    n, k = visible.shape
    incoming = visible[..., None] * radiance
    incoming = incoming + sent if len(sent) else incoming
    pdf = (1 / (k * solid_angles)).expand(n, k)
    return monte_carlo_light(normals, view_dirs, roughness, directions.expand(n, k, 3), pdf, incoming)


# ---- light and visibility ----


@functools.lru_cache(maxsize=8)
def csr_matrix(key: tuple) -> Tensor:
    offsets, columns, weights, transposed_offsets = MATRICES[key]
    return torch.sparse_csr_tensor(offsets, columns.long(), weights, (len(offsets) - 1, len(transposed_offsets) - 1))


MATRICES: dict[tuple, tuple] = {}


def sparse_product(offsets, columns, weights, transposed_offsets, _columns, _weights, values):
    key = (offsets.data_ptr(), weights.data_ptr())
    MATRICES[key] = (offsets, columns, weights, transposed_offsets)
    return csr_matrix(key) @ values


def octahedral_texels(w: Tensor, n: int) -> tuple[Tensor, Tensor]:
    """Indices [4, k] and weights [4, k] of the texels around directions."""
    p = w / w.abs().sum(1, keepdim=True)
    sign = torch.where(p < 0, -1.0, 1.0)
    folded = torch.stack([(1 - p[:, 1].abs()) * sign[:, 0], (1 - p[:, 0].abs()) * sign[:, 1]], 1)
    uv = torch.where(p[:, 2:] >= 0, p[:, :2], folded)
    x = (uv + 1) * (n / 2) - 0.5
    x0 = x.detach().floor().clamp(-1, n - 1)
    f, x0 = x - x0, x0.long()
    indices, shares = [], []
    for k in range(4):
        i, j = x0[:, 0] + (k & 1), x0[:, 1] + (k >> 1)
        out = (i < 0) | (i >= n)
        j, i = torch.where(out, n - 1 - j, j), i.clamp(0, n - 1)
        out = (j < 0) | (j >= n)
        i, j = torch.where(out, n - 1 - i, i), j.clamp(0, n - 1)
        indices.append(j * n + i)
        shares.append((f[:, 0] if k & 1 else 1 - f[:, 0]) * (f[:, 1] if k >> 1 else 1 - f[:, 1]))
    return torch.stack(indices), torch.stack(shares)


def harmonics(w: Tensor) -> Tensor:
    """[k, 169] real spherical harmonics of degree up to 12."""
    x, y, z = w.unbind(1)
    rows: dict[tuple[int, int], Tensor] = {}
    cosine, sine = torch.ones_like(x), torch.zeros_like(x)
    diagonal = 0.28209479177387814
    for m in range(13):
        if m:
            diagonal *= math.sqrt((2 * m + 1) / (2 * m)) * (math.sqrt(2) if m == 1 else 1)
        before, p = torch.zeros_like(z), torch.full_like(z, diagonal)
        for l in range(m, 13):
            rows[l, m], rows[l, -m] = p * cosine, p * (sine if m else cosine)
            a = math.sqrt((2 * l + 3) * (2 * l + 1) / ((l + 1 - m) * (l + 1 + m)))
            b = math.sqrt((2 * l + 3) * (l - m) * (l + m) / ((2 * l - 1) * (l + 1 - m) * (l + 1 + m))) if l > m else 0.0
            before, p = p, a * z * p - b * before
        cosine, sine = cosine * x - sine * y, sine * x + cosine * y
    return torch.stack([rows[l, m] for l in range(13) for m in range(-l, l + 1)], 1)


def light_lookup(directions, roughness, levels, sh, resolutions, nodes, zonal):
    nodes = nodes.to(roughness.dtype)
    maps, start = [], 0
    for n in resolutions.tolist():
        index, share = octahedral_texels(directions, n)
        maps.append((levels[start + index] * share[..., None]).sum(0))
        start += n * n
    place = (roughness - nodes[-1]) * ((len(zonal) - 1) / (1 - nodes[-1]))
    row = place.detach().long().clamp(0, len(zonal) - 2)
    factors = torch.lerp(zonal[row[:, 0]], zonal[row[:, 0] + 1], (place - row).clamp(0, 1))
    bands = torch.repeat_interleave(torch.arange(13), torch.arange(1, 26, 2))
    x = (harmonics(directions) * factors[:, bands]) @ sh
    floor = (sh[0] * 1e-3 * 0.28209479177387814).clamp(min=1e-20)
    maps.append(torch.where(x < floor, floor * torch.exp((x / floor).clamp(max=1) - 1), x))
    stacked = torch.stack(maps)
    k = torch.searchsorted(nodes, roughness.detach(), right=True).clamp(1, len(nodes) - 1)
    share = ((roughness - nodes[k - 1]) / (nodes[k] - nodes[k - 1])).clamp(0, 1)
    rows = torch.arange(len(directions))
    return torch.lerp(stacked[k[:, 0] - 1, rows], stacked[k[:, 0], rows], share)


def seen(positions, normals, vertices, vertex_normals, radius, bits, hits, radiance):
    """Open share [n, directions] and the mesh's own light there, from the 16 nearest vertices that face the same way."""
    distance, near = torch.cdist(positions, vertices).topk(16, dim=1, largest=False)
    relative = distance / torch.maximum(torch.tensor(radius), 1.01 * distance[:, :1])
    cosine = (normals[:, None] * vertex_normals[near]).sum(-1).clamp(min=0)
    weight = ((1 - relative).clamp(min=0) / (relative + 0.05)) ** 2 * cosine**4
    weight = weight / weight.sum(1, keepdim=True).clamp(min=1e-9)
    shifts = torch.arange(32, dtype=torch.int32)
    words = (bits[near][..., None] >> shifts & 1).flatten(-2).float()  # [n, 16, 2, directions]
    opened = (weight[..., None] * words[:, :, 0]).sum(1)
    blocked = (weight[..., None] * words[:, :, 1]).sum(1)
    known = opened + blocked
    visible = torch.where(known > 0, opened / known.clamp(min=1e-9), torch.ones_like(known))
    if not hits.shape[1]:  # nothing is known yet of what the mesh sends
        return visible, torch.zeros(*visible.shape, 3)
    sent = radiance[hits[near].clamp(min=0)] * (weight[..., None] * words[:, :, 1])[..., None]
    return visible, sent.sum(1) / known.clamp(min=1e-9)[..., None]


def cached_occlusion(
    positions, normals, lobe_dirs, roughness, vertices, vertex_normals, starts, order, radius, bits, hits, radiance, directions,
    light,
):  # fmt: skip
    visible, sent = seen(positions, normals, vertices, vertex_normals, radius, bits, hits, radiance)
    cosine = (normals @ directions.T).clamp(min=0)
    a2 = torch.maximum(roughness**2, torch.tensor(math.sqrt(2 / 3 / len(directions)))) ** 2
    towards = lobe_dirs @ directions.T
    lobe = a2 / (math.pi * ((1 + towards) / 2 * (a2 - 1) + 1) ** 2) * towards.clamp(min=0) * (cosine > 0)
    results = []
    for kernel in (cosine, lobe):
        results.append(((visible * kernel) @ light / (kernel @ light).clamp(min=1e-9)).clamp(max=1))
    for kernel in (cosine, lobe):
        results.append((sent * kernel[..., None]).sum(1) / kernel.sum(1, keepdim=True).clamp(min=1e-9))
    return tuple(results)


def cached_visibility(
    positions, normals, vertices, vertex_normals, starts, order, radius, bits, hits, radiance, directions
):
    return seen(positions, normals, vertices, vertex_normals, radius, bits, hits, radiance)


# ---- both runs ----


class Plain:
    """The operator library with these functions in the place of some operators."""

    def __init__(self, library, **replaced):
        self.__dict__.update(replaced)
        self.library = library

    def __getattr__(self, name: str):
        return getattr(self.library, name)


def stacked(losses):
    """As the operators return them: all in the first tensor."""
    return lambda *inputs: (torch.stack(losses(*inputs)), None)


def quadratic_entropy(x: Tensor) -> tuple[Tensor, None]:
    return -torch.log(torch.exp(-0.25 * (x[:, None] - x[None]).square().sum(-1)).mean()), None


REPLACED = {
    rays_module: dict(
        march_rays=march_rays, surface_weights=surface_weights, composite=composite, spread_samples=spread_samples,
        interpolate=lambda values, first, second, share: values,
        interpolate_backward=lambda grad, first, second, share, shaded: grad,
    ),
    losses_module: dict(
        quadratic_entropy=quadratic_entropy, pixel_losses=stacked(reference.pixel_losses),
        gradient_losses=stacked(reference.gradient_losses), material_losses=stacked(reference.material_losses),
    ),
    shading_module: dict(query_direction=query_direction, split_sum_shade=split_sum_shade),
    monte_carlo_module: dict(
        monte_carlo_light=monte_carlo_light, summed_light=summed_light, shade_sums=shade_sums
    ),
    pyramid_module: dict(sparse_product=sparse_product, light_lookup=light_lookup),
    visibility_module: dict(cached_occlusion=cached_occlusion, cached_visibility=cached_visibility),
    hash_module: dict(hash_encode=hash_encode),
}  # fmt: skip


def use_plain_torch() -> None:
    """From here on every operator of a step is torch code."""
    for module, functions in REPLACED.items():
        module.lib = Plain(module.lib, **functions)
    SdfField.sample = sample
    SdfField.sdf = lambda field, x: field_outputs(field, x)[0][:, 0]
    make = training.make_optimiser

    def unfused(model, config):
        groups = make(model, config).param_groups
        return torch.optim.AdamW(
            [{k: g[k] for k in ("params", "lr", "weight_decay")} for g in groups], betas=(0.9, 0.99), eps=1e-15
        )

    training.make_optimiser = unfused


UNSKIPPED = dict(sample_above=0.0, shades_per_ray=0, light_step_every=1)


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
    render = training.render_rays

    def stamped(*args, **kwargs):
        times.append(time.perf_counter())
        return render(*args, **kwargs)

    training.render_rays = stamped
    training.train(load_splits(data, DOWNSCALE)[0], config, run, resume=resume)
    training.render_rays = render
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
    args = parser.parse_args()
    DOWNSCALE = args.downscale
    results = {}
    ours = colours(args.data, args.source) if args.source else None
    for name, settings in (("this library", {}), ("plain torch", UNSKIPPED)):
        if name == "plain torch":
            use_plain_torch()
            if ours is not None:
                apart = (colours(args.data, args.source) - ours).abs()
                print(f"colours apart by {apart.mean():.1e} in the mean, {apart.max():.1e} at most (sRGB)")
        with tempfile.TemporaryDirectory() as folder:
            config, resume = start(args.data, args.source, args.steps, Path(folder), **settings)
            times = timed_run(args.data, config, Path(folder), resume)
        results[name] = statistics.median(times)
        print(f"{name:12s} {1e3 * results[name]:8.1f} ms a step, median of {len(times)}")
    print(f"{results['plain torch'] / results['this library']:.1f}x")


DOWNSCALE = 1
if __name__ == "__main__":
    main()
