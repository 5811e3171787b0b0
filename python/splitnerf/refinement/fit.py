"""The fit of an asset's textures and of the light to photos."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset
from splitnerf.ops import MeshScene, monte_carlo_light, shade_sums
from splitnerf.ops.incoming_light import TexturedSurface, incoming_light
from splitnerf.refinement.light import EnvironmentLight, look_up
from splitnerf.refinement.pixels import PixelFilter, covered_pixels
from splitnerf.refinement.texels import AssetTexels, materials_of, texel_graph

GAMMA = 2.2
N = 7  # unknowns of a texel: albedo (3) as x^(1/2.2), roughness, metallic, x and y of the tangent-space normal


@dataclass
class Options:
    pixels: int = 2048
    directions: int = 12
    bounces: int = 3
    sweep: float = 0.25  # of all pixels
    forget: float = 0.7
    damping: float = 0.02
    smooth_albedo: float = 0.02
    smooth_gloss: float = 0.05
    smooth_normal: float = 0.05
    tv_albedo: float = 0.0
    tv_gloss: float = 0.0
    tv_normal: float = 0.0
    anchor: float = 1e-3
    rate_light: float = 0.002
    tv_light: float = 0.0
    final: float = 0.05
    cg: int = 20
    sat: float = 1.0


def to_unknowns(values: Tensor) -> Tensor:
    """[n, 7] unknowns of texture values [n, 8]."""
    albedo = values[:, :3].clamp(min=1e-4) ** (1 / GAMMA)
    return torch.cat([albedo, values[:, 3:5], F.normalize(values[:, 5:], dim=1)[:, :2]], dim=1)


def to_values(unknowns: Tensor) -> Tensor:
    """[n, 8] texture values of unknowns [n, 7]."""
    albedo, gloss, xy = unknowns.split([3, 2, 2], dim=1)
    z = (1.0 - xy.square().sum(1, keepdim=True)).clamp(min=0.01).sqrt()
    return torch.cat([albedo.clamp(0.01, 1.0) ** GAMMA, gloss[:, :1].clamp(0.03, 1.0), gloss[:, 1:].clamp(0.0, 1.0), xy, z], dim=1)


def into_range(unknowns: Tensor) -> Tensor:
    albedo, rough, metal, xy = unknowns.split([3, 1, 1, 2], dim=1)
    length = xy.norm(dim=1, keepdim=True).clamp(min=1e-6)
    return torch.cat([albedo.clamp(0.01, 1), rough.clamp(0.03, 1), metal.clamp(0, 1), xy * (length.clamp(max=0.9) / length)], dim=1)


def srgb_slope(linear: Tensor) -> Tensor:
    """d sRGB / d linear."""
    return torch.where(linear <= 0.0031308, 12.92, 1.055 / 2.4 * linear.clamp(min=1e-4) ** (1 / 2.4 - 1))


class Refinement:
    def __init__(self, dataset: Dataset, asset: Asset, environment: np.ndarray, options: Options, seed: int = 0):
        o = self.o = options
        self.pixels, self.filter = covered_pixels(dataset), PixelFilter()
        self.texels = AssetTexels(asset)
        self.graph = texel_graph(asset, self.texels.height)
        self.scene = MeshScene(asset.vertices, asset.triangles)
        self.light = EnvironmentLight(torch.from_numpy(environment))
        self.light_adam = torch.optim.Adam(self.light.levels, lr=o.rate_light, betas=(0.9, 0.99))
        self.random = np.random.default_rng(seed)
        self.vertex = [torch.from_numpy(np.ascontiguousarray(x, np.float32)) for x in (asset.normals, asset.tangents, asset.uv)]
        m = len(self.graph.index)
        self.row = torch.full((self.texels.height * self.texels.width,), -1, dtype=torch.int64)
        self.row[self.graph.index] = torch.arange(m)
        self.row = self.row[torch.from_numpy(self.graph.spread.source)]  # texels outside the charts read the nearest one inside
        self.theta = to_unknowns(self.texels.values[self.graph.index])
        self.start = self.theta.clone()
        self.h, self.b = torch.zeros(m, N, N), torch.zeros(m, N)
        self.steps, self.sweeps = 0, 0

    def values(self) -> Tensor:
        return to_values(self.theta)

    def maps(self):
        image = torch.from_numpy(self.graph.spread(self.values().numpy()))
        return tuple(part.contiguous() for part in image.split([3, 2, 3], dim=2))

    def gather(self, surface: TexturedSurface, progress: float) -> tuple[float, float]:
        """One batch of pixels: adds to the normal equations and moves the light."""
        o = self.o
        index = self.random.integers(0, len(self.pixels), o.pixels)
        offsets = np.concatenate([self.filter.draw(o.pixels, 1, self.random) for _ in range(2)], axis=1)
        origins, directions = self.pixels.rays(index, offsets)
        _, triangle, u, v = self.scene._scene.trace_closest(origins.reshape(-1, 3), directions.reshape(-1, 3))
        hit = (triangle >= 0).reshape(-1, 2).all(axis=1)
        index, keep = index[hit], np.repeat(hit, 2)
        samples = self.texels.sample(triangle[keep], u[keep], v[keep], -directions.reshape(-1, 3)[keep])
        rows = self.row[samples.footprints.texels]
        weights = samples.footprints.weights
        unknowns = (self.theta[rows] * weights[..., None]).sum(1).requires_grad_(True)
        m = materials_of(to_values(unknowns), samples)
        light = self.light.radiance()
        fixed = [x.detach() for x in m]
        arriving = incoming_light(
            surface, light.detach(), samples.positions, samples.geometric, fixed[3], samples.view_dirs, *fixed[:3],
            n_directions=o.directions, max_bounces=o.bounces, clamp_indirect=10.0, seed=self.steps,
        )  # fmt: skip
        sky = look_up(light, arriving.directions.view(-1, 3)).view_as(arriving.directions)
        radiance = sky * arriving.visible[..., None] + arriving.sent
        sums = monte_carlo_light(m.normals, samples.view_dirs, m.roughness, arriving.directions, arriving.pdf, radiance)
        out = shade_sums(m.normals, samples.view_dirs, m.albedo, m.roughness, m.metallic, sums, True)
        target = torch.from_numpy(self.pixels.target[index])
        saturated = torch.from_numpy(self.pixels.saturated[index])
        pairs = out.detach().view(-1, 2, 3)
        slope = srgb_slope(target.clamp(min=0.02))
        weight = slope.square()
        weight = torch.where(saturated & (pairs.mean(1) > target), 0.0, weight) if o.sat else weight
        residual = pairs - target[:, None]
        loss = (weight * residual[:, 0] * residual[:, 1]).mean().item()
        other = residual.flip(1).reshape(-1, 3)
        w = weight[:, None].expand(-1, 2, -1).reshape(-1, 3)
        grad_light = torch.autograd.grad(out, self.light.levels, w * other / len(w), retain_graph=True)
        jacobian = torch.stack([torch.autograd.grad(out[:, c].sum(), unknowns, retain_graph=c < 2)[0] for c in range(3)], 1)
        jw = jacobian * w[..., None]
        b = torch.einsum("ncp,nc->np", jw, other)
        h = torch.einsum("ncp,ncq->npq", jw, jacobian)
        flat, share = rows.view(-1), weights.reshape(-1, 1)
        self.b.index_add_(0, flat, b.repeat_interleave(4, 0) * share)
        self.h.view(-1, N * N).index_add_(0, flat, h.view(-1, N * N).repeat_interleave(4, 0) * share)
        if o.rate_light > 0:
            for level, g in zip(self.light.levels, grad_light):
                level.grad = g
            if o.tv_light > 0:
                (o.tv_light * self.light.variation()).backward()
            self.light_adam.param_groups[0]["lr"] = o.rate_light * (o.final + (1 - o.final) * 0.5 * (1 + math.cos(math.pi * min(1, progress))))
            self.light_adam.step()
        self.steps += 1
        return loss, residual.mean(1).mul(slope).square().mean().item()

    @torch.no_grad()
    def solve(self) -> dict[str, float]:
        """One Gauss-Newton step of all texels, with the priors."""
        o, g = self.o, self.graph
        typical = self.h.diagonal(dim1=1, dim2=2).mean(0)  # mean curvature of each unknown
        smooth = torch.tensor([o.smooth_albedo] * 3 + [o.smooth_gloss] * 2 + [o.smooth_normal] * 2) * typical
        tv = torch.tensor([o.tv_albedo] * 3 + [o.tv_gloss] * 2 + [o.tv_normal] * 2)
        i, j = g.pairs.unbind(1)
        apart = self.theta[i] - self.theta[j]
        edge = torch.cat([part.square().sum(1, keepdim=True).expand(-1, part.shape[1]) for part in apart.split([3, 2, 2], 1)], 1)
        robust = tv * typical * 0.02 / (edge + 0.01**2).sqrt()  # IRLS weights of an L1 penalty on the values
        anchor = o.anchor * typical

        def laplacian(x: Tensor, w: Tensor) -> Tensor:
            d = (x[i] - x[j]) * w
            return torch.zeros_like(x).index_add_(0, i, d).index_add_(0, j, -d)

        regular = self.h + torch.diag_embed(o.damping * self.h.diagonal(dim1=1, dim2=2) + anchor)
        right = -(self.b + laplacian(self.theta, robust) + anchor * (self.theta - self.start))
        both = robust + smooth
        count = torch.zeros(len(self.theta), N).index_add_(0, i, both).index_add_(0, j, both)
        inverse = torch.linalg.inv(regular + torch.diag_embed(count))

        def apply(x):
            return torch.einsum("npq,nq->np", regular, x) + laplacian(x, both)

        x = torch.zeros_like(right)
        r = right.clone()
        z = torch.einsum("npq,nq->np", inverse, r)
        p, rz = z.clone(), (r * z).sum()
        for _ in range(o.cg):
            ap = apply(p)
            alpha = rz / (p * ap).sum().clamp(min=1e-30)
            x += alpha * p
            r -= alpha * ap
            z = torch.einsum("npq,nq->np", inverse, r)
            rz, old = (r * z).sum(), rz
            p = z + (rz / old) * p
        limit = torch.tensor([0.15] * 3 + [0.15, 0.3] + [0.15] * 2)
        new = into_range(self.theta + x.clamp(-limit, limit))
        moved = new - self.theta
        self.theta = new
        self.b = o.forget * (self.b + torch.einsum("npq,nq->np", self.h, moved))
        self.h *= o.forget
        self.sweeps += 1
        return {"moved": moved.square().mean(0).sqrt().tolist()}


def fit(refinement: Refinement, minutes: float, log=print) -> None:
    started = time.monotonic()
    progress = lambda: (time.monotonic() - started) / (60 * minutes)  # noqa: E731
    r, o = refinement, refinement.o
    n = max(1, round(o.sweep * len(r.pixels) / o.pixels))
    while progress() < 1:
        surface = TexturedSurface(r.scene, *r.vertex, *r.maps())
        numbers = [r.gather(surface, progress()) for _ in range(n)]
        at = time.monotonic()
        moved = r.solve()["moved"]
        loss, noisy = np.mean(numbers, axis=0)
        log(f"{progress():5.1%} sweep {r.sweeps} of {n} batches: loss {loss:.3g} {-10 * math.log10(max(loss, 1e-9)):.2f} dB noisy {noisy:.3g} solve {time.monotonic() - at:.1f} s moved " + " ".join(f"{x:.3f}" for x in moved), flush=True)
