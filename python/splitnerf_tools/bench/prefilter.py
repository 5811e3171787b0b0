"""The pre-integrated light gbar(w, rho): time against error of every way to estimate it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import torch
from splitnerf import _core
from splitnerf.config import Config, preset
from splitnerf.ops import fibonacci_directions, prefilter_light
from splitnerf.ops.light import light_lookup, sample_ggx_lobe, sh_projection, zonal_factors
from torch import Tensor
from torch.nn import functional as F

from splitnerf_tools.bench.charts import Chart, Result
from splitnerf_tools.bench.harness import chart_of, interleaved
from splitnerf_tools.bench.subjects import MapLight, cell_means, lights, pyramid_of

BANDS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
QUICK_BANDS = (0.1, 0.3, 0.7)
PUBLISHED = 8129  # light directions of the paper
TRUTH_CHUNK = 1 << 22
QUADRATURE_FROM = 0.1  # roughness
HARMONIC_RESOLUTION, ZONAL_ROWS = 64, 129
HARMONICS = "spherical harmonics"
SOURCES = ("cpp/*prefilter*", "cpp/*light*", "python/splitnerf/ops/light.py", "python/splitnerf/fields/light.py")
NARROWEST = 0.1  # least roughness at which the harmonics are measured

Estimate = Callable[[Tensor, Tensor], Tensor]


class Truth:
    """gbar of a light: a quadrature over `height` x 2 `height` nodes or, where these would miss the lobe, n samples of the lobe."""

    def __init__(self, light: MapLight, height: int, n: int):
        self.light, self.n = light, n
        polar = (torch.arange(height, dtype=torch.float64) + 0.5) / height * math.pi
        self.directions = torch.from_numpy(_core.equirect_directions(height, 2 * height)).reshape(-1, 3).float()
        self.areas = torch.sin(polar).repeat_interleave(2 * height)[:, None].float()
        self.lit = self.light(self.directions) * self.areas

    def __call__(self, axes: Tensor, rho: float) -> Tensor:
        """[s, 3]."""
        roughness = torch.full((len(axes), 1), rho)
        if rho >= QUADRATURE_FROM:
            areas = self.areas.expand(-1, 3).contiguous()
            lit, whole = (
                prefilter_light(axes, roughness, light_dirs=self.directions, light=part) for part in (self.lit, areas)
            )
            return lit / whole
        means = []
        for i, part in enumerate(axes.split(max(1, TRUTH_CHUNK // self.n))):
            directions = sample_ggx_lobe(part, roughness[: len(part)], self.n, seed=i)
            means.append(self.light(directions.reshape(-1, 3)).view(len(part), self.n, 3).double().mean(1))
        return torch.cat(means).float()


def shared(light: MapLight, draw: Callable[[], Tensor], with_queries: bool = False) -> Estimate:
    """The same directions for all queries; `with_queries` adds the queries to them, as in the released code."""

    def estimate(axes: Tensor, roughness: Tensor) -> Tensor:
        directions = torch.cat([draw(), axes]) if with_queries else draw()
        return prefilter_light(axes, roughness, light_dirs=directions, light=light(directions))

    return estimate


def own_lobe(light: MapLight, n: int) -> Estimate:
    def estimate(axes: Tensor, roughness: Tensor) -> Tensor:
        directions = sample_ggx_lobe(axes, roughness, n, int(torch.randint(1 << 30, ())))
        return light(directions.reshape(-1, 3)).view(len(axes), n, 3).mean(1)

    return estimate


def filtered_importance(light: MapLight, n: int) -> Estimate:
    """Samples of the lobe, each averaged over the solid angle 1 / (n pdf) around it (Krivanek and Colbert 2008)."""

    def estimate(axes: Tensor, roughness: Tensor) -> Tensor:
        directions = sample_ggx_lobe(axes, roughness, n, int(torch.randint(1 << 30, ())))
        alpha2 = roughness[:, :, None] ** 4
        sin2 = (directions - axes[:, None]).square().sum(-1, keepdim=True) / 4  # of half the angle to the axis
        d = alpha2 / (math.pi * (alpha2 + (1 - alpha2) * sin2).square())
        total = lobe_integral(roughness)[:, :, None]
        pdf = d * (1 - 2 * sin2).clamp(min=1e-3) / total
        return light.filtered(directions.reshape(-1, 3), (1 / (n * pdf)).reshape(-1)).view(len(axes), n, 3).mean(1)

    return estimate


def lobe_integral(roughness: Tensor) -> Tensor:
    """Integral of D (w.axis)+ over the sphere, D of half the angle: 2 a^2 / B^2 (y - ln(1 + y)), y = B / a^2, B = (1 - a^2) / 2."""
    a2 = roughness.double() ** 4
    b = (1 - a2) / 2
    y = b / a2
    return torch.where(b > 1e-4, 2 * a2 / b.clamp(min=1e-9) ** 2 * (y - torch.log1p(y)), torch.ones_like(a2)).float()


def harmonics(light: MapLight) -> Estimate:
    """Spherical harmonics of degree 12 from the light's averages, for roughness from `NARROWEST` on."""
    texels = cell_means(light, HARMONIC_RESOLUTION)
    projection, zonal = sh_projection(HARMONIC_RESOLUTION, cells=True), zonal_factors(NARROWEST, ZONAL_ROWS)
    nodes = torch.tensor([NARROWEST / 2, NARROWEST], dtype=torch.float64)

    def estimate(axes: Tensor, roughness: Tensor) -> Tensor:
        resolutions = torch.tensor([HARMONIC_RESOLUTION])
        return light_lookup(axes, roughness, texels, projection @ texels, resolutions, nodes, zonal)

    return estimate


