"""What moves unknowns: AdamW, the solves of the refinement, and the exposures' means."""

from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import torch
from splitnerf.config import Config, preset
from splitnerf.ops._library import lib
from splitnerf.ops.shading import srgb_to_linear
from splitnerf.refinement.light import LOG_LIMIT, EnvironmentLight, footprints
from splitnerf.refinement.light_equations import LARGEST, LightEquations
from splitnerf.refinement.light_equations import Rows as LightRows
from splitnerf.refinement.normal_equations import NormalEquations, Prior
from splitnerf.refinement.texels import TexelPairs
from splitnerf.refinement.unknowns import GROUPS, N_UNKNOWNS
from splitnerf.training.exposure import (
    BRIGHTEST,
    COLOUR_ERROR,
    DARKEST,
    ENOUGH,
    ERROR,
    FARTHEST,
    KEEP,
    PhotoExposures,
    shrunk,
)
from splitnerf_tools.capture.photometry import find_exposures
from torch import Tensor

from stability.cases import Draw
from stability.entry import Entry, Rows
from stability.properties import Property

LR, DECAY, BETAS, EPS = 1e-2, 1e-2, (0.9, 0.99), 1e-8
LONG_RUN = 100_000  # steps
TEXELS = 24  # of one system
PHOTOS, POINTS = 6, 40


def draw_moments(draw: Draw, n: int) -> Rows:
    """Parameters, gradients and moments from nothing to where squares nearly overflow."""
    numbers = lambda: draw.signs(n, 1) * draw.radiance(n, 1, top=1e6)
    gradient = draw.signs(n, 1) * draw.mixed((0.0, 1e-45, 1e-30, 1e15), draw.logarithmic(1e-20, 1e10, n, 1))
    return {"param": numbers(), "gradient": gradient, "mean": numbers(), "square": draw.radiance(n, 1, top=1e30)}


def moved(rows: Rows, shared: Rows) -> Rows:
    """The third step of AdamW."""
    kept = [rows[name].clone() for name in ("param", "mean", "square")]
    param, mean, square = ([x] for x in kept)
    lib.adamw_steps_(param, [rows["gradient"]], mean, square, [LR], *BETAS, EPS, [DECAY], [3], [False], [], [])
    return dict(zip(("param", "mean", "square"), kept))


def repaired_moments(rows: Rows) -> Rows:
    return rows | {"gradient": rows["gradient"].clamp(-1e15, 1e15), "square": rows["square"].clamp(0, 1e30)}


