"""The level of the light, by what dielectrics reflect, and its tint, by metals; docs/method.md, "The level of the light", has the reasons.
Metals: Akenine-Moller et al., Real-Time Rendering, 4th ed., table 9.2.
"""

from __future__ import annotations

import torch
from torch import Tensor

DIELECTRIC = 0.04  # F0, reflectance at normal incidence
DARKEST_METAL = 0.2  # F0 below which a texel is a dielectric, whatever its metallic says
GLOSSY = 0.4  # roughness below which F0 is told from what is scattered
AGREE = 0.15  # difference of logarithms of F0 up to which texels agree: all dielectrics have one F0, dark metals many
LEAST_SHARE = 0.1  # of all texels that must agree
LEAST_FACTOR = 1.05  # below which the level stays
METAL = 0.8  # metallic from which on a texel is metal
# Differences of logarithms: of a faint colour's channels (copper's are 0.57), and of texels' colours up to which they agree. The share of all texels
# that must agree: 0.24 and 0.95 of two objects with grey metal, 0.06 to 0.15 of eight of many-coloured metal.
FAINT, ONE_COLOUR, LEAST_GREY = 0.45, 0.1, 0.2


def level_of_light(values: Tensor) -> float:
    """The factor by which the light is too dark; 1 where it is not, or where too few texels agree on it. `values` [m, 8] are those
    of the texture: albedo (3), roughness, metallic, normal (3)."""
    found = (_reflectance(values)[_dielectric(values)] / DIELECTRIC).log().sort().values
    if len(found) == 0:
        return 1.0
    first = torch.searchsorted(found, found - AGREE)
    n_agreeing, middle = (torch.searchsorted(found, found + AGREE, right=True) - first).max(0)
    factor = float(found[first[middle] :][:n_agreeing].median().exp())
    return factor if factor >= LEAST_FACTOR and n_agreeing >= LEAST_SHARE * len(values) else 1.0


def tint_of_light(values: Tensor) -> Tensor:
    """[3] the factors on the light's colours, of geometric mean 1, with which metal of a faint colour is grey; 1 where too few
    texels agree on one. `values` [m, 8] as of :func:`level_of_light`."""
    logs = values[values[:, 4] > METAL, :3].clamp(min=1e-3).log()
    colours = (logs - logs.mean(1, keepdim=True))[logs.amax(1) - logs.amin(1) < FAINT]
    if len(colours) == 0:
        return torch.ones(3)
    middle = colours.median(0).values
    n_agreeing = int(((colours - middle).abs().amax(1) < ONE_COLOUR).sum())
    return (middle - middle.mean()).exp() if n_agreeing >= LEAST_GREY * len(values) else torch.ones(3)


def evidence(level: float, tint: list[float]) -> list[str]:
    """What tells the level and the tint of the light of a run, in sentences; docs/results.md has the errors."""
    told = [
        "no highlight tells how bright the light is; unless photos show the light itself, albedo and light may be off by a tenth, at worst by a third"
        if level == 1
        else f"the light was made {level:.2f} times as bright, as highlights ask"
    ]
    if max(tint) > 1:
        factors = ", ".join(f"{factor:.2f}" for factor in tint)
        told.append(
            f"metal of one faint colour is taken for grey: the light's red, green, blue are multiplied by {factors}"
        )
    return told


def rest_level(level: float, lamp_gain: float) -> float:
    """The factor on the light at a level that dielectrics ask for. A lamp that makes all its power larger by a factor of more than 1 stands in a
    light that mirror images or photos have shown: that light stays, and dielectrics asked for the lamp, which makes highlights, too."""
    return level if lamp_gain == 1.0 else 1.0


def at_level(values: Tensor, level: float, lamp_gain: float = 1.0) -> Tensor:
    """The texture values [m, 8] that look the same under a light of that level, of which a lamp adds a factor `lamp_gain` of all
    power. What scatters becomes darker by both, metals, which mirror the rest of the light, by the rest's level. Where a level was
    found, what is glossy and reflects less than a metal becomes a dielectric."""
    albedo, metallic = values[:, :3], values[:, 4:5]
    faint = _dielectric(values)[:, None] if level > 1.0 else torch.zeros_like(metallic, dtype=torch.bool)
    albedo = albedo * torch.where(faint, (1 - metallic) / lamp_gain, metallic + (1 - metallic) / lamp_gain)
    metallic = torch.where(faint, 0.0, metallic)
    return torch.cat([albedo / rest_level(level, lamp_gain), values[:, 3:4], metallic, values[:, 5:]], dim=1)


def _reflectance(values: Tensor) -> Tensor:
    """[m] F0, mean over the colours."""
    albedo, metallic = values[:, :3], values[:, 4:5]
    return (DIELECTRIC * (1 - metallic) + albedo * metallic).mean(1)


def _dielectric(values: Tensor) -> Tensor:
    """[m] bool, what is glossy and reflects too little for a metal."""
    return (_reflectance(values) < DARKEST_METAL) & (values[:, 3] < GLOSSY)
