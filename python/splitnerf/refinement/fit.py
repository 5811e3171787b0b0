"""The fit of an asset's textures and of the light to photos, through the path tracer's model.

A pixel is seen by two rays through its filter, and each ray's point by directions of its own. The error of one ray's
colour times that of the other is the squared error without the noise (in expectation), and one ray's derivatives times
the other's error are its gradient. An error counts as at the tone of the brightest pixel around it: shape and normals
are never quite true, and a highlight a pixel off its place would cost more in the dark next to its place than in it,
and all lamps would come out too dim. Batches of pixels are gathered into normal equations of the texels and of the
light, and a sweep of batches ends with a step of each.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset, spread
from splitnerf.data.environment import turn_environment
from splitnerf.data.tensor_files import check_tensor
from splitnerf.errors import InputError
from splitnerf.ops import MeshScene
from splitnerf.ops.shading import monte_carlo_light, shade_sums
from splitnerf.ops.visibility import TexturedSurface, incoming_light
from splitnerf.refinement.lamps import CompactLamp, compact_lamp, power_of
from splitnerf.refinement.level import at_level, level_of_light, rest_level, tint_of_light
from splitnerf.refinement.light import EnvironmentLight, footprints, read
from splitnerf.refinement.light_equations import LightEquations, Rows
from splitnerf.refinement.normal_equations import NormalEquations, Prior
from splitnerf.refinement.pixels import HELD_OUT, PixelFilter, covered_pixels, held_out
from splitnerf.refinement.similar_texels import SimilarTexels
from splitnerf.refinement.texels import (
    PATCH_PIXELS,
    AssetTexels,
    SurfaceSamples,
    materials_of,
    patch_width,
    texels_per_pixel,
)
from splitnerf.refinement.unknowns import GROUPS, STEP_LIMITS, into_range, per_unknown, to_unknowns, to_values

CLAMP_INDIRECT = 10.0
MOST_GROUPS, GROUP_ROUNDS = 24, 10  # of photos whose lights have about one rotation; rounds of the search for them
BOUNCES = 3  # scattering events of interreflection
KEEP = 0.9  # share of the observations that is kept after a sweep
# Weights of the prior; three numbers are those of albedo, gloss and normal.
SMOOTH = 1.0, 2.0, 1.0  # differences of neighbours' steps where a texel is as wide as a pixel; finer texels: more
FLAT = 0.0, 0.5, 2.0  # differences of neighbours' values; edges cost little
LIKE = 0.5, 2.0  # differences of a texel's roughness and metallic from the usual ones of its colour
ANCHOR = 0.02  # distance from the start
SWEEPS_OF_LARGE_STEPS = 4  # afterwards the light's steps are half as large, to average over the noise of sweeps
SWEEP_PIXELS = 1 << 18  # the most pixels of a sweep: more steps are worth more than more pixels
LEAST_BATCHES, HELD_SEED = 8, 1 << 30  # of a sweep, however short the time; of the directions for pixels held out
# Factor on the error of held-out pixels: measured 1.0 to 1.4 on three objects; where the level was wrong 2.2 (porcelain), 4.0 (a casket), 5.1 (gold leaf).
LEVEL_MAY_COST = 1.5
PULL_MAY_COST = 1.01  # likewise: measured 1.00 to 1.01 on a teapot of one metal, to which the pull is worth 1 dB; 1.01 to 1.09 on three others
SIGMAS = 2.0  # by which errors must be larger than others to be worse
# linear value below which errors weigh as at this one; most that a pixel's squared error counts: the rare ray that meets a lamp would decide alone
MIN_TONE, MOST_ERROR = 0.02, 0.1


@dataclass(frozen=True)
class FitSettings:
    """What the fit does.

    Attributes:
        sweeps: Gauss-Newton steps.
        minutes: Time limit of the outline and the sweeps, see :class:`splitnerf.refinement.stage.Stage`; 0: none.
        sweep_share: Pixels of a sweep as a share of all, at most SWEEP_PIXELS, and fewer where the minutes are short.
        pixels: Pixels of a batch.
        directions: Directions of a ray's point.
        light_step: Share of the light's first Gauss-Newton step that is taken, less of the later ones; 0 keeps the
            light.
        outline: Whether vertices move first, so that the asset covers the pixels as the masks do.
        albedo_size: The most texels along the edge of the albedo's texture, which in the end gets the photos' detail; 0: it does not.
        seed: Seed of all random numbers.
    """

    sweeps: int = 16
    minutes: float = 0.0
    sweep_share: float = 0.25
    pixels: int = 2048
    directions: int = 12
    light_step: float = 0.5
    outline: bool = True
    albedo_size: int = 4096
    seed: int = 0


class Shaded(NamedTuple):
    """Radiance of n points towards the viewer, from k directions of the light."""

    colours: Tensor  # [n, 3] linear radiance
    radiance: Tensor  # [n, k, 3] light that arrives, a leaf of the graph
    visible: Tensor  # [n, k] 1 where the environment is seen, 0 where the asset blocks it
    texels: Tensor  # [n k, 4] like shares: where the environment is read
    shares: Tensor
    sky: Tensor  # [n, k, 3] radiance of the environment


class Observed(NamedTuple):
    """b pixels of photos, each seen by two rays."""

    texels: Tensor  # [2 b, 4] like shares: where the rays' points read the textures
    shares: Tensor
    unknowns: Tensor  # [2 b, 7] a leaf of the graph
    shaded: Shaded  # the light that the points send
    weights: Tensor  # [b, 3] of the squared errors
    errors: Tensor  # [b, 2, 3] of the rays' colours

    def squared(self) -> Tensor:
        """[b] squared errors without noise, in expectation, but for the limit MOST_ERROR to both sides."""
        return (self.weights * self.errors[:, 0] * self.errors[:, 1]).mean(1).clamp(-MOST_ERROR, MOST_ERROR)


def is_worse(errors: np.ndarray, others: np.ndarray) -> bool:
    """Whether errors of batches [n] are larger than others of the same batches by SIGMAS standard errors of their difference."""
    more = np.asarray(errors) - others
    return bool(more.mean() > SIGMAS * more.std(ddof=1) / math.sqrt(len(more)))


class Refinement:
    """The state of a fit.

    Args:
        dataset: The photos, in the world frame of the asset.
        asset: An asset with one material, textured with albedo, roughness-metallic and normals of one square size.
        environment: [h, 2 h, 3] linear radiance to start from, h = 8 2^k.
        settings: What the fit does.

    Attributes:
        patch_width: See :func:`splitnerf.refinement.texels.patch_width`.
        tint: [3] See :func:`splitnerf.refinement.level.tint_of_light`; 1 where photos show what else shines on the object.
        is_like: Whether texels are drawn to the usual gloss of their colour, see :class:`splitnerf.refinement.similar_texels.SimilarTexels`.
        sightings: How many pixels of all photos there are for each pixel's width squared of the surface, on average.
    """

    def __init__(self, dataset: Dataset, asset: Asset, environment: np.ndarray, settings: FitSettings):
        s = self.settings = settings
        self.pixels, self.filter = covered_pixels(dataset), PixelFilter()
        if len(self.pixels) == 0:
            raise InputError("the masks of the photos cover no pixel; give data with masks")
        self.texels = AssetTexels(asset)
        self.scene = MeshScene(asset.vertices, asset.triangles)
        self.vertex_values = [
            torch.from_numpy(np.ascontiguousarray(x, np.float32)) for x in (asset.normals, asset.tangents, asset.uv)
        ]
        self.turns = None if dataset.light_turns is None else torch.from_numpy(dataset.light_turns)
        self.seen = dataset.surroundings if self.turns is None else None
        held = held_out(self.pixels)
        self.fitted = Draws(np.flatnonzero(~held), self.pixels.view, dataset.light_turns)
        # fewer than eight pixels judge themselves
        self.held = Draws(np.flatnonzero(held), self.pixels.view, dataset.light_turns) if held.any() else self.fitted
        self.random = np.random.default_rng(s.seed)
        pixel = texels_per_pixel(dataset, asset)
        self.patch_width = patch_width(pixel)
        self.sightings = len(self.pixels) * pixel**2 / max(len(self.texels.index), 1)
        smooth = max(1.0, self.patch_width / PATCH_PIXELS) ** 2 * per_unknown(*SMOOTH)
        flat, anchor, like = per_unknown(*FLAT), per_unknown(*[ANCHOR] * 3), torch.tensor(LIKE)
        self.prior = Prior(self.texels.pairs, smooth, flat, GROUPS, anchor, like)
        self.n_batches = self.n_sweeps = 0
        self.step_seconds = 0.0  # that the last sweep took after its batches
        self.tint = tint_of_light(self.texels.start) if self.seen is None else torch.ones(3)
        albedo, others = self.texels.start.split([3, 5], dim=1)
        self.trained = torch.cat([albedo / self.tint, others], dim=1), torch.from_numpy(environment) * self.tint
        self.begin_at(1.0)

    def begin_at(self, level: float, lamp_gain: float = 1.0) -> None:
        """Begins the fit with the asset as it was given, seen under its light at a level that dielectrics ask for, and under a lamp that is set
        afterwards and makes all light's power larger by a factor `lamp_gain`."""
        (values, light), self.found, self.lamp_gain = self.trained, level, lamp_gain
        self.level = rest_level(level, lamp_gain)
        self.texels.start = values if level == lamp_gain == 1.0 else at_level(values, level, lamp_gain)
        self.light = EnvironmentLight(light * self.level)
        self.light_equations = LightEquations(self.light, surroundings=self.seen)
        self.unknowns = to_unknowns(self.texels.start)
        self.equations, self.similar, self.is_like = NormalEquations(self.unknowns, self.prior, KEEP), None, True

    def find_level(self, held: np.ndarray) -> np.ndarray:
        """Begins with a brighter light where the texels tell of one and the photos held out, whose errors [n] are given, are
        explained as well under it; returns their errors then."""
        level = level_of_light(self.texels.start)
        if level == 1.0:
            return held
        self.begin_at(level)
        brighter = self.held_errors()
        if is_worse(brighter, LEVEL_MAY_COST * held):
            self.begin_at(1.0)
            return held
        return brighter

    def make_lamp_compact(self) -> CompactLamp | None:
        """Makes the brightest lobe of the light compact if mirror images or its shadow's edge in the albedo show a lamp; else None."""
        if self.turns is not None:  # its shadow would stand elsewhere in each photo
            return None
        light, known = self.light.radiance().numpy(), self.seen is not None
        changed, lamp = compact_lamp(self.texels, light, self.patch_width, self.settings.seed, rest_is_known=known)
        if lamp is not None:
            self.begin_at(self.found, power_of(changed) / power_of(light))
            self.light.set_radiance(torch.from_numpy(changed * np.float32(self.level / self.found)))
        return lamp

    def state(self) -> dict[str, object]:
        """The state that further sweeps depend on, without the arguments, as tensors and plain values."""
        return {
            "level": self.found,
            "lamp_gain": self.lamp_gain,
            "unknowns": self.unknowns,
            "curvature": self.equations.curvature,
            "gradient": self.equations.gradient,
            "light": self.light.levels,
            "random": self.random.bit_generator.state,
            "n_batches": self.n_batches,
            "n_sweeps": self.n_sweeps,
            "is_like": self.is_like,
        }

    def restore(self, state: dict[str, object]) -> None:
        """Restores what :meth:`state` returned for a fit with the same arguments. Raises ValueError, KeyError or TypeError where
        the state belongs to another fit."""
        self.begin_at(float(state["level"]), float(state["lamp_gain"]))
        sums = {"unknowns": self.unknowns, "curvature": self.equations.curvature, "gradient": self.equations.gradient}
        for name, tensor in sums.items():
            check_tensor(name, state[name], tuple(tensor.shape), torch.float32)
        self.unknowns = state["unknowns"]
        self.equations.curvature, self.equations.gradient = state["curvature"], state["gradient"]
        for level, stored in zip(self.light.levels, state["light"], strict=True):
            check_tensor("a level of the light", stored, tuple(level.shape), torch.float32)
        self.light.levels = list(state["light"])
        self.random.bit_generator.state = state["random"]
        self.n_batches, self.n_sweeps = (int(state[name]) for name in ("n_batches", "n_sweeps"))
        self.is_like = bool(state["is_like"])

    def maps(self) -> tuple[Tensor, Tensor, Tensor]:
        """The textures as they are now: albedo [h, w, 3], roughness and metallic [h, w, 2], normals [h, w, 3]."""
        return self.texels.maps(to_values(self.unknowns))

    def surface(self) -> TexturedSurface:
        """The asset as it is now, for the tracer."""
        return TexturedSurface(self.scene, *self.vertex_values, *self.maps())

    def see(self, draws: Draws, random: np.random.Generator) -> tuple[np.ndarray, SurfaceSamples]:
        """Draws a batch: numbers of pixels [b] whose two rays both meet the asset, and the rays' points [2 b]."""
        n = self.settings.pixels
        index = draws(n, random)
        offsets = np.stack([self.filter.draw(n, random) for _ in range(2)], axis=1)
        origins, directions = (part.reshape(-1, 3) for part in self.pixels.rays(index, offsets))
        triangle, u, v = self.scene.trace_closest(origins, directions)
        hit = (triangle >= 0).reshape(n, 2).all(axis=1)
        if not hit.any():
            raise InputError("no pixel of the photos shows the asset; give the data that it was made from")
        both = np.repeat(hit, 2)
        return index[hit], self.texels.sample(triangle[both], u[both], v[both], -directions[both])

    def shade(
        self,
        surface: TexturedSurface,
        samples: SurfaceSamples,
        unknowns: Tensor,
        turns: Tensor | None = None,
        seed: int = 0,
    ) -> Shaded:
        """The light that n points send to the viewer, differentiable in unknowns [n, 7] and the light that arrives. The estimate is
        unbiased, except for the clamp and the last bounce of interreflection. With `turns`, the rotations [n, 3, 3] of directions
        into the light's frame, light that was reflected comes from that of the first point."""
        s, m = self.settings, materials_of(to_values(unknowns), samples)
        light = self.light.radiance()
        around = light if turns is None else torch.from_numpy(turn_environment(light.numpy(), turns[0].numpy()))
        arriving = incoming_light(
            surface,
            around,
            samples.positions,
            geometric_normals=samples.geometric,
            normals=m.normals.detach(),
            view_dirs=samples.view_dirs,
            albedo=m.albedo.detach(),
            roughness=m.roughness.detach(),
            metallic=m.metallic.detach(),
            n_directions=s.directions,
            max_bounces=BOUNCES,
            clamp_indirect=CLAMP_INDIRECT,
            seed=seed,
        )
        towards = arriving.directions if turns is None else arriving.directions @ turns.transpose(1, 2)
        texels, shares = footprints(self.light.height, towards.reshape(-1, 3))
        sky = read(light.view(-1, 3), texels, shares).view_as(arriving.directions)
        radiance = (sky * arriving.visible[..., None] + arriving.sent).requires_grad_(True)
        sums = monte_carlo_light(m.normals, samples.view_dirs, m.roughness, arriving.directions, arriving.pdf, radiance)
        material = {"albedo": m.albedo, "roughness": m.roughness, "metallic": m.metallic}
        colours = shade_sums(m.normals, samples.view_dirs, **material, sums=sums, compensate=True)
        return Shaded(colours, radiance, arriving.visible, texels, shares, sky)

    def observe(self, surface: TexturedSurface, draws: Draws, random: np.random.Generator, seed: int) -> Observed:
        """A batch of pixels as photos show it and as it is now."""
        (index, samples), photos = self.see(draws, random), self.pixels
        texels, shares = self.texels.rows(samples.footprints), samples.footprints.weights
        unknowns = (self.unknowns[texels] * shares[..., None]).sum(1).requires_grad_(True)
        turns = None if self.turns is None else self.turns[photos.view[index]].repeat_interleave(2, 0)
        shaded = self.shade(surface, samples, unknowns, turns, seed)
        target, brightest, saturated = (
            torch.from_numpy(x[index]) for x in (photos.target, photos.brightest, photos.saturated)
        )
        pairs = shaded.colours.detach().view(-1, 2, 3)
        weights = srgb_slope(brightest.clamp(min=MIN_TONE)).square()
        weights = torch.where(saturated & (pairs.mean(1) > target), 0.0, weights)
        return Observed(texels, shares, unknowns, shaded, weights, pairs - target[:, None])

    @torch.no_grad()
    def held_errors(self) -> np.ndarray:
        """[n] mean squared errors without noise of batches of pixels that are held out: of the same ones by the same rays
        at each call."""
        surface, random = self.surface(), np.random.default_rng(self.settings.seed)
        n = max(LEAST_BATCHES, self.batches_of_a_sweep() // HELD_OUT)
        batches = (self.observe(surface, self.held, random, HELD_SEED + k) for k in range(n))
        return np.array([float(batch.squared().mean()) for batch in batches])

    def gather(self, surface: TexturedSurface) -> float:
        """Gathers one batch of pixels; returns its mean squared error without noise."""
        batch = self.observe(surface, self.fitted, self.random, self.settings.seed + self.n_batches)
        texels, shares, unknowns, shaded, weights, errors = batch
        colours = shaded.colours
        of_other = errors.flip(1).flatten(0, 1)
        weights_of_rays = weights.repeat_interleave(2, 0)
        inputs = unknowns, shaded.radiance
        of_channels = [torch.autograd.grad(colours[:, c].sum(), inputs, retain_graph=c < 2) for c in range(3)]
        jacobian, slopes = torch.stack([x for x, _ in of_channels], dim=1), sum(x for _, x in of_channels)
        if self.settings.light_step > 0:  # a channel depends on the light's own alone
            rows = Rows(shaded.texels, shaded.shares, slopes * shaded.visible[..., None], weights_of_rays)
            self.light_equations.add(rows, shaded.sky, of_other)
        self.equations.add(texels, shares, jacobian, weights_of_rays, of_other)
        self.n_batches += 1
        return float(batch.squared().mean())

    def batches_of_a_sweep(self) -> int:
        """The batches of a sweep that has the time for all."""
        s = self.settings
        return max(1, round(min(s.sweep_share * len(self.pixels), SWEEP_PIXELS) / s.pixels))

    def sweep(self, seconds: float = math.inf, report: Callable[[], None] = lambda: None) -> tuple[float, np.ndarray]:
        """Gathers a share of all pixels, SWEEP_PIXELS at most, and takes one step; returns the error before it, and those of
        held-out pixels after it, see :meth:`held_errors`. After `seconds` no further batch is gathered, LEAST_BATCHES aside; the
        step counts as long as the last one. `report` is called after each batch."""
        s, surface, started = self.settings, self.surface(), time.monotonic()
        n_batches = self.batches_of_a_sweep()
        errors: list[float] = []
        while len(errors) < n_batches and (
            len(errors) < LEAST_BATCHES or time.monotonic() - started + self.step_seconds < seconds
        ):
            errors.append(self.gather(surface))
            report()
        gathered, error = time.monotonic(), float(np.mean(errors))
        self._check("the error of the photos", error)
        if s.light_step > 0:
            moved = self.light_equations.step(s.light_step / (1.0 + self.n_sweeps / SWEEPS_OF_LARGE_STEPS))
            self._check("the light", moved)
        self.similar = self.similar or SimilarTexels(self.equations.start, s.seed)
        held = self.take_step()
        self.n_sweeps += 1
        self.step_seconds = time.monotonic() - gathered
        return error, held

    def take_step(self) -> np.ndarray:
        """Moves the texels; returns the errors of held-out pixels then. Texels are drawn to the usual gloss of their colour until, in one of the
        sweeps 1, 2, 4, 8, ..., a step without that explains these pixels clearly, by more than PULL_MAY_COST, better: wrong gloss hides wrong normals."""
        before, usual = self.unknowns, self.similar.usual_gloss(self.unknowns)
        steps = [self.after_step(before, usual if self.is_like else None)]
        if self.is_like and (self.n_sweeps + 1).bit_count() == 1:
            steps.append(self.after_step(before, None))
            self.is_like = not is_worse(steps[0][1], PULL_MAY_COST * steps[1][1])
        self.unknowns, held = steps[0] if self.is_like else steps[-1]
        self.equations.move(self.unknowns - before)
        return held

    def after_step(self, before: Tensor, usual: Tensor | None) -> tuple[Tensor, np.ndarray]:
        """The unknowns after a step from those before, `usual` as of :meth:`NormalEquations.step`, and the errors of held-out pixels."""
        limits = torch.tensor(STEP_LIMITS)
        self.unknowns = into_range(before + self.equations.step(before, usual).clamp(-limits, limits))
        self._check("a texel", float(self.unknowns.abs().max()))  # NaN is passed on
        return self.unknowns, self.held_errors()

    def _check(self, name: str, value: float) -> None:
        """Raises RuntimeError where a number is not finite."""
        if not math.isfinite(value):
            raise RuntimeError(f"refinement: {name} after {self.n_batches} batches is {value}; nothing was written")


class Draws:
    """Draws batches of the pixels `numbers` [m] with equal chances, `view` [n] being the photo of each of all pixels; with turns
    [views, 3, 3], each batch of photos whose lights have about one rotation."""

    def __init__(self, numbers: np.ndarray, view: np.ndarray, turns: np.ndarray | None):
        self.numbers = numbers
        groups = [np.arange(len(numbers))] if turns is None else groups_of(turns, view[numbers])
        self._groups = [numbers[group] for group in groups]

    def __call__(self, n: int, random: np.random.Generator) -> np.ndarray:
        """[n] pixels."""
        group = 0
        if len(self._groups) > 1:
            group = int(random.choice(len(self._groups), p=[len(g) / len(self.numbers) for g in self._groups]))
        return random.choice(self._groups[group], n)


def groups_of(turns: np.ndarray, view: np.ndarray) -> list[np.ndarray]:
    """The pixels' numbers in groups of photos whose lights have about one of the rotations [views, 3, 3]; `view` [n]: their
    photos."""
    middles = turns[spread(range(len(turns)), MOST_GROUPS)]
    for _ in range(GROUP_ROUNDS):  # k-means of rotations
        group = np.einsum("vij,kij->vk", turns, middles).argmax(axis=1)
        sums = [turns[group == k].sum(axis=0) for k in np.unique(group)]
        middles = np.stack([left @ right for left, _, right in map(np.linalg.svd, sums)])
    group = np.einsum("vij,kij->vk", turns, middles).argmax(axis=1)
    return [numbers for k in range(len(middles)) if len(numbers := np.flatnonzero(group[view] == k))]


def srgb_slope(linear: Tensor) -> Tensor:
    """d sRGB / d linear of values above 0.0031308. Source: IEC 61966-2-1."""
    return 1.055 / 2.4 * linear ** (1 / 2.4 - 1)