def long_run(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Gradients of all sizes, noise and none; no step is longer than the inequality of Cauchy and Schwarz allows for m / sqrt(v)."""
    size = draw.mixed((0.0, 1e-38, 1e-8, 1e15), draw.logarithmic(1e-10, 1e10, n)).float()
    start = draw.normal(n).float()
    param, mean, square, worst = start.clone(), *torch.zeros(3, n)
    noise = draw.normal(997, n).float()
    longest = LR * (1 - BETAS[0]) / ((1 - BETAS[1]) * (1 - BETAS[0] ** 2 / BETAS[1])) ** 0.5
    for step in range(1, LONG_RUN + 1):
        before = param.clone()
        gradient = [size * noise[step % 997]]
        lib.adamw_steps_([param], gradient, [mean], [square], [LR], *BETAS, EPS, [0.0], [step], [False], [], [])
        worst = torch.maximum(worst, (param - before).abs())
    return worst.double() - 1.001 * longest - 1e-7 * param.abs() + 0 * square, {"param": start, "size": size}


@lru_cache(maxsize=1)
def chain() -> Prior:
    """A chain of texels: neighbours are joined, and each is held a little where it is."""
    pairs = TexelPairs(TEXELS, np.arange(TEXELS - 1)[:, None] + np.arange(2), torch.empty(0, 2, 2))
    weights = {name: torch.full((N_UNKNOWNS,), x) for name, x in (("smooth", 0.05), ("anchor", 1e-2))}
    return Prior(pairs=pairs, groups=GROUPS, flat=torch.zeros(N_UNKNOWNS), like=0.0, **weights)


def texels_solved(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """A step lowers the cost, in float64, by nearly as much as the exact solution does."""
    slopes = draw.mixed((0.0, 1e-6, 1e3), draw.normal(n, TEXELS, 3, N_UNKNOWNS), 0.3)
    rows = {"jacobian": slopes, "weights": draw.radiance(n, TEXELS, 3, top=1e6), "residual": draw.normal(n, TEXELS, 3)}
    rows = {name: x.float() for name, x in rows.items()}
    texels = (torch.arange(TEXELS)[:, None] + torch.arange(4)).clamp(max=TEXELS - 1)
    shares, here = torch.tensor([0.4, 0.3, 0.2, 0.1]).expand(TEXELS, 4), torch.zeros(TEXELS, N_UNKNOWNS)
    worst = torch.zeros(n, dtype=torch.float64)
    for case in range(n):
        equations = NormalEquations(here, chain(), 0.0)
        equations.add(texels, shares, *(x[case] for x in rows.values()))
        step = equations.step(here, None, 60).double().flatten()
        matrix, right = system(equations)
        best = torch.linalg.solve(matrix, right)
        gained, most = (x @ right - 0.5 * x @ matrix @ x for x in (step, best))
        worst[case] = 1 - gained / most - 0.1
    return worst, rows


def system(equations: NormalEquations) -> tuple[Tensor, Tensor]:
    """The matrix and the right side of the whole step, dense and float64."""
    curvature, prior = equations.curvature.double(), equations.prior
    typical = curvature.diagonal(dim1=1, dim2=2).mean(0)
    apart = torch.eye(TEXELS, dtype=torch.float64).diff(dim=0)
    joined = torch.kron(apart.T @ apart, torch.diag(prior.smooth.double() * typical))
    held = torch.block_diag(*(curvature + torch.diag(prior.anchor.double() * typical)))
    return held + joined, -equations.gradient.double().flatten()


def light_solved(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """From black to blinding skies and of slopes of all sizes: the light stays within its range and moves at most as far as a
    step may."""
    height, rays, k = 16, 12, 8
    worst, skies = torch.zeros(n, dtype=torch.float64), draw.radiance(n, height, 2 * height, 3, top=1e6).float()
    for case, sky in enumerate(skies):
        light = EnvironmentLight(sky)
        equations, before = LightEquations(light, 1.0), light.radiance().log()
        texels, shares = footprints(height, draw.directions(rays * k).float())
        slopes = (draw.signs(rays, 1, 1) * draw.radiance(rays, k, 3, top=1e3)).float()
        seen = light.radiance().view(-1, 3)[texels[:, 0]].view(rays, k, 3)
        weights, residual = (x.float() for x in (draw.radiance(rays, 3, top=1e3), draw.normal(rays, 3)))
        equations.add(LightRows(texels, shares, slopes, weights), seen, residual)
        length = equations.step(1.0)
        after = light.radiance().log().double()
        moved = (after - before).abs().max() - LARGEST - 1e-4
        worst[case] = torch.stack(
            [moved, after.abs().max() - LOG_LIMIT - 1e-4, torch.tensor(length - LARGEST - 1e-4)]
        ).max()
    return worst, {"radiance": skies}


class Photos(SimpleNamespace):
    """As much of a data set as exposures ask for."""

    def __len__(self) -> int:
        return len(self.exposures)


@lru_cache(maxsize=1)
def exposed() -> Config:
    return preset("cpu").replace({"exposure.refine": "yes"})


def exposures_found(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Factors are those of the closed form of 30 equal steps, in float64, and their mean stays that of the start."""
    steps, pixels = 30, 8
    view = torch.arange(PHOTOS).repeat_interleave(pixels)
    starts, worst = draw.logarithmic(1e-3, 1e3, n, PHOTOS), torch.zeros(n, dtype=torch.float64)
    photo = draw.mixed((0.0, 0.11, 0.97, 1.0), draw.uniform(n, len(view), 3)).float()
    ordinary = (srgb_to_linear(photo) / starts[:, view, None]).clamp(min=1e-30) * draw.logarithmic(0.5, 2, n, 1, 3)
    mean, whole = draw.mixed((0.0, 1e-38, 1e30), ordinary, 0.2).float(), torch.ones(len(view), 1)
    for case, start in enumerate(starts):
        found = PhotoExposures(Photos(exposures=start.numpy(), photographed=True), exposed(), torch.device("cpu"))
        for _ in range(steps):
            found.learn(view, torch.cat([photo[case], whole], 1), mean[case], whole[:, 0])
        light, logs = srgb_to_linear(photo[case].double()), start.float().double().log()[:, None]
        counts = ((light > DARKEST) & (light < BRIGHTEST)).all(1, keepdim=True)
        apart = (light.clamp(min=DARKEST) / mean[case].double().clamp(min=1e-4)).log() - logs[view]
        summed = lambda x: torch.where(counts, x, 0.0).view(PHOTOS, pixels, -1).sum(1) * (1 - KEEP**steps) / (1 - KEEP)
        expected = summed(apart.clamp(-FARTHEST, FARTHEST)) / (summed(whole.double()) + ENOUGH)
        expected = expected - expected.mean(0)
        level = expected.mean(1, keepdim=True)
        expected = shrunk(level, ERROR) + exposed().exposure.white_balance * shrunk(expected - level, COLOUR_ERROR)
        moved = found.factors.double().log() - logs
        worst[case] = torch.stack([(moved - expected).abs().max(), moved.mean(0).abs().max()]).max() - 1e-5
    return worst, {"exposures": starts.float(), "photo": photo, "mean": mean}


def gains_found(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Photographs' gains from points that all show, at some places black, clipped, or nearly so."""
    gains, light = draw.logarithmic(0.33, 3, n, PHOTOS), draw.logarithmic(0.04, 0.25, n, POINTS)
    values = draw.mixed((0.0, 1e-30, 1.0), gains[:, :, None] * light[:, None], 0.2)
    photo, point = np.divmod(np.arange(PHOTOS * POINTS), POINTS)
    rest, expected = (np.zeros(len(photo)), np.full(PHOTOS, np.nan)), gains.log() - gains.log().mean(1, keepdim=True)
    found = [find_exposures(photo, point, of_case.flatten().numpy(), *rest).gains for of_case in values]
    return (torch.from_numpy(np.log(found)) - expected).abs().amax(1) - 1e-3, {"values": values}


ENTRIES = (
    Entry(
        "adamw_steps_",
        draw=draw_moments,
        call=moved,
        repair=repaired_moments,
        bound=4e-6,
        floor=1e-30,
        reason="1 - beta of float32 betas, a few roundings, times how much the true value changes by those of the inputs",
    ),
)
PROPERTIES = (
    Property(
        "AdamW, 10^5 steps",
        long_run,
        "finite; no step is longer than its bound, with gradients from nothing to 1e15",
        size=LONG_RUN,
    ),
    Property(
        "NormalEquations.step",
        texels_solved,
        "lowers the cost by at least 0.9 of what the exact solution does",
        size=TEXELS,
        most=10**5,
    ),
    Property(
        "LightEquations.step",
        light_solved,
        "finite, within the range of the light, and no farther than a step may go",
        size=12,
        most=10**4,
    ),
    Property(
        "PhotoExposures.learn",
        exposures_found,
        "the factors of the closed form to 1e-5; their mean stays",
        size=8 * PHOTOS,
        most=10**6,
    ),
    Property(
        "find_exposures",
        gains_found,
        "the gains that the values were made with, to 1e-3",
        size=PHOTOS * POINTS,
        most=10**6,
    ),
)