def estimators(light: MapLight, quick: bool) -> dict[tuple[str, str], Estimate]:
    """By (method, setting); a pyramid's maps are computed anew, as after each step of the light."""
    uniform = lambda: F.normalize(torch.randn(PUBLISHED, 3), dim=1)  # independent directions, as published
    found: dict[tuple[str, str], Estimate] = {
        ("uniform (paper)", f"n = {PUBLISHED}"): shared(light, uniform),
        ("uniform and queries (code)", f"n = {PUBLISHED}"): shared(light, uniform, True),
    }
    found |= {
        ("Fibonacci", f"n = {n}"): shared(light, partial(fibonacci_directions, n))
        for n in ((2048, 8192) if quick else (512, 2048, 8192, 32768))
    }
    found |= {("own lobe", f"n = {n}"): own_lobe(light, n) for n in ((16, 64) if quick else (4, 16, 64, 256))}
    found |= {
        ("filtered importance", f"n = {n}"): filtered_importance(light, n) for n in ((32,) if quick else (8, 32, 128))
    }
    found[HARMONICS, "degree 12"] = harmonics(light)
    found |= {("pyramid", f"{n} x {n}"): pyramid_of(light, n) for n in ((128,) if quick else (64, 128, 256))}
    return found


def run(quick: bool, rounds: int) -> Result:
    """Error against time for queries of one roughness, light by light; `quick`: few bands, one light and a coarser truth."""
    torch.manual_seed(0)
    shipped = preset("cpu")
    n_queries, height, n_truth = (256, 512, 1 << 14) if quick else (512, 1024, 1 << 16)
    charts, findings = [], []
    maps = lights()
    for name in list(maps)[-1:] if quick else maps:
        light = MapLight(maps[name])
        truth, methods = Truth(light, height, n_truth), estimators(light, quick)
        for rho in QUICK_BANDS if quick else BANDS:
            axes = F.normalize(torch.randn(n_queries, 3), dim=1)
            roughness = torch.full((n_queries, 1), rho)
            true = truth(axes, rho)
            able = {key: e for key, e in methods.items() if key[0] != HARMONICS or rho >= NARROWEST}
            calls = {key: lambda e=e: e(axes, roughness) for key, e in able.items()}
            with torch.no_grad():
                errors = {key: 100 * relative_rms([call() for _ in range(3)], true) for key, call in calls.items()}
                times = interleaved(calls, rounds)
            named = f"{name} light, roughness {rho:g}", f"ms for {n_queries} queries", "relative error, % RMS"
            chart = chart_of(*named, times, errors, defaults(shipped, rho))
            charts.append(chart)
            findings.append(finding(chart))
    return Result("prefilter", "The pre-integrated light: time against error", SOURCES, findings, charts)


def defaults(config: Config, rho: float) -> list[tuple[str, str]]:
    """The library's defaults at a roughness: the pyramid, and the consistency loss's estimate for `light.kind = mlp`."""
    narrow = ("own lobe", f"n = {config.constants.light_lobe_samples}")
    wide = ("Fibonacci", f"n = {config.constants.light_samples}")
    resolution = f"{config.light.resolution} x {config.light.resolution}"
    return [("pyramid", resolution), narrow if rho < config.constants.light_lobe_below else wide]


def relative_rms(estimates: list[Tensor], true: Tensor) -> float:
    """Root mean square error, divided by the truth's root mean square."""
    squared = torch.stack([(e - true).square().mean() for e in estimates]).mean()
    return float((squared / true.square().mean()).sqrt())


def finding(chart: Chart) -> str:
    """A comparison of the defaults with the best method not slower than the pyramid and with the published estimator."""
    mlp, own = sorted((p for p in chart.points if p.default), key=lambda p: p.series == "pyramid")
    rivals = [p for p in chart.points if not p.default and p.series != own.series and p.cost <= own.high]
    best = min(rivals, key=lambda p: p.error, default=None)
    published = chart.points[0]
    beside = f"; best of the others in that time: {best.series} {best.variant} {best.error:.2g} %" if best else ""
    return (
        f"{chart.title}: {own.series} {own.error:.2g} % in {own.cost:.2g} ms; for the MLP {mlp.series} {mlp.variant} "
        f"{mlp.error:.2g} % in {mlp.cost:.2g} ms{beside}; as published {published.error:.2g} % in {published.cost:.2g} ms"
    )
