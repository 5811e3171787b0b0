"""A lamp that training smeared is made compact again: by the edges of its shadows in the albedo, or by its mirror images; docs/method.md,
"A smeared lamp", has the reasons.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from splitnerf.data.asset import unit
from splitnerf.data.environment import directions_of_texels
from splitnerf.export.bake import rasterise
from splitnerf.ops import MeshScene
from splitnerf.ops.visibility import visibility_bits
from splitnerf.refinement.level import GLOSSY, LEAST_SHARE
from splitnerf.refinement.texels import AssetTexels, materials_of, neighbours

REACH = 30.0  # degrees from a lobe's middle to its end
FADE = 8.0  # width in degrees of its rim, which leaves the light only in part: a cut would show
RING = 15.0  # width in degrees of the ring around it whose median is the light behind it
# widths of a patch between the points of a pair: with 2, training's blur makes suns of 1 degree into lamps of 8
APART = 6
N_PAIRS = 50_000  # pairs among which those at edges of shadows are searched
N_EDGE = 4_000  # pairs at the edges of shadows of which contrasts are computed
FEWEST = 1000  # such pairs that tell anything: 426 to 543 of metals, by their errors, told widths of 3 to 10 degrees for one sun
LEAST_PART = 0.1  # minimum difference in visibility of the lobe between the two points of a pair
MIN_ALIKE = 0.8  # cosine of the normals of a pair
MAX_METALLIC = 0.5  # a metal's albedo scales what it mirrors, not its irradiance
MIN_ALBEDO = 0.05  # of the brighter one of a pair; darker dielectrics mirror more than they scatter
LARGEST_CONTRAST = 1.5  # of log albedo; beyond it, it is the texture's
NEAR = 0.15  # contrast from which on the cost grows slowly
FARTHEST = 12.0  # degrees from the lobe's direction to the farthest lamp that is tried
# A lobe with half its power within SHARP degrees in the light of a glossy object was seen in mirror images, smeared by training: a lamp is in its
# middle. On 30 trained runs the middles of such lobes were 0.1 to 1.6 degrees off, in one 2.9, those of broader ones up to 9.
SHARP = 12.0
# Usual power of a sun divided by that of its lobe (geometric mean of 15 trained runs; 1.5 to 3.6), and how many logarithms away from it
# count as one standard error of the pairs, whose texture training has blurred: alone they are 0.7 of the truth, in one run 0.3.
USUAL_FACTOR, PER_ERROR = 2.0, 0.06
USUAL_RADIUS = 8.0  # degrees, of a lamp of which no shadow tells
MOST_TINT = 1.25  # factor on a channel of the light beside a lamp
N_TRIED, N_FINER, FINER = 448, 64, 1.0  # directions that are tried; then those within some degrees of the best
RADII = (1.0, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 12.0)  # degrees
LEAST_RADIUS = 3.0  # degrees, of the lamp in the light: fits of lamps narrower than two of its texels are noisy
FACTORS = np.arange(1.0, 3.01, 0.1)  # of the lamp's power; every COARSE-th is tried first
COARSE = 4
# directions of the disc of FARTHEST degrees, and of all that lamps may fill; multiples of 32
N_CENTRAL, N_TABLE = 32, 1792
N_BEHIND, N_LOBE = 512, 256  # directions that stand for the other light and for the lobe; multiples of 32
# Of a lamp of which shadows alone tell:
MIN_SIGMAS = 5.0  # by which it must explain the pairs better
LEAST_FACTOR = 1.15  # of its power: training takes power from a lamp that it smears, since the albedo has its shadow
DARK = 0.02  # share of the mean light that counts as none


class Lobe(NamedTuple):
    """The light around the brightest lamp of a map."""

    direction: np.ndarray  # [3] its middle
    radiance: np.ndarray  # [h, 2 h, 3] its light; the map less this is the light behind it
    power: np.ndarray  # [3] the radiance times the solid angle
    sharp: bool  # whether half the power is within SHARP degrees


class CompactLamp(NamedTuple):
    """The lamp in the place of a lobe.

    Attributes:
        direction: [3] unit, a list.
        radius: Degrees; in the light it is at least LEAST_RADIUS.
        factor: The lamp's power divided by the lobe's; the rest of the light stays.
        pairs: The number of pairs used; 0 where there were too few.
    """

    direction: list[float]
    radius: float
    factor: float
    pairs: int


def brightest_lobe(light: np.ndarray) -> Lobe:
    """The lobe of most power in a map [h, 2 h, 3]."""
    directions, areas = directions_of_texels(light.shape[0])
    power = light.mean(axis=2) * areas
    sky = directions_of_texels(24)[0].reshape(-1, 3)
    near = [power[directions @ middle > np.cos(np.radians(RING))].sum() for middle in sky]
    middle = sky[int(np.argmax(near))]
    for _ in range(6):
        away = degrees_from(directions, middle)
        behind = np.median(light[(away > REACH) & (away < REACH + RING)], axis=0)
        radiance = np.clip(light - behind, 0, None) * (away < REACH)[..., None]
        if not radiance.any():
            break
        middle = unit((directions * (radiance.mean(axis=2) * areas)[..., None]).sum(axis=(0, 1)))
    power = radiance * areas[..., None]
    near = power[degrees_from(directions, middle) < SHARP].sum()
    return Lobe(middle, radiance, power.sum(axis=(0, 1)), bool(near > 0.5 * power.sum()))


def degrees_from(directions: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """[...] angles in degrees between directions [..., 3] and one [3]."""
    return np.degrees(np.arccos(np.clip(directions @ middle, -1, 1)))


def parts_of_light(light: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions [n, 3] and powers [n, 3] that stand for a map [h, 2 h, 3], each of the same power."""
    directions, areas = directions_of_texels(light.shape[0])
    power = (light.mean(axis=2) * areas).reshape(-1)
    sums = np.cumsum(power)
    chosen = np.searchsorted(sums, (np.arange(n) + 0.5) / n * sums[-1]).clip(max=len(power) - 1)
    colour = light.reshape(-1, 3)[chosen]
    return directions.reshape(-1, 3)[chosen], colour / np.maximum(colour.mean(axis=1, keepdims=True), 1e-9) * sums[
        -1
    ] / n


