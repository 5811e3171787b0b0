"""The errors of the split sum against the integral that it splits."""

import itertools

import numpy as np
import torch
from scipy import ndimage
from splitnerf.ops import light_queries, split_sum_shade
from splitnerf.ops.shading import QUERIES, LightSums, monte_carlo_light, shade_sums, summed_light
from splitnerf_tools.bench.charts import Result
from splitnerf_tools.bench.prefilter import Truth
from splitnerf_tools.bench.subjects import MapLight, lights
from stability.cases import drawn_directions
from torch import Tensor
from torch.nn import functional as F

ROUGHNESS = (0.1, 0.2, 0.3, 0.5, 0.7, 0.9)
COSINES = (0.1, 0.5, 0.9)  # n.v
MATERIALS = {"metal": (1.0, 1.0), "dielectric": (0.0, 0.5)}  # metallic, albedo
N_NORMALS = 64
GROUPS = 4  # groups of samples of the truth
LAMP_SHARE = 5e-4  # share of the texels, the brightest ones, that count as lamps
PARTS = 4  # parts of a lamp's texel along its edge
SOURCES = ("cpp/*split_sum*", "cpp/*brdf_lut*", "cpp/*monte_carlo*", "python/splitnerf/ops/shading.py")
NOISE = "noise"


def run(quick: bool, rounds: int) -> Result:
    """Errors against sums over many samples of the BSDF; nothing is timed.

    Args:
        quick: Whether to use few roughnesses and fewer samples.
        rounds: Not used, since nothing is timed.
    """
    torch.manual_seed(0)
    rows, findings, ratios = [], [], {material: [] for material in MATERIALS}
    maps = lights()
    levels = ROUGHNESS[1::2] if quick else ROUGHNESS
    n_samples, height = (1024, 256) if quick else (8192, 1024)
    normals, across = (F.normalize(torch.randn(N_NORMALS, 3), dim=1) for _ in range(2))
    for name in list(maps)[:1] if quick else maps:
        light = SplitLight(maps[name])
        truth = Truth(light.whole, height, 1 << 14)
        worst: dict[str, float] = dict.fromkeys((*QUERIES, NOISE), 0.0)
        for rho in levels:
            row = [name, f"{rho:g}"]
            for (material, (metallic, albedo)), cosine in itertools.product(MATERIALS.items(), COSINES):
                views = views_at(normals, across, cosine)
                errors = split_errors(light, truth, normals, views, rho, metallic, albedo, n_samples)
                row.append(" / ".join(f"{100 * errors[query]:.1f}" for query in QUERIES))
                worst = {key: max(worst[key], errors[key]) for key in worst}
                if rho >= 0.5:
                    ratios[material].append(errors["mean"] / errors["reflection"])
            rows.append(row)
        findings.append(
            f"{name} light, largest error: "
            + ", ".join(f"{100 * worst[q]:.0f} % queried at the {q}" for q in QUERIES)
            + f"; noise of the truth at most {100 * worst[NOISE]:.1f} %"
        )
    findings += [
        f"{material}, roughness 0.5 to 0.9: the mean has the smaller error in {sum(r < 1 for r in found)} of {len(found)} cases; "
        f"its error is {min(found):.2f} to {max(found):.2f} times that of the reflection"
        for material, found in ratios.items()
    ]
    heads = ["light", "roughness", *(f"{material}, n.v {c:g}" for material in MATERIALS for c in COSINES)]
    title = f"Relative error of the radiance, % RMS over normals, queried at the {' / '.join(QUERIES)}"
    tables = [(title, heads, rows)]
    tables.append(furnace())
    return Result("split_sum", "The split sum: what it costs in error", SOURCES, findings, tables=tables)


