"""Terms of the training loss in arbitrary precision."""

from __future__ import annotations

import numpy as np

from stability.entry import Rows
from stability.precise import mp, vector

PAIRS, LEVELS = 6, [4, 20]


def linear_of(x):
    return x / mp.mpf("12.92") if x <= mp.mpf("0.04045") else ((x + mp.mpf("0.055")) / mp.mpf("1.055")) ** mp.mpf("2.4")


def srgb(x):
    return (
        mp.mpf("12.92") * x
        if x <= mp.mpf("0.0031308")
        else mp.mpf("1.055") * x ** (1 / mp.mpf("2.4")) - mp.mpf("0.055")
    )


def pixel_losses(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    saturated, colour, mask = mp.mpf(254) / 255, {True: [], False: []}, []
    names = ("mean", "opacity", "target", "background", "whole")
    for mean, opacity, target, background, whole in zip(*(row[n] for n in names)):
        o, (*photo, a) = mp.mpf(float(opacity)), vector(target)
        for m, t, b in zip(vector(mean), photo, vector(background)):
            for linear, terms in colour.items():
                mixed, behind = whole and linear, linear_of(b)
                c = behind + o * (m - behind) if mixed else m
                c = srgb(c) if linear else c
                c = min(c, mp.mpf(1)) if t >= saturated else c
                terms.append(((c if mixed else b + o * (c - b)) - (t if whole else b + a * (t - b))) ** 2)
        o = min(max(o, mp.mpf("1e-3")), 1 - mp.mpf("1e-3"))
        mask.append((mp.mpf("-0.1") if whole else -1) * (a * mp.log(o) + (1 - a) * mp.log(1 - o)))
    mean_mask = mp.fsum(mask) / len(mask)
    linear, encoded = (mp.fsum(terms) / len(terms) for terms in colour.values())
    return {"colour": [linear], "mask": [mean_mask], "colour of sRGB": [encoded], "mask of sRGB": [mean_mask]}


def gradient_losses(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    gradients, weights = [vector(g) for g in row["gradients"]], vector(row["weights"])
    sizes = [mp.sqrt(mp.fsum(x * x for x in g)) for g in gradients]
    total, apart = mp.mpf(0), mp.mpf(0)
    for j in range(PAIRS):
        k = len(gradients) - PAIRS + j
        if min(sizes[j], sizes[k]) < mp.mpf("1e-3"):
            continue
        here, there = ([x / sizes[i] for x in gradients[i]] for i in (j, k))
        if mp.fsum(a * b for a, b in zip(here, there)) >= 0:
            distance = mp.sqrt(mp.fsum((a - b) ** 2 for a, b in zip(here, there)))
            total, apart = total + weights[j], apart + weights[j] * distance
    return {
        "eikonal": [mp.fsum((s - 1) ** 2 for s in sizes) / len(sizes)],
        "smoothness": [apart / max(total, mp.mpf("1e-8"))],
    }


def quadratic_entropy(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    points = [vector(x) for x in row["x"]]
    likeness = [mp.exp(-mp.fsum((a - b) ** 2 for a, b in zip(p, q)) / 4) for p in points for q in points]
    return {"entropy": [-mp.log(mp.fsum(likeness) / len(points) ** 2)]}


def light_prior(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    texels, total, first = [vector(x) for x in row["texels"]], mp.mpf(0), 0
    mean = [mp.fsum(x) / LEVELS[0] for x in zip(*texels[: LEVELS[0]])]
    for number, size in enumerate(LEVELS):
        for texel in texels[first : first + size]:
            apart = [x - m for x, m in zip(texel, mean)] if number == 0 else texel
            grey = mp.fsum(apart) / 3
            colour = mp.fsum((x - grey) ** 2 for x in apart) / 3
            total += (mp.log1p(grey**2 / mp.mpf("0.75")) + mp.log1p(colour / mp.mpf("0.12"))) / size
        first += size
    return {"prior": [total]}