def disc(direction: np.ndarray, radius: float, n: int) -> np.ndarray:
    """[n, 3] directions that fill a disc of a radius in degrees evenly. Source: Vogel 1979."""
    side = unit(np.cross(direction, np.eye(3)[np.abs(direction).argmin()]))
    up = np.cross(direction, side)
    away, turn = np.radians(radius) * np.sqrt((np.arange(n) + 0.5) / n), np.arange(n) * np.pi * (3 - np.sqrt(5))
    return unit(direction + (away * np.cos(turn))[:, None] * side + (away * np.sin(turn))[:, None] * up)


class Points(NamedTuple):
    """Points of an asset's surface in pairs; the points of a pair are close and have similar normals.

    Attributes:
        scene: The mesh.
        origins, normals, geometric: [2 k, 3] where rays start, unit shading normals and normals of the triangles.
        albedo: [2 k] its logarithm, as a mean over the channels.
    """

    scene: MeshScene
    origins: np.ndarray
    normals: np.ndarray
    geometric: np.ndarray
    albedo: np.ndarray

    def chosen(self, pairs: np.ndarray) -> Points:
        """The points of pairs, by their numbers [m] or by [k] bool."""
        of_points = (x.reshape(-1, 2, *x.shape[1:])[pairs].reshape(-1, *x.shape[1:]) for x in self[1:])
        return Points(self.scene, *of_points)

    def cosines(self, directions: np.ndarray) -> np.ndarray:
        """[2 k, n] irradiance by lamps of power 1 at directions [n, 3], n a multiple of 32: the cosine, 0 where
        hidden."""
        tensors = (
            torch.from_numpy(np.ascontiguousarray(x, np.float32)) for x in (self.origins, self.geometric, directions)
        )
        bits = visibility_bits(self.scene, *tensors, offset=0.0)[0][:, 0].contiguous().numpy()
        seen = np.unpackbits(bits.view(np.uint8), axis=1, bitorder="little")
        return seen * np.clip(self.normals @ directions.T, 0, None).astype(np.float32)


def pairs_of(texels: AssetTexels, apart: int, seed: int) -> Points:
    """At most N_PAIRS pairs of texels' points, some texels apart; none of a metal, and none where both are black."""
    asset, covered = texels.asset, rasterise(texels.asset.uv, texels.asset.triangles, texels.size)
    pairs = neighbours(covered, texels.chart, texels.size, apart)
    texel = pairs[np.random.default_rng(seed).permutation(len(pairs))[:N_PAIRS]].reshape(-1)
    triangle, (_, u, v) = covered.triangle[texel], covered.weights[texel].T
    samples = texels.sample(triangle, u, v, covered.interpolate(asset.normals, asset.triangles)[texel])
    values = texels.start[texel]
    normals, geometric = materials_of(values, samples).normals.numpy(), samples.geometric.numpy()
    albedo, metallic = values[:, :3].numpy(), values[:, 4].numpy()
    offset = 2e-3 * float(np.ptp(asset.vertices, axis=0).max())
    points = Points(
        MeshScene(asset.vertices, asset.triangles),
        samples.positions.numpy() + offset * geometric,
        normals,
        geometric,
        np.log(np.maximum(albedo, 1e-3)).mean(axis=1),
    )
    alike = (normals[0::2] * normals[1::2]).sum(axis=1) > MIN_ALIKE
    dielectric = metallic.reshape(-1, 2).max(axis=1) < MAX_METALLIC
    return points.chosen(alike & dielectric & (albedo.mean(axis=1).reshape(-1, 2).max(axis=1) > MIN_ALBEDO))


