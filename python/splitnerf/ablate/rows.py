"""The rows of an ablation: which settings differ from the full method."""

from __future__ import annotations

from dataclasses import dataclass

from splitnerf.config import Config
from splitnerf.errors import InputError

FULL = "full"

SPLIT: dict[str, object] = {"shading": "split"}  # what has no bits, or composites in sRGB, cannot sum the light

# The paper's own ablations (its table of relighting and albedo).
PAPER: dict[str, dict[str, object]] = {
    "no occlusion averaging": {"occlusion_channels": 3},
    "no occlusion loss": SPLIT | {"occlusion": "mlp", "occlusion_weight": 0.0},
    "no metal regulariser": {"metal_regulariser": False},
    "mip-map light": {"light": "pyramid"},
}
SWITCHES: dict[str, dict[str, object]] = {
    "MLP light": {"light": "mlp"},
    "light by the split sum": SPLIT,
    "summed light": {"shading": "summed", "occlusion": "bits"},
    "split sum, no occlusion": SPLIT | {"occlusion": "off"},
    "split sum, occlusion by MLP": SPLIT | {"occlusion": "mlp"},
    "split sum, occlusion by MLP, of position alone": SPLIT | {"occlusion": "mlp", "occlusion_directional": False},
    "occlusion averaged over channels": {"occlusion_channels": 1},
    "occlusion by bits": {"occlusion": "bits", "indirect": False},
    "occlusion by bits, indirect light": {"occlusion": "bits", "indirect": True},
    "Fresnel as in the paper": {"fresnel_mode": "paper"},
    "Fresnel as in the released code": {"fresnel_mode": "code"},
    "no energy compensation": {"compensate": False},
    "light asked at the reflection": {"query": "reflection"},
    "split sum, composited in sRGB": SPLIT | {"compositing": "srgb"},
    "normals by finite differences": {"normals": "finite_difference"},
    "materials from the SDF's outputs": {"head_inputs": "outputs"},
    "no mask loss": {"mask_weight": 0.0},
    "no neutral light": {"neutral_weight": 0.0},
    "no Monte Carlo fine-tune": {"finetune_from": 1.0},
    "Monte Carlo fine-tune": {"finetune_from": 0.85},
    "no smoothness of normals": {"normal_smoothness": 0.0},
    "no material entropy": {"entropy_weight": 0.0},
    "dark metals allowed": {"dark_metal_weight": 0.0},
}


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: What it is called.
        config: All settings of its runs, but for the seed.
    """

    name: str
    config: Config

    @property
    def slug(self) -> str:
        """The name as a folder's."""
        return "".join(c if c.isalnum() else "_" for c in self.name.lower())


def make_rows(base: Config, names: list[str] | None = None) -> list[Row]:
    """The full method and its variations; one that changes nothing about `base` is left out.

    Args:
        base: The full method.
        names: The variations to take; None for all.

    Raises:
        InputError: A name is unknown.
    """
    known = PAPER | SWITCHES
    unknown = [name for name in names or [] if name not in known]
    if unknown:
        raise InputError(f"--rows: no row is called {unknown[0]!r}; there are: {'; '.join(known)}")
    rows = [Row(FULL, base)]
    for name in known if names is None else names:
        config = base.replace(known[name])
        if all(config != row.config for row in rows):
            rows.append(Row(name, config))
    return rows
