"""The operators in arithmetic of 50 digits, written from the equations: one point or ray at a time, with mpmath."""

from functools import lru_cache

import numpy as np
from splitnerf.errors import InputError
from splitnerf.ops.shading import brdf_lut

from stability.entry import Rows

try:
    from mpmath import MPContext
except ImportError as error:
    raise InputError("arithmetic of 50 digits needs mpmath: pip install 'splitnerf[test]'") from error

mp = MPContext()
mp.dps = 50


def vector(values: np.ndarray) -> list:
    """Numbers of float64 in full precision."""
    return [mp.mpf(float(x)) for x in np.ravel(values)]


NODES = 31  # intervals of the table along both axes


def dot(a: list, b: list):
    return mp.fsum(x * y for x, y in zip(a, b))


def clipped(x, low, high):
    return max(mp.mpf(low), min(mp.mpf(high), x))


def table(n_dot_v, roughness) -> list:
    """F1, F2, chi, E_d: bilinear in sqrt(n.v) and roughness."""
    lut = brdf_lut().double().numpy()
    x, y = mp.sqrt(clipped(n_dot_v, 1e-4, 1)) * NODES, clipped(roughness, 0, 1) * NODES
    i, j = min(int(x), NODES - 1), min(int(y), NODES - 1)
    corners = [(a, b, (x - i if a else 1 - x + i) * (y - j if b else 1 - y + j)) for a in (0, 1) for b in (0, 1)]
    return [mp.fsum(w * mp.mpf(float(lut[j + b, i + a, k])) for a, b, w in corners) for k in range(4)]


def turned(normal: list, view: list) -> tuple[list, object]:
    """The normal towards the viewer, and its cosine."""
    cosine = dot(normal, view)
    return ([-x for x in normal], -cosine) if cosine < 0 else (normal, cosine)


