"""Checks of the pre-integrated light and of the cached visibility."""

from __future__ import annotations

import torch

from splitnerf.ops import sh_projection, zonal_factors
from splitnerf.ops._library import lib
from splitnerf_tools.doctor.table import N, axis, check, column, slopes, sphere


@check
def prefilter_light():
    """A light of one colour stays it; at roughness 1 the weights are the cosines."""
    queries, lights = sphere(N), sphere(256)
    gbar, weight = lib.prefilter_light(queries, column(1.0), lights, axis(1.0, 2.0, 3.0, 256))
    yield gbar, axis(1.0, 2.0, 3.0)
    yield weight, (queries @ lights.T).clamp(min=0).sum(1)


@check
def sample_ggx_lobe():
    """At roughness 1 the lobe is the cosine's, whose mean cosine is 2 / 3."""
    directions = lib.sample_ggx_lobe(sphere(N), column(1.0), 512, 0)
    yield directions.norm(dim=2), torch.ones(N, 512)
    yield (directions * sphere(N)[:, None]).sum(2).mean(1), torch.full((N,), 2 / 3), 3e-3


@check
def sparse_product():
    """The matrix ((1, 2), (0, 3)), and its transpose as the gradient."""
    rows = torch.tensor([0, 2, 3]), torch.tensor([0, 1, 1], dtype=torch.int32), torch.tensor([1.0, 2.0, 3.0])
    transposed = torch.tensor([0, 1, 3]), torch.tensor([0, 0, 1], dtype=torch.int32), torch.tensor([1.0, 2.0, 3.0])
    values = torch.tensor([[1.0, 10.0, 100.0], [2.0, 20.0, 200.0]])
    yield lib.sparse_product(*rows, *transposed, values), torch.tensor([[5.0, 50.0, 500.0], [6.0, 60.0, 600.0]])
    yield from slopes(lib.sparse_product, (*rows, *transposed, values), (6,))


def pyramid(texels: torch.Tensor) -> tuple:
    """Directions and roughness of all kinds, one map, and its harmonics from a roughness of 0.5 on."""
    harmonics = sh_projection(8, True).to(texels.device) @ texels
    nodes = torch.tensor([8], device="cpu"), torch.tensor([0.1, 0.5], dtype=torch.float64, device="cpu")
    lobe = zonal_factors(0.5, 5).to(texels.device)
    return sphere(N), torch.linspace(0.01, 1.1, N)[:, None], texels, harmonics, *nodes, lobe


@check
def light_lookup():
    """A light of one colour stays it, in the map and in spherical harmonics under the lobe."""
    yield lib.light_lookup(*pyramid(axis(1.0, 2.0, 3.0, 64))), axis(1.0, 2.0, 3.0)


def half_blocked() -> tuple[tuple, torch.Tensor]:
    """The cache of one vertex at the origin, before which the lower half of the 32 upper of 64 directions is blocked.

    Also the share of the cosine-weighted upper directions that is open.
    """
    directions = sphere(64)
    bits = torch.tensor([[[0xFFFF, 0], [-0x10000, 0]]], dtype=torch.int32)
    starts, order = torch.tensor([[0, 1]], dtype=torch.int32), torch.tensor([[0]], dtype=torch.int32)
    hits, sent = torch.zeros(1, 64, dtype=torch.int32), axis(1.0, 2.0, 3.0, 1)
    cache = torch.zeros(1, 3), axis(0.0, 0.0, 1.0, 1), starts, order, 1.0, bits, hits, sent, directions
    return cache, directions[:16, 2].sum() / directions[:32, 2].sum()


@check
def cached_occlusion():
    """Half of the directions is blocked: the open share of the cosines, at roughness 1 for both lobes."""
    cache, share = half_blocked()
    up = axis(0.0, 0.0, 1.0)
    factors = lib.cached_occlusion(torch.zeros(N, 3), up, up, column(1.0), *cache, axis(1.0, 2.0, 3.0, 64))
    for occlusion, sent in zip(factors[:2], factors[2:]):
        yield occlusion, share
        yield sent, (1 - share) * axis(1.0, 2.0, 3.0)


@check
def cached_visibility():
    """Half of the upper directions is blocked, and light comes from there; nothing is known of the lower ones."""
    visible, arriving = lib.cached_visibility(torch.zeros(N, 3), axis(0.0, 0.0, 1.0), *half_blocked()[0])
    blocked = torch.cat([torch.zeros(16), torch.ones(16), torch.zeros(32)])
    yield visible, 1 - blocked
    yield arriving, blocked[:, None] * torch.tensor([1.0, 2.0, 3.0])
