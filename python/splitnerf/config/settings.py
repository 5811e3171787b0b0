"""All settings of a run: groups, their checks, and their TOML form."""

from __future__ import annotations

import dataclasses
import difflib
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from splitnerf.config import groups
from splitnerf.config.setting import LARGEST_FLOAT
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.files import atomic_path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

UNLIMITED = 10**9
MOST_CELLS = 1 << 30  # along an edge of the hash grid's finest level
SUMMED_DIRECTIONS = 256  # fewer do not resolve the lobes that `shading.method = summed` sums


@dataclass(frozen=True)
class Config:
    """Settings of one run, in groups. The defaults are the preset ``cpu``. Raises InputError where a value is of
    another type or out of its range, or values exclude each other."""

    run: groups.RunSettings = groups.RunSettings()
    data: groups.DataSettings = groups.DataSettings()
    exposure: groups.ExposureSettings = groups.ExposureSettings()
    separation: groups.SeparationSettings = groups.SeparationSettings()
    surface: groups.SurfaceSettings = groups.SurfaceSettings()
    materials: groups.MaterialsSettings = groups.MaterialsSettings()
    light: groups.LightSettings = groups.LightSettings()
    shading: groups.ShadingSettings = groups.ShadingSettings()
    occlusion: groups.OcclusionSettings = groups.OcclusionSettings()
    mesh: groups.MeshSettings = groups.MeshSettings()
    sampling: groups.SamplingSettings = groups.SamplingSettings()
    losses: groups.LossesSettings = groups.LossesSettings()
    refinement: groups.RefinementSettings = groups.RefinementSettings()
    export: groups.ExportSettings = groups.ExportSettings()
    constants: groups.Constants = groups.Constants()

    def __post_init__(self) -> None:
        for group, kind in GROUPS.items():
            if type(getattr(self, group)) is not kind:
                raise InputError(f"{group} is a group of settings, got {getattr(self, group)!r}")
        for name, known in FIELDS.items():
            value, limits = self[name], known.metadata["limits"]
            if type(value).__name__ != known.type and not (known.type == "float" and type(value) is int):
                raise InputError(f"{name} takes a value of type {known.type}, got {value!r}")
            if not limits.allow(value):
                raise InputError(f"{name} must be {limits}, got {value!r}")
        for message in self._conflicts():
            raise InputError(message)

    def _conflicts(self) -> Iterator[str]:
        """What is wrong with settings that exclude each other."""
        run, shading, occlusion = self.run, self.shading, self.occlusion
        summable = occlusion.kind == "bits" and shading.compositing == "linear" and shading.fresnel == "exact"
        if shading.method == "summed" and not (summable and self.constants.occlusion_directions >= SUMMED_DIRECTIONS):
            yield (
                f"shading.method = summed needs occlusion.kind = bits with at least {SUMMED_DIRECTIONS} "
                "constants.occlusion_directions, shading.compositing = linear and shading.fresnel = exact; "
                "set shading.method=split"
            )
        if self.exposure.refine == "yes" and shading.compositing != "linear":
            yield "exposure.refine = yes needs shading.compositing = linear; set exposure.refine=no"
        if self.finest_cells >= MOST_CELLS:
            yield f"a level of the hash grid needs fewer than {MOST_CELLS} cells along an edge; lower surface.growth"
        if run.deterministic and run.max_minutes > 0:
            yield "a deterministic run ends by its steps alone; leave out --max-minutes (run.max_minutes) and give --steps"
        fixed = self.light.kind == "pyramid" and occlusion.kind != "mlp" and self.surface.normals == "analytic"
        if run.cuda_graphs and not (fixed and self.constants.entropy_points > 1):
            yield (
                "run.cuda_graphs needs light.kind = pyramid, occlusion.kind = bits or off, surface.normals = analytic and "
                "more than one of constants.entropy_points; set run.cuda_graphs=false"
            )

    def __getitem__(self, name: str) -> object:
        """The value of a setting by its name, or by a short one, see :data:`SHORT_NAMES`."""
        group, _, key = SHORT_NAMES.get(name, name).partition(".")
        return getattr(getattr(self, group), key)

    @property
    def finest_cells(self) -> float:
        """The cells along an edge of the hash grid's finest level, which the grid rounds down."""
        return self.constants.base_resolution * self.surface.growth ** (self.surface.n_levels - 1)

    @property
    def reading(self) -> Reading:
        """The options for reading the data."""
        return Reading(self.data.eval_mode, self.data.mask_kind, max_memory=self.data.max_memory)

    @property
    def training_minutes(self) -> float:
        """The minutes of the run that training gets, the rest is the refinement's; 0: no limit."""
        return self.run.max_minutes - self.refinement_minutes

    @property
    def refinement_minutes(self) -> float:
        """The minutes of the run that the refinement gets; 0 without it, or without a limit."""
        return self.run.max_minutes * self.refinement.share if self.refinement.enabled else 0.0

    @property
    def refinement_sweeps(self) -> int:
        """The most steps of the refinement: where minutes end it, as many as these allow."""
        return UNLIMITED if self.refinement_minutes > 0 else self.refinement.sweeps

    def replace(self, settings: dict[str, object]) -> Config:
        """A copy with some settings changed: values by ``group.name`` or by a short name, see :data:`SHORT_NAMES`, or a
        table of values by group. Raises InputError where a name is unknown, or a value is not allowed."""
        changes: dict[str, dict[str, object]] = {}
        for name, value in _flat(settings):
            group, _, key = name.partition(".")
            whole = FIELDS[name].type == "float" and type(value) is int and abs(value) <= LARGEST_FLOAT
            changes.setdefault(group, {})[key] = float(value) if whole else value
        groups = {group: dataclasses.replace(getattr(self, group), **values) for group, values in changes.items()}
        return dataclasses.replace(self, **groups)

    def write(self, path: Path) -> None:
        with atomic_path(path) as temporary:
            temporary.write_text(tomli_w.dumps(dataclasses.asdict(self)), encoding="utf-8")

    @staticmethod
    def read(path: Path) -> Config:
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not a readable run configuration ({error})") from error
        try:
            return Config().replace(table)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None


