"""Assets of kinds that no other one here has: brushed metal, rubber and chrome, porcelain, gold leaf, thin wires.

Each is a list of tubes (see tubes.py); `hard_scenes.py` writes them.
"""

import numpy as np
from bench.tubes import TAU, Tube, band, lathe, mix, noise, ring, smooth, through, wire

STEEL, CHROME, GOLD = (0.56, 0.57, 0.58), (0.55, 0.556, 0.554), (1.0, 0.71, 0.29)


def rounded(corners: list[tuple[float, float]], radius: float, n: int = 5) -> np.ndarray:
    """A profile [k, 2] through corners whose inner ones are rounded, the ends on the axis."""
    points = [np.float64(corners[0])]
    for before, corner, after in zip(corners, corners[1:], corners[2:]):
        before, corner, after = map(np.float64, (before, corner, after))
        cut = [min(radius, 0.45 * np.linalg.norm(x - corner)) for x in (before, after)]
        start, end = (corner + c * (x - corner) / np.linalg.norm(x - corner) for c, x in zip(cut, (before, after)))
        share = np.linspace(0, 1, n)[:, None]
        points += list((1 - share) ** 2 * start + 2 * share * (1 - share) * corner + share**2 * end)
    points.append(np.float64(corners[-1]))
    return np.array(points)


def finely(profile: np.ndarray, n: int) -> np.ndarray:
    """n points at equal distances along a profile."""
    length = np.append(0, np.linalg.norm(np.diff(profile, axis=0), axis=1).cumsum())
    at = np.linspace(0, length[-1], n)
    return np.column_stack([np.interp(at, length, profile[:, k]) for k in (0, 1)])


def brushed() -> list[Tube]:
    """A can of brushed steel, with grooves around it that widen its highlights in one direction alone."""
    profile = rounded([(0, -0.7), (0.5, -0.7), (0.5, 0.45), (0.2, 0.6), (0.2, 0.75), (0, 0.75)], 0.06)
    curve, radius = lathe(finely(profile, 1025))
    draw = np.random.default_rng(21)
    heights = draw.normal(0, 0.0004, 1025)

    def grooved(s, t):
        return np.maximum(0, radius(s, t) + np.interp(s, np.linspace(0, 1, 1025), heights) * (radius(s, t) > 0.05))

    def paint(s, t):
        streaks = noise(s, t, 300, 2, 22)
        return mix(np.multiply(STEEL, 0.9), STEEL, streaks), 0.22 + 0.08 * streaks, 1.0

    return [Tube(curve, grooved, paint, (1024, 96), 512)]


def wheel() -> list[Tube]:
    """A tyre of black rubber with blocks of tread, on a wheel of chrome."""

    def tread(s, t):
        outside = smooth((np.cos(TAU * t) - 0.3) / 0.2)
        blocks = np.maximum(band(40 * s + 0.5 * np.sin(TAU * t), 0.3), band(6 * t, 0.25))
        return outside * blocks

    def rubber(s, t):
        letters = smooth((np.cos(TAU * 9 * s) - 0.5) / 0.1) * smooth((np.abs(np.sin(TAU * t)) - 0.85) / 0.05)
        colour = mix((0.022, 0.022, 0.024), (0.45, 0.44, 0.40), letters)
        return colour, 0.65 + 0.15 * noise(s, t, 20, 6, 31), 0.0

    def chrome(s, t):
        return np.broadcast_to(CHROME, (*s.shape, 3)), 0.06 + 0.04 * noise(s, t, 6, 3, 32), 1.0

    around = ring(np.zeros(3), np.array([0, 0, 1.0]), 0.72)
    tubes = [Tube(around, lambda s, t: 0.23 - 0.02 * tread(s, t), rubber, (640, 64), 384, 2)]
    rim = ring(np.zeros(3), np.array([0, 0, 1.0]), 0.48)
    tubes.append(Tube(rim, lambda s, t: np.full_like(s, 0.06), chrome, (192, 32), 64))
    hub = finely(rounded([(0, -0.14), (0.16, -0.12), (0.16, 0.12), (0, 0.14)], 0.05), 65)
    tubes.append(Tube(*lathe(hub), chrome, (64, 64), 64))
    for k in range(5):
        out = np.array([np.cos(TAU * k / 5), np.sin(TAU * k / 5), 0])
        spoke = through(lambda s, out=out: np.outer(0.1 + 0.38 * s, out), lambda s: np.tile([0, 0, 1.0], (len(s), 1)))
        tubes.append(Tube(spoke, wire(0.05), chrome, (48, 24), 32))
    return tubes


