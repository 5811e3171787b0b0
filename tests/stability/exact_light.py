"""Light in arbitrary precision: the pre-integrated lobe, octahedral maps and spherical harmonics."""

from functools import lru_cache

import numpy as np

from stability.entry import Rows
from stability.precise import mp, vector

DEGREE = 12
RESOLUTIONS, NODES = (16, 8, 4), ("0.1", "0.2", "0.35", "0.5")


def prefilter_light(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    """gbar = sum D L (w.w_s)+ / sum D (w.w_s)+, with 1 - w.w_s = |w - w_s|^2 / 2 and D of half that angle."""
    query, a2 = vector(row["query_dirs"]), max(mp.mpf(float(row["roughness"][0])) ** 2, mp.mpf("1e-4")) ** 2
    sums, total = [mp.mpf(0)] * 3, mp.mpf(0)
    for direction, light in zip(shared["light_dirs"].numpy(), shared["light"].numpy()):
        cosine = 1 - mp.fsum((a - b) ** 2 for a, b in zip(query, vector(direction))) / 2
        if cosine <= 0:
            continue
        cos2_half = (1 + cosine) / 2
        weight = a2 / (mp.pi * (cos2_half * (a2 - 1) + 1) ** 2) * cosine
        total += weight
        sums = [s + weight * x for s, x in zip(sums, vector(light))]
    return {"gbar": [s / total if total else total for s in sums]}


def light_lookup(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    """Maps between the nodes of roughness, harmonics beyond the last of them."""
    direction, roughness = vector(row["directions"]), mp.mpf(float(row["roughness"][0]))
    nodes = [mp.mpf(x) for x in NODES]
    last = len(RESOLUTIONS)

    def at(k: int) -> list:
        if k == last:
            return harmonics(direction, roughness, nodes[last], shared)
        start = sum(r * r for r in RESOLUTIONS[:k])
        return read_map(shared["levels"].numpy()[start : start + RESOLUTIONS[k] ** 2], RESOLUTIONS[k], direction)

    if roughness >= nodes[last]:
        return {"radiance": at(last)}
    if roughness <= nodes[0]:
        return {"radiance": at(0)}
    k = max(i for i in range(last) if roughness >= nodes[i])
    share = (roughness - nodes[k]) / (nodes[k + 1] - nodes[k])
    return {"radiance": [a + share * (b - a) for a, b in zip(at(k), at(k + 1))]}


def read_map(texels: np.ndarray, n: int, w: list) -> list:
    """Bilinear between texel centres; beyond an edge of the square stands the same edge mirrored at its middle."""
    size = mp.fsum(abs(x) for x in w)
    u, v = w[0] / size, w[1] / size
    if w[2] < 0:
        fold = lambda x: -1 if x < 0 else 1
        u, v = (1 - abs(v)) * fold(u), (1 - abs(u)) * fold(v)
    x, y = (u + 1) * n / 2 - mp.mpf("0.5"), (v + 1) * n / 2 - mp.mpf("0.5")
    i, j = int(mp.floor(x)), int(mp.floor(y))
    out = [mp.mpf(0)] * 3
    for a in (0, 1):
        for b in (0, 1):
            weight = (x - i if a else 1 - x + i) * (y - j if b else 1 - y + j)
            p, q = i + a, j + b
            if not 0 <= p < n:
                p, q = min(max(p, 0), n - 1), n - 1 - q
            if not 0 <= q < n:
                p, q = n - 1 - p, min(max(q, 0), n - 1)
            out = [o + weight * mp.mpf(float(t)) for o, t in zip(out, texels[q * n + p])]
    return out


@lru_cache(maxsize=1)
def normalisations() -> dict[tuple[int, int], object]:
    """sqrt((2l + 1) (l - m)! / (4 pi (l + m)!)), times sqrt 2 for m > 0."""
    return {
        (l, m): mp.sqrt((2 * l + 1) * mp.factorial(l - m) / (4 * mp.pi * mp.factorial(l + m)) * (2 if m else 1))
        for l in range(DEGREE + 1)
        for m in range(l + 1)
    }


def legendre_over_sine(l: int, m: int, z) -> object:
    """The m-th derivative of the Legendre polynomial P_l at z."""
    total = mp.mpf(0)
    for k in range((l - m) // 2 + 1):
        power = l - 2 * k
        factor = mp.mpf(-1) ** k * mp.binomial(l, k) * mp.binomial(2 * l - 2 * k, l) / mp.mpf(2) ** l
        total += factor * mp.factorial(power) / mp.factorial(power - m) * z ** (power - m)
    return total


def harmonics(w: list, roughness, start, shared: Rows) -> list:
    """Sum of zonal_l sh_lm Y_lm, bent to stay positive below a thousandth of the mean light."""
    zonal, sh = shared["zonal"].numpy(), shared["sh"].numpy()
    place = min(max((roughness - start) / (1 - start), mp.mpf(0)), mp.mpf(1)) * (len(zonal) - 1)
    row = min(int(place), len(zonal) - 2)
    out = [mp.mpf(0)] * 3
    for m in range(DEGREE + 1):
        turned = mp.mpc(w[0], w[1]) ** m
        for l in range(m, DEGREE + 1):
            low, high = mp.mpf(float(zonal[row, l])), mp.mpf(float(zonal[row + 1, l]))
            weight = (low + (place - row) * (high - low)) * normalisations()[l, m] * legendre_over_sine(l, m, w[2])
            for c in range(3):
                out[c] += weight * turned.real * mp.mpf(float(sh[l * l + l + m, c]))
                if m:
                    out[c] += weight * turned.imag * mp.mpf(float(sh[l * l + l - m, c]))
    least = [max(mp.mpf(float(sh[0, c])) / (1000 * mp.sqrt(4 * mp.pi)), mp.mpf("1e-20")) for c in range(3)]
    return [x if x >= e else e * mp.exp(x / e - 1) for x, e in zip(out, least)]