def light_queries(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    view, roughness = vector(row["view_dirs"]), mp.mpf(float(row["roughness"][0]))
    normal, cosine = turned(vector(row["normals"]), view)
    mirror = [2 * cosine * n - v for n, v in zip(normal, view)]
    t = clipped((roughness - mp.mpf("0.3")) / (mp.mpf("0.4") - mp.mpf("0.3")), 0, 1)
    k = 1 + t * t * (3 - 2 * t) * (table(cosine, roughness)[2] - 1)
    mean = [(1 - k) * n + k * m for n, m in zip(normal, mirror)]
    size = mp.sqrt(dot(mean, mean))
    return {"mean": [x / size if size > 1e-10 else x * 0 for x in mean], "reflection": mirror}


def gain(f0, f1, f2, compensated: bool):
    return 1 + f0 * (1 / (f1 + f2) - 1) if compensated else mp.mpf(1)


def split_sum_shade(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    roughness, metallic = (mp.mpf(float(row[name][0])) for name in ("roughness", "metallic"))
    cosine = turned(vector(row["normals"]), vector(row["view_dirs"]))[1]
    f1, f2, _, layer = table(cosine, roughness)
    names = ("albedo", "specular", "diffuse", "occlusion_s", "occlusion_d", "indirect_s", "indirect_d")
    out: dict[str, list] = {}
    for mode in ("exact", "paper", "compensated"):
        out[mode] = []
        for albedo, l_s, l_d, o_s, o_d, i_s, i_d in zip(*(vector(row[name]) for name in names)):
            if mode == "paper":
                f0 = mp.mpf("0.04") * (1 - metallic) + metallic * albedo
                f = f0 + (1 - roughness - f0) * clipped(1 - cosine, 0, 1) ** 5
                energy, kept = f * f1 + f2, 1 - f
            else:
                coat = layer * gain(mp.mpf("0.04"), f1, f2, mode == "compensated")
                metal = (albedo * f1 + f2) * gain(albedo, f1, f2, mode == "compensated")
                energy, kept = metallic * metal + (1 - metallic) * coat, 1 - coat
            out[mode].append((1 - metallic) * kept * albedo * (o_d * l_d + i_d) + energy * (o_s * l_s + i_s))
    return out


def shade_sums(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    view, metallic = vector(row["view_dirs"]), mp.mpf(float(row["metallic"][0]))
    f1, f2, _, layer = table(turned(vector(row["normals"]), view)[1], mp.mpf(float(row["roughness"][0])))
    out: dict[str, list] = {"single": [], "compensated": []}
    for albedo, specular, grazing, diffuse, dielectric in zip(
        *(vector(row[n]) for n in ("albedo", "specular", "grazing", "diffuse", "dielectric"))
    ):
        for name, values in out.items():
            coat = gain(mp.mpf("0.04"), f1, f2, name == "compensated")
            metal = gain(albedo, f1, f2, name == "compensated") * (albedo * (specular - grazing) + grazing)
            base = (1 - coat * layer) * albedo * diffuse
            values.append(metallic * metal + (1 - metallic) * (coat * dielectric + base))
    share = mp.mpf(float(row["share"][0]))
    return out | {"mixed": [(x - other) * share for x, other in zip(out["compensated"], vector(row["other"]))]}


def fresnel_dielectric(cosine):
    """The mean reflectance of both polarisations at a dielectric of index 1.5."""
    cosine, index = clipped(cosine, 0, 1), mp.mpf("1.5")
    refracted = mp.sqrt(1 - (1 - cosine**2) / index**2)
    across = (cosine - index * refracted) / (cosine + index * refracted)
    along = (index * cosine - refracted) / (index * cosine + refracted)
    return (across**2 + along**2) / 2


def light_sums(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    """Sums of D V (n.l) L / p and of the cosine's, D in the distance of half vector and normal."""
    view, roughness = vector(row["view_dirs"]), mp.mpf(float(row["roughness"][0]))
    normal, cosine = turned(vector(row["normals"]), view)
    cosine = max(cosine, mp.mpf("1e-4"))
    a2 = max(roughness**2, mp.mpf("2e-3")) ** 2
    out = {name: [mp.mpf(0)] * 3 for name in ("specular", "grazing", "diffuse", "dielectric")}
    for light_dir, pdf, radiance in zip(row["light_dirs"], row["pdf"], row["radiance"]):
        light = vector(light_dir)
        along = dot(normal, light)
        if along <= 0 or pdf <= 0:
            continue
        half = [a + b for a, b in zip(view, light)]
        size = mp.sqrt(dot(half, half) + mp.mpf("1e-20"))
        half = [x / size for x in half]
        apart = [n - h for n, h in zip(normal, half)]
        sin2 = dot(apart, apart) * (1 - dot(apart, apart) / 4)
        density = a2 / (mp.pi * (a2 + (1 - a2) * sin2) ** 2)
        shadowed = along * mp.sqrt(cosine**2 * (1 - a2) + a2) + cosine * mp.sqrt(along**2 * (1 - a2) + a2)
        lobe = density * along / (2 * shadowed)
        weights = {
            "specular": lobe,
            "grazing": lobe * clipped(1 - dot(view, half), 0, 1) ** 5,
            "diffuse": along / mp.pi,
            "dielectric": lobe * fresnel_dielectric(dot(view, half)),
        }
        for c, value in enumerate(vector(radiance)):
            share = value / (len(row["pdf"]) * mp.mpf(float(pdf)))
            for name, weight in weights.items():
                out[name][c] += share * weight
    return out


def linear_to_srgb(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    x = max(mp.mpf(float(row["linear"])), mp.mpf(0))
    curved = mp.mpf("1.055") * x ** (1 / mp.mpf("2.4")) - mp.mpf("0.055")
    return {"srgb": [mp.mpf("12.92") * x if x <= mp.mpf("0.0031308") else curved]}


def srgb_to_linear(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    x = mp.mpf(float(row["srgb"]))
    curved = ((x + mp.mpf("0.055")) / mp.mpf("1.055")) ** mp.mpf("2.4")
    return {"linear": [x / mp.mpf("12.92") if x <= mp.mpf("0.04045") else curved]}


# ---- weights of samples along a ray ----


def weights_along_z(row: dict[str, np.ndarray], shared: Rows, step: float) -> dict[str, list]:
    """Of gradients (1, 0, slope) and a ray along z."""
    before, after = [], []
    for f, slope in zip(vector(row["sdf"]), vector(row["slope"])):
        half = mp.mpf(step) / 2 * max(-slope / mp.sqrt(1 + slope**2 + mp.mpf("1e-12")), 0)
        before.append(f + half), after.append(f - half)
    return weights_of(before, after, mp.mpf(float(shared["s"])))


def weights_of(f_prev: list, f_next: list, s) -> dict[str, list]:
    """w = alpha T, alpha = (Phi(f_prev) - Phi(f_next))+ / Phi(f_prev), from the logarithms of Phi."""
    passing, found = mp.mpf(1), []
    for before, after in zip(f_prev, f_next):
        logarithm = min(log_sigmoid(s * after) - log_sigmoid(s * before), mp.mpf(0))
        found.append(-mp.expm1(logarithm) * passing)
        passing *= mp.exp(logarithm)
    return {"weights": found, "opacity": [mp.fsum(found)]}


def surface_weights(row: dict[str, np.ndarray], shared: Rows, step: float, anneal: float) -> dict[str, list]:
    """Intervals sdf -+ step / 2 times the annealed cosine of ray and normal."""
    t, direction, before, after, normals = mp.mpf(anneal), vector(row["rays_d"]), [], [], []
    for f, g in zip(vector(row["sdf"]), row["gradient"]):
        g = vector(g)
        length = mp.sqrt(mp.fsum(x * x for x in g) + mp.mpf("1e-12"))
        normal = [x / length for x in g]
        cosine = mp.fsum(a * b for a, b in zip(direction, normal))
        slope = -(max((1 - cosine) / 2, 0) * (1 - t) + max(-cosine, 0) * t)
        half = mp.mpf(step) / 2 * slope
        before.append(f - half), after.append(f + half)
        normals += normal
    return {"normals": normals, **weights_of(before, after, mp.mpf(float(shared["s"])))}


def log_sigmoid(x):
    """log(1 / (1 + exp(-x)))."""
    return -mp.log1p(mp.exp(-x)) if x > 0 else x - mp.log1p(mp.exp(x))


# ---- light: the pre-integrated lobe, octahedral maps and spherical harmonics ----

DEGREE = 12
RESOLUTIONS, LIGHT_NODES = (16, 8, 4), ("0.1", "0.2", "0.35", "0.5")


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
    nodes = [mp.mpf(x) for x in LIGHT_NODES]
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
