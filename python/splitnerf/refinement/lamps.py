"""A lamp that training smeared is made compact again.

Training's light is smooth. A sun comes out as a glow of tens of degrees, whose shadows have no edges, and the albedo takes the
edges of the sun's shadow. Nothing pulls them out again: light and albedo together explain the photos. But albedo knows nothing
of shadows. Of two points close together, one in the shadow of the glow's middle and one beside it, the albedo is the same on
average over many pairs. If the glow stands for a compact lamp, the albedo beside the shadow is instead as much brighter as the
lamp adds there. So pairs close together tell the lamp's direction (where they differ most) and its width (whose contrasts they
have). Pairs farther apart, at which training's blur ends, tell its share of the power. The light of the glow is then brought
together; the power of all light stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from splitnerf.data.environment import directions_of_texels
from splitnerf.export.bake import rasterise
from splitnerf.ops import MeshScene, trace_visibility
from splitnerf.refinement.texels import AssetTexels, materials_of, neighbours

REACH = 30.0  # degrees from a glow's middle to its end
RING = 15.0  # width in degrees of the ring around it whose median is the light behind it
N_PAIRS = 200_000  # pairs among which those at the shadow's edge are sought
N_EDGE = 4_000  # pairs at the edge of which contrasts are computed
FEWEST = 100
MIN_COSINE = 0.2  # of a pair's normals and the lamp
MIN_ALIKE = 0.8  # cosine of the normals of a pair
MAX_METALLIC = 0.5  # a metal's albedo scales what it mirrors, not its irradiance
MIN_ALBEDO = 0.05  # of the brighter of the pairs that tell the power; darker dielectrics mirror more than they scatter
LARGEST_CONTRAST = 1.5  # of log albedo; beyond it, it is the texture's
FARTHER = 4  # times as far apart are the pairs that tell the power
SEARCH = ((2.0, 3), (0.7, 3), (0.25, 3))  # steps in degrees and steps to either side
RADII = (5.0, 3.0)  # degrees; fits of lamps narrower than two texels of the light are noisy
POINT = 0.5  # radius in degrees of a lamp whose shadow ends within a pair
FACTORS = np.arange(1.0, 3.01, 0.1)  # of the lamp's power
NEAR = 0.15  # contrasts that differ by more count less and less
N_BEHIND, N_GLOW, N_LAMP = 512, 256, 32  # directions of the three parts of the light
MIN_SIGMAS = 5.0  # by which a compact lamp must explain the pairs better
DARK = 0.02  # share of the mean light that counts as none


class Glow(NamedTuple):
    """The light around the brightest lamp of a map.

    Attributes:
        direction: [3] its middle.
        radiance: [h, 2 h, 3] its light; the map less this is the light behind it.
        power: [3] the radiance times the solid angle.
    """

    direction: np.ndarray
    radiance: np.ndarray
    power: np.ndarray


class CompactLamp(NamedTuple):
    """What the pairs say.

    Attributes:
        direction: [3] unit, a list.
        radius: Degrees.
        factor: The lamp's power beside the glow's, where the rest of the light stays.
        pairs: The number of pairs at the shadow's edge that told direction and width.
    """

    direction: list[float]
    radius: float
    factor: float
    pairs: int


def brightest_glow(light: np.ndarray) -> Glow:
    """The glow of most power in a map [h, 2 h, 3]."""
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
    return Glow(middle, radiance, (radiance * areas[..., None]).sum(axis=(0, 1)))


def degrees_from(directions: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """[...] angles in degrees between directions [..., 3] and one [3]."""
    return np.degrees(np.arccos(np.clip(directions @ middle, -1, 1)))


def unit(vectors: np.ndarray) -> np.ndarray:
    """[..., 3] at length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-20)


