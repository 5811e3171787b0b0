"""The split sum itself: how far it is from the integral that it splits, and its table from what it tabulates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.bench.charts import Chart, Point, Result
from splitnerf.bench.lights import MapLight, lights
from splitnerf.bench.prefilter import Truth
from splitnerf.ops import (
    QUERIES,
    LightSums,
    monte_carlo_light,
    query_direction,
    sample_bsdf,
    shade_sums,
    split_sum_shade,
)

ROUGHNESS = (0.1, 0.2, 0.3, 0.5, 0.7, 0.9)
COSINES = (0.1, 0.5, 0.9)  # n.v
MATERIALS = {"metal": (1.0, 1.0), "dielectric": (0.0, 0.5)}  # metallic, albedo
FINEST = 256  # quadrature points of a table's entry
CHECKED = 41  # roughnesses and cosines that tables are held against


def run(quick: bool, rounds: int) -> Result:
    """Errors against sums over many samples of the BSDF; nothing is timed.

    Args:
        quick: Few roughnesses and fewer samples.
        rounds: Not used: time plays no part.
    """
    torch.manual_seed(0)
    tables, findings = [], []
    maps = lights()
    levels = ROUGHNESS[1::2] if quick else ROUGHNESS
    n_samples, height = (1024, 256) if quick else (8192, 1024)
    for name in list(maps)[:1] if quick else maps:
        light = MapLight(maps[name])
        rows, truth = [], Truth(light, height, 1 << 14)
        worst: dict[str, float] = dict.fromkeys(QUERIES, 0.0)
        for material, (metallic, albedo) in MATERIALS.items():
            for rho in levels:
                row = [material, f"{rho:g}"]
                for cosine in COSINES:
                    errors = split_errors(light, truth, rho, cosine, metallic, albedo, n_samples)
                    row += [f"{100 * errors[query]:.1f}" for query in QUERIES]
                    worst = {query: max(worst[query], errors[query]) for query in QUERIES}
                rows.append(row)
        heads = ["material", "roughness", *(f"n.v {c:g}, {query}" for c in COSINES for query in QUERIES)]
        tables.append((f"Relative error of the radiance, % RMS over normals, {name} light", heads, rows))
        findings.append(
            f"{name} light, largest error: " + ", ".join(f"{100 * worst[q]:.0f} % asked at the {q}" for q in QUERIES)
        )
    tables.append(furnace())
    chart = table_chart((8, 16, 32) if quick else (8, 16, 32, 64))
    shipped = next(p for p in chart.points if p.default)
    fit = next(p for p in chart.points if p.series == "Karis 2014, fit")
    findings.append(
        f"the table of 32 x 32 over sqrt(n.v): RMS error {shipped.error:.1g} of F1 and F2; an analytic fit: {fit.error:.1g}"
    )
    return Result("split_sum", "The split sum: what it costs in error", findings, [chart], tables)


def split_errors(
    light: MapLight, truth: Truth, rho: float, cosine: float, metallic: float, albedo: float, n_samples: int
) -> dict[str, float]:
    """Relative RMS error over 64 normals by the direction at which g is asked."""
    n = 64
    normals = F.normalize(torch.randn(n, 3), dim=1)
    across = F.normalize(torch.linalg.cross(normals, torch.randn(n, 3)), dim=1)
    views = cosine * normals + (1 - cosine**2) ** 0.5 * across
    column = torch.ones(n, 1)
    roughness, metal, colour = rho * column, metallic * column, albedo * torch.ones(n, 3)
    directions, pdf = sample_bsdf(normals, views, roughness, n_samples)
    radiance = light(directions.reshape(-1, 3)).view(n, n_samples, 3)
    sums = monte_carlo_light(normals, views, roughness, directions, pdf, radiance)
    diffuse = truth(normals, 1.0)
    true = shade_sums(normals, views, colour, roughness, metal, LightSums(sums.specular, sums.grazing, diffuse), True)
    errors = {}
    for query in QUERIES:
        specular = truth(query_direction(normals, views, roughness, query), rho)
        out = split_sum_shade(
            normals,
            views,
            colour,
            roughness,
            metal,
            specular,
            diffuse,
            torch.ones(n, 3),
            torch.ones(n, 3),
            compensate=True,
        )
        errors[query] = float(((out - true).square().mean() / true.square().mean()).sqrt())
    return errors


def furnace() -> tuple[str, list[str], list[list[str]]]:
    """What a white metal reflects of constant light, at normal incidence: 1, had it lost nothing."""
    rows = []
    axis, ones = torch.tensor([[0.0, 0.0, 1.0]]), torch.ones(1, 3)
    for rho in ROUGHNESS:
        values = [
            split_sum_shade(
                axis, axis, ones, torch.full((1, 1), rho), torch.ones(1, 1), ones, ones, ones, ones, compensate=on
            )
            for on in (False, True)
        ]
        rows.append([f"{rho:g}", *(f"{v.mean().item():.3f}" for v in values)])
    return "Reflectance of a white metal, n.v = 1", ["roughness", "single scattering", "compensated"], rows


def table_chart(sizes: tuple[int, ...]) -> Chart:
    """F1 and F2 of tables by size and spacing, and of an analytic fit, against quadrature."""
    rho, cosine = np.linspace(0.02, 1, CHECKED), np.linspace(0.02, 1, CHECKED)
    true = np.array([[_core.integrate_brdf(c, r, FINEST)[:2] for c in cosine] for r in rho])
    spacings: dict[str, tuple[Callable, Callable]] = {
        "table over sqrt(n.v)": (np.square, np.sqrt),
        "table over n.v": (abs, abs),
    }
    points = []
    for series, (to_cosine, from_cosine) in spacings.items():
        for size in sizes:
            nodes = np.linspace(0, 1, size)
            entries = [[_core.integrate_brdf(max(to_cosine(x), 1e-4), r, FINEST) for x in nodes] for r in nodes]
            found = bilinear(np.array(entries), rho, from_cosine(cosine))[..., :2]
            cost = 12 * size * size
            default = size == len(_core.brdf_lut()) and to_cosine is np.square
            points.append(Point(series, f"{size} x {size}", cost, rms(found - true), cost, cost, default))
    fit = karis_fit(rho[:, None], cosine[None, :])
    points.append(Point("Karis 2014, fit", "8 numbers", 32, rms(fit - true), 32, 32))
    return Chart("F1 and F2 against quadrature", "bytes held", "RMS error", points)


def bilinear(table: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """[len(rows), len(columns), C] of a [n, n, C] table whose nodes are spread over [0, 1]."""
    y, x = (t * (len(table) - 1) for t in (rows, columns))
    y0, x0 = (np.minimum(t.astype(int), len(table) - 2) for t in (y, x))
    fy, fx = (y - y0)[:, None, None], (x - x0)[None, :, None]
    upper, lower = (table[y0 + k][:, x0] * (1 - fx) + table[y0 + k][:, x0 + 1] * fx for k in (0, 1))
    return upper * (1 - fy) + lower * fy


def karis_fit(roughness: np.ndarray, n_dot_v: np.ndarray) -> np.ndarray:
    """[..., 2] F1 and F2 by the approximation of Karis 2014, "Physically Based Shading on Mobile"."""
    r = [a * roughness + b for a, b in ((-1, 1), (-0.0275, 0.0425), (-0.572, 1.04), (0.022, -0.04))]
    edge = np.minimum(r[0] * r[0], np.exp2(-9.28 * n_dot_v)) * r[0] + r[1]
    return np.stack([-1.04 * edge + r[2], 1.04 * edge + r[3]], -1)


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x * x)))