GROUPS = {group.name: type(group.default) for group in dataclasses.fields(Config)}
FIELDS = {f"{group}.{known.name}": known for group, kind in GROUPS.items() for known in dataclasses.fields(kind)}
_GROUPS_OF = {known.name: [group for group in GROUPS if f"{group}.{known.name}" in FIELDS] for known in FIELDS.values()}
SHORT_NAMES = {name.replace(".", "_"): name for name in FIELDS} | {
    key: f"{groups[0]}.{key}" for key, groups in _GROUPS_OF.items() if len(groups) == 1 or groups[0] == "run"
}
"""Short names of settings: `light_resolution` for `light.resolution`; and by the name in the group alone where no other group
has it, or the group is `run`: `n_levels` for `surface.n_levels`."""


def settings_table(config: Config) -> str:
    """Lines of ``group.name = value``, range or choices, unit and meaning, in columns, under their groups' titles."""

    def shown(value: object) -> str:
        return str(value).lower() if isinstance(value, bool) else str(value)

    rows = {
        name: (
            f"{name} = {shown(config[name])}",
            f"{known.metadata['limits']}".removeprefix("in "),
            known.metadata["unit"],
            known.metadata["meaning"],
        )
        for name, known in FIELDS.items()
        if known.metadata["meaning"]
    }
    widths = [max(len(row[i]) for row in rows.values()) for i in range(3)]
    lines = []
    for group, kind in list(GROUPS.items())[:-1]:  # the last one is the record of the method
        lines += ["", f"[{group}] {kind.__doc__.splitlines()[0]}"]
        for name, row in rows.items():
            if name.startswith(f"{group}."):
                lines.append("  ".join([*(cell.ljust(width) for cell, width in zip(row, widths)), row[3]]))
    return "\n".join(lines[1:])


def _flat(settings: dict[str, object]) -> Iterator[tuple[str, object]]:
    """Each setting by its name with the group, in order."""
    for key, value in settings.items():
        if key in GROUPS and isinstance(value, dict):
            for inner, x in value.items():
                yield _known(f"{key}.{inner}"), x
        else:
            yield _known(key), value


def _known(key: object) -> str:
    """The name of a setting with its group. Raises InputError where there is none."""
    name = SHORT_NAMES.get(key, key)
    if name in FIELDS:
        return name
    if name in GROUPS:
        member = next(known for known in FIELDS if known.startswith(f"{name}."))
        raise InputError(f"{name} is a group of settings; set one of them, such as {member}")
    near = difflib.get_close_matches(str(key), [*FIELDS, *SHORT_NAMES], n=1)
    hint = f"did you mean {SHORT_NAMES.get(near[0], near[0])}? " if near else ""
    raise InputError(f"unknown setting {key!r}; {hint}`splitnerf info --settings` lists them")