def porcelain() -> list[Tube]:
    """A white glazed vase with a little blue, on a white matte plinth."""
    body = [(0, -0.35), (0.2, -0.35), (0.22, -0.3), (0.42, 0.1), (0.36, 0.35), (0.16, 0.55), (0.22, 0.75), (0.17, 0.75)]
    profile = finely(rounded([*body, (0.12, 0.55), (0, 0.5)], 0.15), 193)

    def glaze(s, t):
        vine = smooth((np.cos(TAU * (5 * t + 0.6 * np.sin(TAU * 4 * s))) - 0.8) / 0.1)
        flowers = smooth((np.cos(TAU * 5 * t) * np.cos(TAU * 9 * s) - 0.7) / 0.1)
        blue = np.maximum(vine, flowers) * ((s > 0.15) & (s < 0.5))
        return mix((0.80, 0.80, 0.78), (0.03, 0.06, 0.35), blue), 0.08 + 0.04 * noise(s, t, 6, 3, 41), 0.0

    def plaster(s, t):
        return np.multiply((0.78, 0.77, 0.74), 0.94 + 0.06 * noise(s, t, 30, 30, 42)[..., None]), 0.75, 0.0

    plinth = finely(rounded([(0, -0.75), (0.5, -0.75), (0.5, -0.36), (0, -0.36)], 0.03), 97)
    return [Tube(*lathe(profile), glaze, (192, 96), 512), Tube(*lathe(plinth), plaster, (96, 96), 256)]


def gilded() -> list[Tube]:
    """A turned baluster of wood with leaves of gold, torn at their edges."""
    corners = [(0, -0.85), (0.42, -0.85), (0.42, -0.7), (0.2, -0.55), (0.34, -0.1), (0.16, 0.3), (0.16, 0.45)]
    corners += [(0.3, 0.5), (0.3, 0.6), (0.2, 0.85), (0, 0.85)]

    def paint(s, t):
        grain = 0.5 + 0.5 * np.sin(90 * s + 3 * np.cos(TAU * t) + 2 * noise(s, t, 3, 3, 51))
        wood = mix((0.16, 0.07, 0.03), (0.33, 0.17, 0.07), grain)
        torn = noise(s, t, 30, 12, 52) + 0.5 * noise(s, t, 80, 40, 53)
        leaf = smooth((torn - 0.62 - 0.4 * band(4 * s, 0.4)) / 0.04)
        gold = mix(np.multiply(GOLD, 0.85), GOLD, noise(s, t, 50, 20, 54))
        rough = (1 - leaf) * (0.5 + 0.15 * grain) + leaf * (0.18 + 0.15 * noise(s, t, 60, 30, 55))
        return mix(wood, gold, leaf), rough, np.round(leaf)

    return [Tube(*lathe(finely(rounded(corners, 0.08), 257)), paint, (256, 96), 1024)]


def wires() -> list[Tube]:
    """A globe of wires, a pixel thick where photos have 100: copper meridians and painted parallels."""

    def copper(s, t):
        return mix((0.75, 0.35, 0.22), (0.92, 0.55, 0.42), noise(s, t, 12, 2, 61)), 0.3, 1.0

    def paint(s, t):
        return mix((0.60, 0.08, 0.03), (0.70, 0.60, 0.10), band(8 * s, 0.5)), 0.4, 0.0

    tubes = []
    for k in range(5):
        axis = np.array([np.cos(np.pi * k / 5), np.sin(np.pi * k / 5), 0])
        tubes.append(Tube(ring(np.zeros(3), axis, 0.8), lambda s, t: np.full_like(s, 0.012), copper, (192, 10), 24))
    for z in (-0.55, -0.2, 0.2, 0.55):
        around = ring(np.array([0, 0, z]), np.array([0, 0, 1.0]), float(np.sqrt(0.64 - z * z)))
        tubes.append(Tube(around, lambda s, t: np.full_like(s, 0.014), paint, (192, 10), 24))
    return tubes


KINDS = {"brushed": brushed, "wheel": wheel, "porcelain": porcelain, "gilded": gilded, "wires": wires}
