"""Checks of the losses; the gradient of the entropy is an output of its operator."""

from __future__ import annotations

import math

import torch

from splitnerf.ops._library import lib
from splitnerf_tools.doctor.table import N, axis, check, column, pattern, slopes


def pixels() -> tuple:
    grey, whole = torch.tensor([[0.6, 0.6, 0.6, 1.0]]).repeat(N, 1), torch.arange(N) % 2 == 1
    mean = 0.10702055 * torch.where(whole, 2.0, 1.0)[:, None].repeat(1, 3)
    return mean, torch.full((N,), 0.5), grey, torch.zeros(N, 3), whole, axis(2.0, 2.0, 2.0), True


@check
def pixel_losses():
    """sRGB 0.5, at twice the exposure, half covering black against 0.6, and half an opacity where the mask is full: 0.35^2 and
    ln 2. Of each second pixel, a whole one, twice that radiance half covers black: 0.1^2, and a tenth of ln 2."""
    yield lib.pixel_losses(*pixels()), torch.tensor([(0.35**2 + 0.1**2) / 2, 0.55 * math.log(2)])


def neighbours() -> tuple:
    gradients = torch.cat([axis(0.0, 0.0, 2.0, 16), axis(3**0.5, 0.0, 1.0, N - 16)])
    return gradients, pattern(16), torch.arange(N - 16) % 16


@check
def gradient_losses():
    """Gradients of length 2, and neighbours whose normals stand 60 degrees apart: both losses are 1."""
    losses, total = lib.gradient_losses(*neighbours())
    yield losses, torch.ones(2)
    yield total, pattern(16)[torch.arange(N - 16) % 16].sum()


def metals() -> tuple:
    return torch.full((N, 3), 0.1), column(0.3), pattern(N), False


@check
def material_losses():
    """Metallic 0.3 at an albedo of 0.1: 0.3^2, 0.3 0.7, and 0.3 (1 - 0.1 / 0.4)."""
    losses, total = lib.material_losses(*metals())
    yield losses, torch.tensor([0.09, 0.21, 0.225])
    yield total, pattern(N).sum()


@check
def log_chroma():
    """Channels e^.3, 1 and e^-.3 times a brightness: 2 .3^2 / 3."""
    tint = torch.exp(torch.tensor([[0.3, 0.0, -0.3]]))
    yield lib.log_chroma(pattern(N, 1) * tint), torch.tensor(0.06)


@check
def light_prior():
    """A grey texel of the finer level .9 from its neighbours, and one of the coarser 2 below the three others."""
    texels = torch.zeros(N, 3)
    texels[0], texels[4] = -2.0, 0.9
    coarse = (math.log1p(1.5**2 / 0.75) + 3 * math.log1p(0.5**2 / 0.75)) / 4
    yield lib.light_prior(texels, [4, N - 4]), torch.tensor(coarse + math.log1p(0.81 / 0.75) / (N - 4))


@check
def quadratic_entropy():
    """Two equal heaps of points at a distance of 2: -ln((1 + 1 / e) / 2)."""
    heaps = torch.cat([torch.zeros(N, 4), torch.ones(N, 4)])
    entropy, gradient = lib.quadratic_entropy(heaps)
    yield entropy, -math.log((1 + math.exp(-1)) / 2)
    yield from slopes(lambda x: lib.quadratic_entropy(x)[0], (heaps,), (0,), (gradient,))
