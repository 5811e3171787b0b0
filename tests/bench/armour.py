"""Two assets like the hardest that people scan: dark, glossy, painted and engraved at the size of a pixel of 200.

Each is a list of tubes (see tubes.py); `hard_scenes.py` writes them.
"""

import numpy as np
from bench.kinds import finely, rounded
from bench.tubes import TAU, Tube, band, lathe, mix, noise, ring, smooth, through, wire


def helm() -> list[Tube]:
    """A hollow helmet of dark steel under worn paint: panels, rivets, a mirroring visor and two ribbed hoses."""
    outer = [(0.58, -0.62), (0.74, -0.30), (0.74, 0.20), (0.45, 0.62), (0, 0.70)]
    inner = [(0, 0.58), (0.36, 0.52), (0.64, 0.16), (0.64, -0.30), (0.50, -0.62)]
    curve, radius = lathe(finely(rounded(inner + outer, 0.3, 9), 769))

    def engraved(s, t):
        panels = np.maximum(band(14 * s, 0.14), band(9 * t + 0.25 * np.sin(TAU * 3 * s), 0.20))
        rivets = smooth((np.cos(TAU * 72 * t) * np.cos(TAU * 42 * s) - 0.6) / 0.2) * band(7 * s + 0.25, 0.5)
        return panels, rivets * (1 - panels), smooth((s - 0.47) / 0.02)

    def shell(s, t):
        panels, rivets, outside = engraved(s, t)
        return radius(s, t) * (1 + outside * (0.012 * rivets - 0.022 * panels))

    def paint(s, t):
        panels, rivets, outside = engraved(s, t)
        wear = noise(s, t, 60, 40, 71) + 0.5 * noise(s, t, 160, 110, 72)
        worn = smooth((wear - 1.0 + 0.3 * rivets) / 0.05)
        camouflage = smooth((noise(s, t, 9, 6, 73) - 0.5) / 0.02)
        letters = band(48 * t, 0.5) * band(60 * s, 0.6) * band(3 * t, 0.6) * band(5 * s + 0.4, 0.5)
        coat = mix(mix((0.030, 0.045, 0.035), (0.060, 0.045, 0.028), camouflage), (0.42, 0.33, 0.10), letters)
        steel = mix((0.20, 0.19, 0.18), (0.34, 0.31, 0.28), noise(s, t, 90, 30, 74))
        colour = mix(mix(coat, steel, worn), (0.025, 0.022, 0.020), 0.9 * panels)
        rough = 0.22 + 0.08 * noise(s, t, 40, 30, 75) + 0.15 * worn + 0.25 * panels
        leather = mix((0.05, 0.03, 0.02), (0.09, 0.05, 0.03), noise(s, t, 80, 40, 76))
        metal = np.round(worn * (1 - panels)) * outside
        return mix(leather, colour, outside), 0.7 + (rough - 0.7) * outside, metal

    def glass(s, t):
        colour = mix((0.012, 0.012, 0.016), (0.05, 0.03, 0.015), band(6 * s, 0.2))
        return colour, 0.08 + 0.05 * noise(s, t, 9, 6, 77), 0.0

    def rubber(s, t):
        colour = mix((0.03, 0.03, 0.032), (0.015, 0.015, 0.016), band(24 * s, 0.6))
        return colour, 0.45 + 0.1 * noise(s, t, 20, 4, 78), 0.0

    visor = through(
        lambda s: np.stack([0.70 + 0 * s, 0.42 * (2 * s - 1), 0.02 + 0 * s], 1),
        lambda s: np.tile([0, 0, 1.0], (len(s), 1)),
    )
    round_off = lambda s, t: 0.2 * np.clip(1 - (2 * s - 1) ** 2, 0, 1) ** 0.5
    tubes = [Tube(curve, shell, paint, (768, 512), 1536, 2), Tube(visor, round_off, glass, (96, 64), 128)]
    for side in (-1, 1):
        bend = lambda s, y=side: np.stack([0.30 + 0.55 * np.sin(np.pi * s), 0.66 * y - 0.2 * y * s, -0.62 + 0.4 * s], 1)
        hose = through(bend, lambda s: np.tile([0, 0.3, 1.0], (len(s), 1)))
        ribs = lambda s, t: wire(0.085)(s, t) * (1 - 0.12 * band(24 * s, 0.6))
        tubes.append(Tube(hose, ribs, rubber, (320, 40), 96))
    return tubes


def casket() -> list[Tube]:
    """A casket of blackened brass with an inlay of gold, on four feet, with rings that mirror in it."""
    body = [(0, -0.42), (0.72, -0.42), (0.72, -0.34), (0.64, -0.30), (0.64, 0.10), (0.74, 0.14), (0.74, 0.20)]
    lid = [(0.66, 0.24), (0.50, 0.42), (0.12, 0.50), (0.10, 0.56), (0.16, 0.62), (0.08, 0.68), (0, 0.68)]
    curve, turned = lathe(finely(rounded(body + lid, 0.03), 641))

    def scrolls(s, t):
        a, b = 60 * s + 1.2 * np.sin(TAU * 8 * t), 40 * t
        lines = smooth((np.cos(TAU * b + 2 * np.sin(TAU * a / 2)) * np.cos(np.pi * a) - 0.35) / 0.1)
        return lines * band(4 * s, 0.9)

    def grooves(s, t):
        return np.maximum(
            band(30 * s + 0.5, 0.25) * band(5 * s + 0.3, 0.4), band(64 * t + 20 * s, 0.3) * band(7 * s, 0.3)
        )

    def square(s, t):
        corner = (np.cos(TAU * t) ** 6 + (1.4 * np.sin(TAU * t)) ** 6) ** (-1 / 6)
        return turned(s, t) * corner * (1 - 0.02 * grooves(s, t))

    def paint(s, t):
        inlay, cut = scrolls(s, t), grooves(s, t)
        patina = noise(s, t, 50, 30, 81)
        dark = mix((0.055, 0.045, 0.040), (0.13, 0.10, 0.07), patina)
        enamel = smooth((noise(s, t, 12, 8, 82) - 0.62) / 0.03) * (1 - inlay)
        colour = mix(mix(dark, (0.02, 0.03, 0.07), enamel), (0.80, 0.56, 0.22), inlay)
        colour = mix(colour, (0.02, 0.018, 0.016), cut)
        rough = 0.16 + 0.14 * patina - 0.06 * inlay + 0.3 * cut - 0.05 * enamel
        return colour, rough, np.round((1 - enamel) * (1 - cut))

    def brass(s, t):
        return (
            mix((0.18, 0.13, 0.07), (0.34, 0.24, 0.12), noise(s, t, 40, 6, 83)),
            0.15 + 0.1 * noise(s, t, 9, 4, 84),
            1.0,
        )

    tubes = [Tube(curve, square, paint, (640, 512), 1536, 2)]
    foot = [(0, -0.62), (0.08, -0.62), (0.12, -0.52), (0.06, -0.40), (0, -0.40)]
    spin, size = lathe(finely(rounded(foot, 0.03), 65))
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        moved = lambda s, at=np.array([0.56 * x, 0.38 * y, 0]): (spin(s)[0] + at, *spin(s)[1:])
        tubes.append(Tube(moved, size, brass, (64, 32), 64))
    for x in (-1, 1):
        handle = ring(np.array([0.66 * x, 0, -0.16]), np.array([1.0, 0, 0.35 * x]), 0.16)
        tubes.append(Tube(handle, lambda s, t: np.full_like(s, 0.03), brass, (128, 24), 48))
    return tubes


ARMOUR = {"helm": helm, "casket": casket}