class Pairs:
    """Pairs of texels' points that are close together and face the same way, and what light they see.

    Args:
        texels: The asset's texels.
        apart: Texels between the two of a pair.
        least: Albedo that one of a pair must have.
        seed: Of the choice of pairs.
    """

    def __init__(self, texels: AssetTexels, apart: int, least: float, seed: int):
        asset, covered = texels.asset, rasterise(texels.asset.uv, texels.asset.triangles, texels.size)
        pairs = neighbours(covered, texels.chart, texels.size, apart)
        chosen = np.random.default_rng(seed).permutation(len(pairs))[:N_PAIRS]
        texel = pairs[chosen].reshape(-1)
        triangle, (_, u, v) = covered.triangle[texel], covered.weights[texel].T
        outside = covered.interpolate(asset.normals, asset.triangles)[texel]
        samples = texels.sample(triangle, u, v, outside)
        values = texels.start[texel]
        normals = materials_of(values, samples).normals.numpy()
        offset = 2e-3 * float(np.ptp(asset.vertices, axis=0).max())
        dielectric = values[:, 4].reshape(-1, 2).amax(1) < MAX_METALLIC
        scatters = dielectric & (values[:, :3].mean(1).reshape(-1, 2).amax(1) > least)
        alike = (normals[0::2] * normals[1::2]).sum(axis=1) > MIN_ALIKE
        use = np.repeat(alike & scatters.numpy(), 2)
        self.scene = MeshScene(asset.vertices, asset.triangles)
        self.normals, self.geometric = normals[use], samples.geometric.numpy()[use]
        self.origins = samples.positions.numpy()[use] + offset * self.geometric
        self.albedo = np.log(np.maximum(values[:, :3].numpy()[use], 1e-3)).mean(axis=1)

    def seen(self, direction: np.ndarray, which: np.ndarray) -> np.ndarray:
        """[k] bool, whether points `which` [k] see a direction."""
        towards = np.broadcast_to(direction.astype(np.float32), (len(which), 3)).copy()
        origins = np.ascontiguousarray(self.origins[which], np.float32)
        return trace_visibility(self.scene, torch.from_numpy(origins), torch.from_numpy(towards)).numpy()

    def edge(self, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The numbers [k] of the pairs of which one sees a direction, and by how much its log albedo is larger [k]."""
        cosines = (self.normals @ direction).reshape(-1, 2)
        facing = np.flatnonzero(cosines.min(axis=1) > MIN_COSINE)
        lit = self.seen(direction, (2 * facing[:, None] + [0, 1]).reshape(-1)).reshape(-1, 2)
        mixed = lit[:, 0] != lit[:, 1]
        at = facing[mixed]
        contrast = self.albedo[2 * at] - self.albedo[2 * at + 1]
        sign = np.where(lit[mixed, 0], 1.0, -1.0)
        return at, np.clip(contrast * sign, -LARGEST_CONTRAST, LARGEST_CONTRAST)

    def irradiance(self, which: np.ndarray, directions: np.ndarray, powers: np.ndarray) -> np.ndarray:
        """[k] irradiance, as a mean over the channels, of points `which` [k] by lamps at directions [n, 3] of powers [n, 3]."""
        total = np.zeros(len(which))
        for direction, power in zip(directions, powers.mean(axis=1)):
            cosine = self.normals[which] @ direction
            faces = np.flatnonzero((cosine > 0) & (self.geometric[which] @ direction > 0))
            total[faces] += power * cosine[faces] * self.seen(direction, which[faces])
        return total


def sharpest_direction(pairs: Pairs, start: np.ndarray) -> np.ndarray:
    """The direction [3] around `start` at the edge of whose shadow the albedo differs most."""

    def difference(direction: np.ndarray) -> float:
        contrast = pairs.edge(direction)[1]
        return float(contrast.sum() / np.sqrt(max(len(contrast), 1)))

    best = start
    for step, n in SEARCH:
        side = unit(np.cross(best, np.eye(3)[np.abs(best).argmin()]))
        up, around = np.cross(best, side), np.radians(step) * np.arange(-n, n + 1)
        tried = [unit(best + x * side + y * up) for x in around for y in around]
        best = tried[int(np.argmax([difference(direction) for direction in tried]))]
    return best


def parts_of_light(light: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions [n, 3] and powers [n, 3] that stand for a map [h, 2 h, 3], each of the same power."""
    directions, areas = directions_of_texels(light.shape[0])
    power = (light.mean(axis=2) * areas).reshape(-1)
    sums = np.cumsum(power)
    chosen = np.searchsorted(sums, (np.arange(n) + 0.5) / n * sums[-1]).clip(max=len(power) - 1)
    colour = light.reshape(-1, 3)[chosen]
    return directions.reshape(-1, 3)[chosen], colour / np.maximum(colour.mean(axis=1, keepdims=True), 1e-9) * sums[-1] / n


def disc(direction: np.ndarray, radius: float, n: int) -> np.ndarray:
    """[n, 3] directions that fill a disc of a radius in degrees evenly. Source: Vogel 1979."""
    side = unit(np.cross(direction, np.eye(3)[np.abs(direction).argmin()]))
    up = np.cross(direction, side)
    away, turn = np.radians(radius) * np.sqrt((np.arange(n) + 0.5) / n), np.arange(n) * np.pi * (3 - np.sqrt(5))
    return unit(direction + (away * np.cos(turn))[:, None] * side + (away * np.sin(turn))[:, None] * up)


class Edge:
    """Pairs at the edge of the shadow of a glow's middle: the contrast of their albedo, and that of the light on them.

    Args:
        pairs: The pairs among which they are.
        direction: [3] the middle.
        light: [h, 2 h, 3] linear radiance.
        glow: The glow in it.
        seed: Of the choice of at most N_EDGE pairs.

    Attributes:
        contrast: [k] log albedo of the lit point less that of the other.
    """

    def __init__(self, pairs: Pairs, direction: np.ndarray, light: np.ndarray, glow: Glow, seed: int):
        at, contrast = pairs.edge(direction)
        chosen = np.random.default_rng(seed).permutation(len(at))[:N_EDGE]
        self.contrast = contrast[chosen]
        self._pairs, self._direction, self._power = pairs, direction, glow.power
        points = (2 * at[chosen][:, None] + [0, 1]).reshape(-1)
        lit = pairs.seen(direction, points[0::2])
        self._points = np.where(lit[:, None], points.reshape(-1, 2), points.reshape(-1, 2)[:, ::-1]).reshape(-1)
        self._behind = pairs.irradiance(self._points, *parts_of_light(light - glow.radiance, N_BEHIND))
        self._before = self._behind + pairs.irradiance(self._points, *parts_of_light(glow.radiance, N_GLOW))

    def __len__(self) -> int:
        return len(self.contrast)

    def lamp(self, radius: float) -> np.ndarray:
        """[2 k] the irradiance of the points by a lamp of a radius in degrees in the place of the glow."""
        powers = np.broadcast_to(self._power / N_LAMP, (N_LAMP, 3))
        return self._pairs.irradiance(self._points, disc(self._direction, radius, N_LAMP), powers)

    def left(self, lamp: np.ndarray) -> np.ndarray:
        """[k] the contrasts that the albedo keeps where a lamp with an irradiance [2 k] takes the place of the glow."""
        least = DARK * self._before.mean()
        change = np.log(np.maximum(self._behind + lamp, least) / np.maximum(self._before, least)).reshape(-1, 2)
        return self.contrast - np.clip(change[:, 0] - change[:, 1], -LARGEST_CONTRAST, LARGEST_CONTRAST)


def compact_lamp(texels: AssetTexels, light: np.ndarray, apart: int, seed: int) -> tuple[np.ndarray, CompactLamp | None]:
    """The light with its brightest glow brought together, where the albedo says that it is a compact lamp.

    Args:
        texels: The asset that was trained with the light.
        light: [h, 2 h, 3] linear radiance.
        apart: The width of two pixels of the photos in texels.
        seed: Of the choice of pairs.

    Returns:
        The light, and what was found: None where the glow stays as it is.
    """
    glow = brightest_glow(light)
    if not glow.radiance.any():
        return light, None
    pairs = Pairs(texels, max(2, apart), 0.0, seed)
    direction = sharpest_direction(pairs, glow.direction)
    edge = Edge(pairs, direction, light, glow, seed)
    if len(edge) < FEWEST:
        return light, None
    kept, radius = min(((edge.left(edge.lamp(r)), r) for r in RADII), key=lambda pair: np.square(pair[0]).mean())
    gain = np.square(edge.contrast) - np.square(kept)
    if gain.mean() < MIN_SIGMAS * gain.std() / np.sqrt(len(gain)):
        return light, None
    far = Edge(Pairs(texels, FARTHER * max(2, apart), MIN_ALBEDO, seed), direction, light, glow, seed)
    found = CompactLamp(direction.tolist(), radius, power_factor(far), len(edge))
    return with_lamp(light, glow, found), found


def power_factor(edge: Edge) -> float:
    """The factor of the glow's power by which a lamp leaves the least contrasts; 1 where pairs are too few to tell."""
    if len(edge) < FEWEST:
        return 1.0
    lamp = edge.lamp(POINT)
    costs = [np.log1p(np.square(edge.left(factor * lamp) / NEAR)).mean() for factor in FACTORS]
    return float(FACTORS[int(np.argmin(costs))])


def with_lamp(light: np.ndarray, glow: Glow, lamp: CompactLamp) -> np.ndarray:
    """A map [h, 2 h, 3] with a lamp, at least one texel wide, in the place of a glow, and of the same power in all."""
    directions, areas = directions_of_texels(light.shape[0])
    away = degrees_from(directions, np.array(lamp.direction))
    inside = away <= max(lamp.radius, away.min())
    changed = light - glow.radiance
    changed[inside] += lamp.factor * glow.power / areas[inside].sum()
    power_of = lambda map_: (map_.mean(axis=2) * areas).sum()  # noqa: E731
    return (changed * (power_of(light) / power_of(changed))).astype(np.float32)
