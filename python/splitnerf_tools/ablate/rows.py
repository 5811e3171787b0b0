"""The rows of an ablation: which settings differ from the full method."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from splitnerf.config import Config
from splitnerf.errors import InputError

FULL = "full"

# The settings that split sum and predicted occlusion need; preset `paper` has them, so that a row changes one setting.
SPLIT: dict[str, object] = {"shading.method": "split"}
BY_MLP = SPLIT | {"occlusion.kind": "mlp"}
SUMMED: dict[str, object] = {
    "shading.method": "summed",
    "occlusion.kind": "bits",
    "shading.compositing": "linear",
    "shading.fresnel": "exact",
}

# The paper's own ablations (its table of relighting and albedo).
PAPER: dict[str, dict[str, object]] = {
    "no occlusion averaging": {"occlusion.channels": 3},
    "split sum, occlusion by MLP, no occlusion loss": BY_MLP | {"losses.occlusion_weight": 0.0},
    "no metal regulariser": {"losses.metal_weight": 0.0},
    "mip-map light": {"light.kind": "pyramid"},
}
SWITCHES: dict[str, dict[str, object]] = {
    "no refinement": {"refinement.enabled": False},
    "MLP light": {"light.kind": "mlp"},
    "light by the split sum": SPLIT,
    "summed light": SUMMED,
    "split sum, occlusion by MLP": BY_MLP,
    "split sum, occlusion averaged over channels": SPLIT | {"occlusion.channels": 1},
    "split sum, no occlusion": SPLIT | {"occlusion.kind": "off"},
    "split sum, Fresnel as in the paper": SPLIT | {"shading.fresnel": "paper"},
    "split sum, light queried at the reflection": SPLIT | {"shading.query": "reflection"},
    "split sum, composited in sRGB": SPLIT | {"shading.compositing": "srgb"},
    "no indirect light": {"occlusion.indirect": False},
    "no energy compensation": {"shading.compensate": False},
    "normals by finite differences": {"surface.normals": "finite_difference"},
    "materials from the SDF's outputs": {"materials.inputs": "outputs"},
    "no mask loss": {"losses.mask_weight": 0.0},
    "no neutral light": {"losses.neutral_weight": 0.0},
    "no smoothness of normals": {"losses.smoothness_weight": 0.0},
    "no material entropy": {"losses.entropy_weight": 0.0},
    "dark metals allowed": {"losses.dark_metal_weight": 0.0},
    "no metal loss at all": {"losses.metal_weight": 0.0, "losses.dark_metal_weight": 0.0},
}
# The references of rows that differ from the full method in more settings than the one that they are named after.
REFERENCES = {
    "split sum, occlusion by MLP, no occlusion loss": "split sum, occlusion by MLP",
    **{name: "light by the split sum" for name in SWITCHES if name.startswith("split sum, ")},
}


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: The row's name.
        config: All settings of the row's runs, except the seed.
        reference: The name of the row that it is compared with.
    """

    name: str
    config: Config
    reference: str = FULL

    @property
    def slug(self) -> str:
        """The row's name as the name of a folder."""
        return "".join(c if c.isalnum() else "_" for c in self.name.lower())


def make_rows(base: Config, names: list[str] | None = None) -> list[Row]:
    """The full method with the settings `base`, and its variations of these names (None: all), with the references of the
    variations. A variation that equals `base` is left out. Raises InputError where a name is unknown."""
    known = PAPER | SWITCHES
    unknown = [name for name in names or [] if name not in known]
    if unknown:
        raise InputError(f"--rows: no row is called {unknown[0]!r}; there are: {'; '.join(known)}")
    wanted = set(known if names is None else names)
    while missing := {REFERENCES[name] for name in wanted if name in REFERENCES} - wanted:
        wanted |= missing
    rows = [Row(FULL, base)]
    same = {}
    for name in (n for n in known if n in wanted):
        config = base.replace(known[name])
        equal = next((row.name for row in rows if row.config == config), None)
        same[name] = equal or name
        if equal is None:
            rows.append(Row(name, config, REFERENCES.get(name, FULL)))
    return [dataclasses.replace(row, reference=same.get(row.reference, row.reference)) for row in rows]
