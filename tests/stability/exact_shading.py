"""Shading in arbitrary precision, written from the equations: one point at a time, with mpmath."""

import numpy as np
from splitnerf.ops.shading import brdf_lut

from stability.entry import Rows
from stability.precise import mp, vector

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