def at_edges(points: Points, lobe: Lobe, seed: int) -> Points:
    """At most N_EDGE of the pairs on which a lobe's middle shines unequally: it is partly hidden from one, or one faces
    it more."""
    central = points.cosines(disc(lobe.direction, FARTHEST, N_CENTRAL))
    part = np.abs(central[0::2] - central[1::2]).mean(axis=1)
    return points.chosen(np.random.default_rng(seed).permutation(np.flatnonzero(part > LEAST_PART))[:N_EDGE])


class Contrasts:
    """The contrasts of pairs' log albedo in a light [h, 2 h, 3] of linear radiance, and what lamps in the place of a lobe in it
    leave of them; `costs` [k] are those of the contrasts as they are."""

    def __init__(self, points: Points, light: np.ndarray, lobe: Lobe):
        self._contrast = np.clip(points.albedo[0::2] - points.albedo[1::2], -LARGEST_CONTRAST, LARGEST_CONTRAST)
        self.costs = robust(self._contrast)
        self._power = float(lobe.power.mean())
        self._directions = disc(lobe.direction, FARTHEST + max(RADII), N_TABLE)
        self._table = points.cosines(self._directions)
        arriving = [
            points.cosines(directions) @ powers.mean(axis=1)
            for directions, powers in (
                parts_of_light(light - lobe.radiance, N_BEHIND),
                parts_of_light(lobe.radiance, N_LOBE),
            )
        ]
        self._behind, self._before = arriving[0], arriving[0] + arriving[1]
        self._least = max(DARK * float(self._before.mean()), 1e-20)

    def lamps(self, middles: np.ndarray, radius: float) -> np.ndarray:
        """[2 k, n] irradiance of the points by lamps of the lobe's power around middles [n, 3], of a radius in
        degrees."""
        spacing = (FARTHEST + max(RADII)) * np.sqrt(np.pi / N_TABLE)
        away = np.degrees(np.arccos(np.clip(self._directions @ middles.T, -1, 1)))
        shares = np.clip((radius - away) / spacing + 0.5, 0, 1)
        return self._power * (self._table @ (shares / shares.sum(axis=0)).astype(np.float32))

    def costs_left(self, lamps: np.ndarray, factor: float) -> np.ndarray:
        """[k, n] of what lamps of an irradiance [2 k, n] times a factor leave of the contrasts in the lobe's place."""
        after = np.maximum(self._behind[:, None] + factor * lamps, self._least)
        change = np.log(after / np.maximum(self._before, self._least)[:, None])
        change = np.clip(change[0::2] - change[1::2], -LARGEST_CONTRAST, LARGEST_CONTRAST)
        return robust(self._contrast[:, None] - change)


def robust(contrast: np.ndarray) -> np.ndarray:
    """The cost of contrasts, which are the texture's where they are large."""
    return np.log1p(np.square(contrast / NEAR))


def best_lamp(contrasts: Contrasts, middles: np.ndarray, radii: tuple[float, ...], factors: np.ndarray) -> CompactLamp:
    """The lamp that leaves the least contrasts, of all with middles [n, 3], radii in degrees and factors."""
    trials = []
    for radius in radii:
        lamps = contrasts.lamps(middles, radius)
        for factor in factors:
            costs = contrasts.costs_left(lamps, factor).mean(axis=0)
            best = int(np.argmin(costs))
            lamp = CompactLamp(middles[best].tolist(), radius, float(factor), len(contrasts.costs))
            trials.append((float(costs[best]), lamp))
    return min(trials, key=lambda trial: trial[0])[1]


