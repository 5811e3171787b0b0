"""Shading in arbitrary precision, written from the equations: one point at a time, with mpmath."""

from __future__ import annotations

import numpy as np

from stability.entry import Rows
from stability.precise import mp, vector
from splitnerf.ops import brdf_lut

NODES = 31  # intervals of the table along both axes


def dot(a: list, b: list):
    return mp.fsum(x * y for x, y in zip(a, b))


def clipped(x, low, high):
    return max(mp.mpf(low), min(mp.mpf(high), x))


def table(n_dot_v, roughness) -> list:
    """F1, F2, chi: bilinear in sqrt(n.v) and roughness."""
    lut = brdf_lut().double().numpy()
    x, y = mp.sqrt(clipped(n_dot_v, 1e-4, 1)) * NODES, clipped(roughness, 0, 1) * NODES
    i, j = min(int(x), NODES - 1), min(int(y), NODES - 1)
    corners = [(a, b, (x - i if a else 1 - x + i) * (y - j if b else 1 - y + j)) for a in (0, 1) for b in (0, 1)]
    return [mp.fsum(w * mp.mpf(float(lut[j + b, i + a, k])) for a, b, w in corners) for k in range(3)]


def turned(normal: list, view: list) -> tuple[list, object]:
    """The normal towards the viewer, and its cosine."""
    cosine = dot(normal, view)
    return ([-x for x in normal], -cosine) if cosine < 0 else (normal, cosine)


def query_direction(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    view, roughness = vector(row["view_dirs"]), mp.mpf(float(row["roughness"][0]))
    normal, cosine = turned(vector(row["normals"]), view)
    mirror = [2 * cosine * n - v for n, v in zip(normal, view)]
    t = clipped((roughness - mp.mpf("0.3")) / (mp.mpf("0.4") - mp.mpf("0.3")), 0, 1)
    k = 1 + t * t * (3 - 2 * t) * (table(cosine, roughness)[2] - 1)
    mean = [(1 - k) * n + k * m for n, m in zip(normal, mirror)]
    size = mp.sqrt(dot(mean, mean))
    return {"mean": [x / size if size > 1e-10 else x * 0 for x in mean], "reflection": mirror}


def fresnel(mode: str, f0, roughness, cosine):
    edge = {"paper": 1 - roughness, "code": max(1 - roughness, f0)}.get(mode, f0)
    return f0 + (edge - f0) * clipped(1 - cosine, 0, 1) ** 5


def split_sum_shade(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    view, roughness, metallic = (
        vector(row["view_dirs"]),
        mp.mpf(float(row["roughness"][0])),
        mp.mpf(float(row["metallic"][0])),
    )
    cosine = turned(vector(row["normals"]), view)[1]
    f1, f2, _ = table(cosine, roughness)
    names = ("albedo", "specular", "diffuse", "occlusion_s", "occlusion_d")
    out: dict[str, list] = {}
    for mode in ("exact", "paper", "code", "compensated"):
        out[mode] = []
        for albedo, l_s, l_d, o_s, o_d in zip(*(vector(row[name]) for name in names)):
            f0 = mp.mpf("0.04") * (1 - metallic) + metallic * albedo
            f = fresnel(mode, f0, roughness, cosine)
            energy = f * f1 + f2
            if mode == "compensated":
                energy *= 1 + f * (1 / (f1 + f2) - 1)
            kept = 1 - (f if mode in ("paper", "code") else energy)
            out[mode].append(o_d * (1 - metallic) * kept * albedo * l_d + o_s * energy * l_s)
    return out


def shade_sums(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    view, metallic = vector(row["view_dirs"]), mp.mpf(float(row["metallic"][0]))
    f1, f2, _ = table(turned(vector(row["normals"]), view)[1], mp.mpf(float(row["roughness"][0])))
    out: dict[str, list] = {"single": [], "compensated": []}
    for albedo, specular, grazing, diffuse in zip(
        *(vector(row[n]) for n in ("albedo", "specular", "grazing", "diffuse"))
    ):
        f0 = mp.mpf("0.04") * (1 - metallic) + metallic * albedo
        for name, values in out.items():
            gain = 1 + f0 * (1 / (f1 + f2) - 1) if name == "compensated" else mp.mpf(1)
            energy = (f0 * f1 + f2) * gain
            lobes = gain * (f0 * (specular - grazing) + grazing)
            values.append(lobes + (1 - metallic) * (1 - energy) * albedo * diffuse)
    return out


def light_sums(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    """Sums of D V (n.l) L / p and of the cosine's, D in the distance of half vector and normal."""
    view, roughness = vector(row["view_dirs"]), mp.mpf(float(row["roughness"][0]))
    normal, cosine = turned(vector(row["normals"]), view)
    cosine = max(cosine, mp.mpf("1e-4"))
    a2 = max(roughness**2, mp.mpf("2e-3")) ** 2
    out = {name: [mp.mpf(0)] * 3 for name in ("specular", "grazing", "diffuse")}
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
        schlick = clipped(1 - dot(view, half), 0, 1) ** 5
        for c, value in enumerate(vector(radiance)):
            share = value / (len(row["pdf"]) * mp.mpf(float(pdf)))
            for name, weight in (("specular", lobe), ("grazing", lobe * schlick), ("diffuse", along / mp.pi)):
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