class SplitLight:
    """A map as the sum of two: lamps, integrated by quadrature over their texels, and the rest, integrated by samples.

    Args:
        radiance: [h, w, 3].
    """

    def __init__(self, radiance: np.ndarray):
        height, width = radiance.shape[:2]
        level = np.quantile(radiance.max(-1), 1 - LAMP_SHARE)
        rest = np.minimum(radiance, level)
        self.whole, self.rest, self.lamps = (MapLight(m.astype(np.float32)) for m in (radiance, rest, radiance - rest))
        # A bilinear map is not zero up to a texel beside its lamps.
        lit = ndimage.binary_dilation((radiance > level).any(-1), np.ones((3, 3)))
        rows, columns = np.nonzero(lit)
        inside = (np.arange(PARTS) + 0.5) / PARTS
        v = ((rows[:, None] + inside) / height)[:, :, None]
        u = ((columns[:, None] + inside) / width)[:, None, :]
        v, u = (np.broadcast_to(x, (len(rows), PARTS, PARTS)).reshape(-1) for x in (v, u))
        polar, azimuth = np.pi * v, 2 * np.pi * (0.5 - u)
        self.directions = torch.from_numpy(
            np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], 1)
        ).float()
        self.solid_angles = torch.from_numpy(np.sin(polar) * 2 * np.pi**2 / (height * width * PARTS**2)).float()


def views_at(normals: Tensor, across: Tensor, cosine: float) -> Tensor:
    """[n, 3] directions at this cosine to the normals."""
    aside = F.normalize(torch.linalg.cross(normals, across), dim=1)
    return cosine * normals + (1 - cosine**2) ** 0.5 * aside


def split_errors(
    light: SplitLight, truth: Truth, normals: Tensor, views: Tensor, rho: float, metallic: float, albedo: float, n: int
) -> dict[str, float]:
    """Relative RMS error over the normals, by the query direction of g, and that of the truth itself.

    Args:
        light, truth: The light, and its pre-integral.
        normals, views: [k, 3].
        rho, metallic, albedo: The roughness, metallic and albedo of the material, each in [0, 1].
        n: The number of BSDF samples in each of `GROUPS` groups; the spread of the groups measures the noise.
    """
    count, column = len(normals), torch.ones(len(normals), 1)
    roughness, metal, colour = rho * column, metallic * column, albedo * torch.ones(count, 3)
    material = {"albedo": colour, "roughness": roughness, "metallic": metal, "compensate": True}
    diffuse = truth(normals, 1.0)
    seen = torch.ones(count, len(light.directions))
    lamps = summed_light(
        normals, views, roughness, light.directions, light.solid_angles, light.lamps(light.directions), seen
    )
    groups = []
    for seed in range(GROUPS):
        directions, pdf = drawn_directions(normals, views, roughness, 0.2 + 0.6 * metallic, n, seed)
        radiance = light.rest(directions.reshape(-1, 3)).view(count, n, 3)
        rest = monte_carlo_light(normals, views, roughness, directions, pdf, radiance)
        whole = LightSums(*(a + b for a, b in zip(rest, lamps)))._replace(diffuse=diffuse)
        groups.append(shade_sums(normals, views, **material, sums=whole))
    true = torch.stack(groups).mean(0)
    size = true.square().mean().sqrt()
    errors = {NOISE: float(torch.stack(groups).std(0).square().mean().sqrt() / GROUPS**0.5 / size)}
    for query in QUERIES:
        specular = truth(light_queries(normals, views, roughness, query)[0][:count], rho)
        out = split_sum_shade(normals, views, **material, specular=specular, diffuse=diffuse)
        errors[query] = float((out - true).square().mean().sqrt() / size)
    return errors


def furnace() -> tuple[str, list[str], list[list[str]]]:
    """The share of constant light that a white metal reflects at normal incidence; 1 would be free of loss."""
    rows = []
    axis, ones, one = torch.tensor([[0.0, 0.0, 1.0]]), torch.ones(1, 3), torch.ones(1, 1)
    for rho in ROUGHNESS:
        values = [
            split_sum_shade(
                axis, axis, albedo=ones, roughness=rho * one, metallic=one, specular=ones, diffuse=ones, compensate=on
            )
            for on in (False, True)
        ]
        rows.append([f"{rho:g}", *(f"{v.mean().item():.3f}" for v in values)])
    return "Reflectance of a white metal, n.v = 1", ["roughness", "single scattering", "compensated"], rows