def compact_lamp(
    texels: AssetTexels, light: np.ndarray, patch: int, seed: int, *, rest_is_known: bool = False
) -> tuple[np.ndarray, CompactLamp | None]:
    """The light with its brightest lobe made compact, if mirror images or the albedo indicate a lamp; and what was found: None
    where the lobe stays as it is.

    Args:
        texels: The asset that was trained with the light.
        light: [h, 2 h, 3] linear radiance, h at least 8.
        patch: The width of two pixels of the photos in texels.
        seed: Of the choice of pairs.
        rest_is_known: Whether the level of the light beside the lobe is known.
    """
    lobe = brightest_lobe(light)
    if not lobe.radiance.any():
        return light, None
    mirrored, lamp = bool((texels.start[:, 3] < GLOSSY).float().mean() >= LEAST_SHARE), None
    if mirrored and lobe.sharp:
        lamp = CompactLamp(lobe.direction.tolist(), USUAL_RADIUS, USUAL_FACTOR, 0)
    points = at_edges(pairs_of(texels, APART * patch, seed), lobe, seed)
    if len(points.albedo) >= 2 * FEWEST:
        contrasts = Contrasts(points, light, lobe)
        lamp = lamp or lamp_near(lobe, contrasts)
        if lamp is not None and lobe.sharp:
            lamp = usual_lamp(lamp.direction, contrasts)
    if lamp is None:
        return light, None
    return with_lamp(light, lobe, lamp, rest_is_known=rest_is_known, mirrored=mirrored), lamp


def usual_lamp(direction: list[float], contrasts: Contrasts) -> CompactLamp:
    """The lamp in a direction that explains the pairs and is usual in its power."""
    lamps = [CompactLamp(direction, r, f, len(contrasts.costs)) for r in RADII[:-1] for f in FACTORS.tolist()]
    arriving = {radius: contrasts.lamps(np.array([direction]), radius) for radius in RADII[:-1]}
    left = np.stack([contrasts.costs_left(arriving[lamp.radius], lamp.factor)[:, 0] for lamp in lamps])
    more = left - left[left.mean(axis=1).argmin()]
    errors = more.mean(axis=1) / np.maximum(more.std(axis=1) / np.sqrt(left.shape[1]), 1e-9)
    unusual = np.log([lamp.factor / USUAL_FACTOR for lamp in lamps])
    return lamps[int(((PER_ERROR * errors) ** 2 + unusual**2).argmin())]


def lamp_near(lobe: Lobe, contrasts: Contrasts) -> CompactLamp | None:
    """The lamp that explains the pairs clearly better than a lobe does; None where a better one may be beyond those that are tried, and where
    training took no power from it."""
    rough = best_lamp(contrasts, disc(lobe.direction, FARTHEST, N_TRIED), RADII, FACTORS[::COARSE])
    best = best_lamp(contrasts, disc(np.array(rough.direction), FINER, N_FINER), (rough.radius,), FACTORS)
    at_rim = best.radius == max(RADII) or degrees_from(lobe.direction, np.array(best.direction)) > FARTHEST - FINER
    shining = contrasts.lamps(np.array([best.direction]), best.radius)
    gain = contrasts.costs - contrasts.costs_left(shining, best.factor)[:, 0]
    clear = gain.mean() > MIN_SIGMAS * gain.std() / np.sqrt(len(gain))
    return best if clear and not at_rim and best.factor >= LEAST_FACTOR else None


def with_lamp(
    light: np.ndarray, lobe: Lobe, lamp: CompactLamp, *, rest_is_known: bool = False, mirrored: bool = False
) -> np.ndarray:
    """A map [h, 2 h, 3] with a lamp, at least LEAST_RADIUS and one texel wide, in the place of a lobe. Unless the rest is known,
    all light keeps its colour, as far as MOST_TINT allows: training finds that of a lamp, and takes the rest for greyer than it is.
    The rest keeps its power where it is known or was mirrored, else all light does."""
    directions, areas = directions_of_texels(light.shape[0])
    away = degrees_from(directions, np.array(lamp.direction))
    inside = away <= max(lamp.radius, LEAST_RADIUS, away.min())
    fade = np.clip((REACH - degrees_from(directions, lobe.direction)) / FADE, 0, 1)[..., None]
    changed, added = light - lobe.radiance * fade, lamp.factor * lobe.power
    if not rest_is_known:
        before = (light * areas[..., None]).sum(axis=(0, 1))
        behind = (changed * areas[..., None]).sum(axis=(0, 1))
        gain = (behind + added).mean() / before.mean()
        changed *= np.clip((gain * before - added) / np.maximum(behind, 1e-20), 1 / MOST_TINT, MOST_TINT)
    changed[inside] += added / areas[inside].sum()
    scale = 1.0 if rest_is_known or mirrored else power_of(light) / power_of(changed)
    return (changed * scale).astype(np.float32)


def power_of(light: np.ndarray) -> float:
    """The integral of the mean radiance of a map [h, 2 h, 3] over all directions."""
    return float((light.mean(axis=2) * directions_of_texels(light.shape[0])[1]).sum())
