"""Settings: what each is by default and in the presets, what it may be, and by which names it is known."""

from __future__ import annotations

import dataclasses
import math
import re
import sys

import pytest
from hypothesis import HealthCheck, assume, given
from hypothesis import settings as examples
from hypothesis import strategies as st

from splitnerf.cli import DONE, main
from splitnerf.config import FIELDS, GROUPS, OLD_NAMES, Config, parse_setting, preset, settings_table
from splitnerf.config.setting import setting
from splitnerf.errors import InputError
from splitnerf.training.checkpoint import config_of

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PAPER = "the paper, section 4 or supplement"
CODE = "the released code, where the paper says nothing"
OURS = "ours: beyond the paper, or without effect in its preset"

# By name: the name before there were groups, the value in preset `cpu`, the value in preset `paper`, and its source.
SETTINGS = {
    "run.preset": ("preset", "cpu", "paper", OURS),
    "run.seed": ("seed", 0, 0, OURS),
    "run.steps": ("steps", 6000, 20000, PAPER),
    "run.max_minutes": ("max_minutes", 0.0, 0.0, OURS),
    "run.deterministic": ("deterministic", False, False, OURS),
    "run.cuda_graphs": ("cuda_graphs", False, False, OURS),
    "run.tensor_cores": ("tensor_cores", True, True, OURS),
    "run.preview_every": ("preview_every", 0.1, 0.1, OURS),
    "run.checkpoint_minutes": ("checkpoint_minutes", 2.0, 2.0, OURS),
    "data.eval_mode": ("eval_mode", "auto", "auto", OURS),
    "data.mask_kind": ("mask_kind", "auto", "auto", OURS),
    "data.max_memory": ("max_memory", 0.0, 0.0, OURS),
    "exposure.refine": ("exposure_refine", "auto", "auto", OURS),
    "exposure.white_balance": ("exposure_white_balance", False, False, OURS),
    "separation.share": ("separation_share", 0.15, 0.15, OURS),
    "separation.steps": ("separation_steps", 6000, 6000, OURS),
    "surface.box": ("box", 1.5, 1.5, PAPER),
    "surface.n_levels": ("n_levels", 9, 16, PAPER),
    "surface.n_features": ("n_features", 2, 2, PAPER),
    "surface.base_resolution": ("base_resolution", 16, 32, PAPER),
    "surface.growth": ("growth", 1.4697344922755988, 1.3195079, PAPER),
    "surface.log2_table_size": ("log2_table_size", 16, 19, PAPER),
    "surface.table_dtype": ("table_dtype", "float32", "float32", OURS),
    "surface.start_levels": ("start_levels", 4, 4, PAPER),
    "surface.levels_open_by": ("levels_open_by", 0.4, 0.6, PAPER),  # 12 levels, one each 1000 of 20,000 steps
    "surface.width": ("sdf_width", 64, 64, PAPER),
    "surface.outputs": ("sdf_outputs", 13, 13, PAPER),
    "surface.sphere_radius": ("sphere_radius", 0.7, 0.5, PAPER),
    "surface.normals": ("normals", "analytic", "finite_difference", PAPER),
    "surface.initial_variance": ("initial_variance", 0.3, 0.3, PAPER),
    "surface.cos_anneal_by": ("cos_anneal_by", 0.4, 1.0, PAPER),
    "materials.width": ("material_width", 64, 256, PAPER),
    "materials.layers": ("material_layers", 2, 2, PAPER),
    "materials.inputs": ("head_inputs", "grid", "outputs", PAPER),
    "materials.initial_roughness": ("initial_roughness", 0.3, 0.5, OURS),  # a sigmoid of 0
    "materials.min_roughness": ("min_roughness", 0.05, 0.0, PAPER),
    "light.kind": ("light", "pyramid", "mlp", PAPER),
    "light.resolution": ("light_resolution", 128, 128, OURS),
    "light.width": ("light_width", 64, 256, PAPER),
    "light.layers": ("light_layers", 3, 5, PAPER),
    "light.direction_frequencies": ("light_direction_frequencies", 6, 10, PAPER),
    "light.roughness_frequencies": ("light_roughness_frequencies", 3, 5, PAPER),
    "light.activation": ("light_activation", "exp", "softplus", PAPER),
    "shading.method": ("shading", "summed", "split", PAPER),
    "shading.fresnel": ("fresnel_mode", "exact", "paper", PAPER),
    "shading.query": ("query", "mean", "reflection", PAPER),
    "shading.compensate": ("compensate", True, False, PAPER),
    "shading.compositing": ("compositing", "linear", "srgb", PAPER),
    "occlusion.kind": ("occlusion", "bits", "mlp", PAPER),
    "occlusion.channels": ("occlusion_channels", 3, 1, PAPER),
    "occlusion.directional": ("occlusion_directional", True, False, PAPER),
    "occlusion.width": ("occlusion_width", 64, 256, PAPER),
    "occlusion.layers": ("occlusion_layers", 2, 2, PAPER),
    "occlusion.share": ("occlusion_share", 0.1, 0.1, PAPER),
    "occlusion.rays": ("occlusion_rays", 32, 64, PAPER),
    "occlusion.ray_start": ("occlusion_ray_start", "normal", "normal", PAPER),
    "occlusion.offset": ("occlusion_offset", 0.0125, 0.0125, OURS),  # the paper names none; the released code: 0.05
    "occlusion.environment_height": ("environment_height", 32, 128, OURS),
    "occlusion.directions": ("occlusion_directions", 256, 256, OURS),
    "occlusion.open_below": ("open_below", 0.02, 0.02, OURS),
    "occlusion.indirect": ("indirect", True, False, PAPER),
    "occlusion.indirect_every": ("indirect_every", 200, 200, OURS),
    "mesh.every": ("mesh_every", 0.1, 0.1, PAPER),  # 2000 of 20,000 steps
    "mesh.resolution": ("mesh_resolution", 96, 512, PAPER),
    "mesh.background": ("background_meshes", False, False, OURS),
    "sampling.initial_rays": ("initial_rays", 1024, 256, PAPER),
    "sampling.max_rays": ("max_rays", 8192, 8192, PAPER),
    "sampling.target_samples": ("target_samples", 4608, 262144, PAPER),
    "sampling.max_samples_per_ray": ("max_samples_per_ray", 1024, 1024, PAPER),
    "sampling.step_scale": ("step_scale", 2.0, 0.0, PAPER),
    "sampling.min_step": ("min_step", 0.01, math.sqrt(3) * 3 / 1024, PAPER),
    "sampling.max_step": ("max_step", 0.04, 0.04, OURS),
    "sampling.min_transmittance": ("min_transmittance", 1e-3, 0.0, PAPER),
    "sampling.min_weight": ("sample_above", 1e-3, 0.0, PAPER),
    "sampling.shades_per_ray": ("shades_per_ray", 4, 0, PAPER),
    "sampling.occupancy": ("occupancy", "distance", "average", PAPER),
    "sampling.grid_resolution": ("grid_resolution", 96, 128, PAPER),
    "sampling.grid_every": ("grid_every", 32, 16, PAPER),
    "sampling.hull_until": ("hull_until", 0.1, 0.0, PAPER),
    "sampling.foreground_share": ("foreground_share", 0.85, 0.0, PAPER),
    "losses.colour_weight": ("colour_weight", 10.0 / 3.0, 10.0, PAPER),  # the sum over channels, Eq. (3)
    "losses.light_weight": ("light_weight", 1.0, 10.0, PAPER),
    "losses.occlusion_weight": ("occlusion_weight", 0.1, 0.01, PAPER),
    "losses.eikonal_weight": ("eikonal_weight", 3.0, 0.1, PAPER),
    "losses.metal_weight": ("metal_weight", 1e-4, 1e-3, PAPER),
    "losses.metal_regulariser": ("metal_regulariser", True, True, PAPER),
    "losses.edge_pixels": ("edge_pixels", 2, 0, OURS),
    "losses.binary_metal_weight": ("binary_metal_weight", 0.003, 0.0, OURS),
    "losses.dark_metal_weight": ("dark_metal_weight", 0.002, 0.0, OURS),
    "losses.mask_weight": ("mask_weight", 1.0, 0.0, PAPER),
    "losses.neutral_weight": ("neutral_weight", 0.03, 0.0, OURS),
    "losses.light_prior_weight": ("light_prior_weight", 0.001, 0.0, OURS),
    "losses.seen_weight": ("seen_weight", 0.02, 0.0, OURS),
    "losses.entropy_weight": ("entropy_weight", 0.002, 0.0, OURS),
    "losses.priors_from": ("priors_from", 0.5, 0.5, OURS),
    "losses.entropy_points": ("entropy_points", 384, 384, OURS),
    "losses.albedo_width": ("albedo_width", 0.6, 0.6, OURS),
    "losses.gloss_width": ("gloss_width", 0.2, 0.2, OURS),
    "losses.neutral_queries": ("neutral_queries", 256, 256, OURS),
    "losses.smoothness_weight": ("normal_smoothness", 0.01, 0.0, OURS),
    "losses.smoothness_points": ("smoothness_points", 512, 512, OURS),
    "losses.smoothness_radius": ("smoothness_radius", 0.02, 0.02, OURS),
    "losses.light_form": ("light_loss_form", "smooth_l1", "square", PAPER),
    "losses.occlusion_form": ("occlusion_loss_form", "square", "square", PAPER),
    "losses.metal_form": ("metal_loss_form", "square", "square", PAPER),
    "losses.light_set": ("light_set", "fibonacci", "uniform", PAPER),
    "losses.light_samples": ("light_samples", 2048, 8129, CODE),
    "losses.light_noise": ("light_noise", 0.1, 0.0, OURS),
    "losses.light_queries": ("light_queries", 512, 8129, CODE),
    "losses.light_every": ("light_every", 1, 1, PAPER),
    "losses.light_lobe_below": ("light_lobe_below", 0.15, 0.0, PAPER),
    "losses.light_lobe_samples": ("light_lobe_samples", 16, 16, OURS),
    "losses.eikonal_points": ("eikonal_points", 256, 0, PAPER),
    "optimiser.learning_rate": ("learning_rate", 0.01, 0.01, PAPER),
    "optimiser.variance_learning_rate": ("variance_learning_rate", 0.001, 0.001, PAPER),
    "optimiser.light_learning_rate": ("light_learning_rate", 0.02, 0.02, OURS),
    "optimiser.light_step_every": ("light_step_every", 4, 4, OURS),
    "optimiser.warmup_steps": ("warmup_steps", 100, 500, PAPER),
    "optimiser.final_learning_rate": ("final_learning_rate", 0.02, 0.1, PAPER),
    "optimiser.weight_decay": ("weight_decay", 0.01, 0.01, OURS),  # what torch's AdamW has by default
    "optimiser.sparse_steps": ("sparse_steps", False, False, OURS),
    "refinement.enabled": ("refine", True, False, OURS),
    "refinement.share": ("refinement_share", 0.2, 0.2, OURS),
    "refinement.sweeps": ("refinement_sweeps", 16, 16, OURS),
    "export.resolution": ("export_resolution", 384, 512, OURS),
    "export.faces": ("export_faces", 50000, 50000, OURS),
    "export.texture_size": ("export_texture_size", 1024, 1024, OURS),
    "export.environment_height": ("export_environment_height", 128, 128, OURS),
}

# Where preset `fast` differs from `cpu`.
FAST = {
    "run.preset": "fast", "run.steps": 20000, "run.cuda_graphs": True, "surface.n_levels": 16, "surface.growth": 1.3195079,
    "surface.log2_table_size": 19, "surface.table_dtype": "float16", "mesh.resolution": 192, "mesh.background": True,
    "sampling.initial_rays": 4096, "sampling.max_rays": 16384, "sampling.target_samples": 32768,
    "sampling.grid_resolution": 128, "losses.eikonal_points": 2048, "losses.smoothness_points": 4096,
    "losses.neutral_queries": 1024, "losses.entropy_points": 1024, "optimiser.sparse_steps": True,
    "optimiser.warmup_steps": 200, "export.texture_size": 2048,
}  # fmt: skip

# Numbers whose limits are others than from 0 to 2^24 (integers) or 1e30.
LIMITS = {
    "run.seed": "in [-9223372036854775807, 9223372036854775807]", "run.steps": "in [1, 1000000000]",
    "surface.n_levels": "in [1, 32]", "surface.n_features": "one of 1, 2, 4, 8",
    "surface.base_resolution": "in [1, 4096]", "surface.growth": "in [1, 16]", "surface.log2_table_size": "in [1, 24]",
    "surface.width": "in [1, 1024]", "surface.outputs": "in [1, 1024]", "materials.width": "in [1, 1024]",
    "materials.layers": "in [1, 16]", "materials.min_roughness": "in [0, 1)",
    "light.resolution": "a power of 2 in [16, 1024]", "light.width": "in [1, 1024]", "light.layers": "in [1, 16]",
    "light.direction_frequencies": "in [1, 32]", "light.roughness_frequencies": "in [1, 32]",
    "occlusion.channels": "one of 1, 3", "occlusion.width": "in [1, 1024]", "occlusion.layers": "in [1, 16]",
    "occlusion.environment_height": "in [1, 8192]", "occlusion.directions": "a multiple of 32 in [64, 1024]",
    "occlusion.indirect_every": "in [1, 16777216]", "mesh.resolution": "in [8, 2048]",
    "sampling.initial_rays": "in [1, 1048576]", "sampling.max_rays": "in [1, 1048576]",
    "surface.box": "in (0, 1024]", "surface.sphere_radius": "in [0, 1024]", "occlusion.offset": "in [0, 1024]",
    "sampling.min_step": "in (0, 1024]", "sampling.max_step": "in [0, 1024]", "sampling.min_transmittance": "in [0, 1)",
    "occlusion.rays": "in [1, 16777216]", "sampling.target_samples": "in [1, 16777216]",
    "sampling.max_samples_per_ray": "in [1, 16777216]", "sampling.grid_every": "in [1, 16777216]",
    "losses.light_samples": "in [2, 16777216]", "losses.light_queries": "in [1, 16777216]",
    "losses.light_every": "in [1, 16777216]", "losses.light_lobe_samples": "in [1, 16777216]",
    "sampling.min_weight": "in [0, 1)", "sampling.shades_per_ray": "in [0, 1024]",
    "sampling.grid_resolution": "in [1, 512]", "losses.entropy_points": "in [1, 65536]",
    "losses.albedo_width": "in (0, 1e+30]", "losses.gloss_width": "in (0, 1e+30]",
    "losses.neutral_queries": "in [1, 1048576]", "losses.smoothness_points": "in [1, 1048576]",
    "losses.eikonal_points": "in [0, 1048576]", "losses.edge_pixels": "in [0, 64]",
    "optimiser.light_step_every": "in [1, 64]", "refinement.share": "in [0, 1)",
    "separation.share": "in (0, 1)", "separation.steps": "in [1, 16777216]",
    "refinement.sweeps": "in [1, 16777216]", "export.resolution": "in [8, 4096]",
    "export.texture_size": "in [8, 32768]", "export.environment_height": "in [1, 8192]",
}  # fmt: skip
CHOICES = {
    "data.eval_mode": "auto, all, fraction, filename", "data.mask_kind": "auto, object, ignore",
    "exposure.refine": "auto, yes, no", "surface.table_dtype": "float32, float16, bfloat16",
    "surface.normals": "analytic, finite_difference", "materials.inputs": "outputs, grid", "light.kind": "mlp, pyramid",
    "light.activation": "softplus, exp", "shading.method": "split, summed", "shading.fresnel": "exact, paper, code",
    "shading.query": "mean, reflection", "shading.compositing": "linear, srgb", "occlusion.kind": "mlp, bits, off",
    "occlusion.ray_start": "normal, ray", "sampling.occupancy": "distance, average",
    "losses.light_set": "fibonacci, uniform, uniform_and_queries",
    **dict.fromkeys(["losses.light_form", "losses.occlusion_form", "losses.metal_form"], "square, smooth_l1"),
}  # fmt: skip

# By unit: the settings that have it.
UNITS = {
    "GB": "data.max_memory",
    "steps": "run.steps occlusion.indirect_every sampling.grid_every losses.light_every optimiser.light_step_every "
    "optimiser.warmup_steps separation.steps refinement.sweeps",
    "share of the run": "run.preview_every surface.levels_open_by surface.cos_anneal_by mesh.every sampling.hull_until "
    "losses.priors_from separation.share refinement.share",
    "minutes": "run.max_minutes run.checkpoint_minutes",
    "scene units": "surface.box surface.sphere_radius occlusion.offset sampling.min_step sampling.max_step "
    "losses.smoothness_radius",
    "cells": "surface.base_resolution sampling.grid_resolution",
    "nodes": "mesh.resolution export.resolution",
    "texels": "light.resolution occlusion.environment_height export.texture_size export.environment_height",
    "triangles": "export.faces",
    "rays": "occlusion.rays sampling.initial_rays sampling.max_rays",
    "samples": "sampling.target_samples sampling.max_samples_per_ray sampling.shades_per_ray",
    "points": "losses.entropy_points losses.smoothness_points losses.eikonal_points",
    "normals": "losses.neutral_queries", "pixels": "losses.edge_pixels",
    "directions": "occlusion.directions losses.light_samples losses.light_queries losses.light_lobe_samples",
    "share of the samples": "occlusion.share",
    "share of the directions": "occlusion.open_below",
    "share of the rays": "sampling.foreground_share",
}  # fmt: skip


def values(config: Config) -> dict[str, object]:
    return {
        f"{group}.{key}": value for group, table in dataclasses.asdict(config).items() for key, value in table.items()
    }


def check_same(found: dict[str, object], expected: dict[str, object]) -> None:
    assert found == expected
    assert {name: type(value) for name, value in found.items()} == {name: type(v) for name, v in expected.items()}


def test_presets_hold_the_numbers_of_the_tables():
    check_same(values(Config()), {name: row[1] for name, row in SETTINGS.items()})
    check_same(values(preset("cpu")), values(Config()))
    check_same(values(preset("paper")), {name: row[2] for name, row in SETTINGS.items()})
    check_same(values(preset("fast")), values(Config()) | FAST)
    with pytest.raises(InputError, match="unknown preset 'gpu'; there are cpu, fast, paper"):
        preset("gpu")


@pytest.mark.parametrize("name", FIELDS)
def test_every_setting_is_described(name):
    known = FIELDS[name]
    assert set(known.metadata) == {"meaning", "unit", "limits"}
    meaning, limits = known.metadata["meaning"], known.metadata["limits"]
    assert len(meaning) > 8 and not meaning.endswith(".") and "\n" not in meaning
    assert known.type == type(known.default).__name__ and limits.allow(known.default)
    largest = {"int": 1 << 24, "float": "1e+30"}.get(known.type)
    choices = f"one of {CHOICES[name]}" if name in CHOICES else ""
    assert str(limits) == LIMITS.get(name, choices if largest is None else f"in [0, {largest}]")
    assert known.metadata["unit"] == "" or known.type in ("int", "float")


def test_a_bound_that_is_excluded_is_the_one_that_is_named():
    limits = setting(1.0, "ratio of two lengths", above=0.5, at_most=2).metadata["limits"]
    assert str(limits) == "in (0.5, 2]" and [limits.allow(x) for x in (0.25, 0.5, 0.75, 2.0, 2.25)] == [0, 0, 1, 1, 0]


def test_units_are_those_of_the_table():
    found = {name: known.metadata["unit"] for name, known in FIELDS.items() if known.metadata["unit"]}
    assert found == {name: unit for unit, names in UNITS.items() for name in names.split()}


def test_every_group_says_what_it_holds():
    assert list(GROUPS) == list(dict.fromkeys(name.split(".")[0] for name in SETTINGS))
    for kind in GROUPS.values():
        assert kind.__doc__.strip() and not kind.__doc__.startswith(kind.__name__ + "(")


def test_old_names_and_new_ones_belong_together_one_by_one():
    assert OLD_NAMES == {row[0]: name for name, row in SETTINGS.items()}
    assert len(OLD_NAMES) == len(SETTINGS) == len(FIELDS)
    config = preset("paper")
    for name, (old, _, value, _) in SETTINGS.items():
        assert config[name] == config[old] == value
        split = {"shading.method": "split"}  # goes with all others
        assert Config().replace({old: value} | split) == Config().replace({name: value} | split)


def test_settings_change_by_old_name_by_new_one_and_by_group():
    changed = Config().replace(
        {"light_resolution": 64, "losses.eikonal_weight": 2.0, "export": {"faces": 7, "resolution": 9}}
    )
    check_same(values(changed), values(Config()) | {
        "light.resolution": 64, "losses.eikonal_weight": 2.0, "export.faces": 7, "export.resolution": 9,
    })  # fmt: skip
    assert Config().light.resolution == 128
    # The last one counts, whatever it is called by.
    assert Config().replace({"n_levels": 5, "surface": {"n_levels": 6}}).surface.n_levels == 6
    assert Config().replace({"surface": {"n_levels": 6}, "n_levels": 5}).surface.n_levels == 5
    # What shares its name with a group: a table is the group's, a word the old setting's.
    assert Config().replace({"light": "mlp"}) == Config().replace({"light": {"kind": "mlp"}})
    assert Config().replace({}) == Config()
    # What was changed before stays, in the same group and in others.
    again = preset("paper").replace({"surface.n_levels": 5})
    check_same(values(again), values(preset("paper")) | {"surface.n_levels": 5})


def test_settings_cannot_change_in_place():
    config = Config()
    firsts = ((getattr(config, group), dataclasses.fields(kind)[0].name) for group, kind in GROUPS.items())
    for owner, name in ((config, "run"), *firsts):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(owner, name, 1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"surface.n_levls": 4}, "unknown setting 'surface.n_levls'; did you mean surface.n_levels? "),
        ({"light_resolutoin": 4}, "unknown setting 'light_resolutoin'; did you mean light.resolution? "),
        ({"sdf_widht": 4}, "unknown setting 'sdf_widht'; did you mean surface.width? "),
        ({"export": {"face": 4}}, "unknown setting 'export.face'; did you mean export.faces? "),
        ({"zzz": 4}, "unknown setting 'zzz'; `splitnerf info --settings` lists them"),
        ({3: 4}, "unknown setting 3; "),
        ({"losses": 4}, "losses is a group of settings; set one of them, such as losses.colour_weight"),
        ({"light": 4}, "light.kind takes a value of type str, got 4"),
        ({"surface.n_levels": "many"}, "surface.n_levels takes a value of type int, got 'many'"),
        ({"n_levels": 4.0}, "surface.n_levels takes a value of type int, got 4.0"),
        ({"n_levels": True}, "surface.n_levels takes a value of type int, got True"),
        ({"box": True}, "surface.box takes a value of type float, got True"),
        ({"indirect": 1}, "occlusion.indirect takes a value of type bool, got 1"),
        ({"light": {"resolution": {"x": 1}}}, "light.resolution takes a value of type int, got {'x': 1}"),
        ({"optimiser.weight_decay": math.nan}, "optimiser.weight_decay must be in [0, 1e+30], got nan"),
        ({"optimiser.weight_decay": math.inf}, "optimiser.weight_decay must be in [0, 1e+30], got inf"),
        ({"optimiser.weight_decay": 10**40}, "optimiser.weight_decay must be in [0, 1e+30], got 1000"),
        ({"optimiser.weight_decay": -0.1}, "optimiser.weight_decay must be in [0, 1e+30], got -0.1"),
        ({"box": 0}, "surface.box must be in (0, 1024], got 0.0"),
        ({"min_step": 0, "max_step": 0}, "sampling.min_step must be in (0, 1024], got 0.0"),
        ({"min_transmittance": 1}, "sampling.min_transmittance must be in [0, 1), got 1.0"),
        ({"occlusion_offset": 1e19}, "occlusion.offset must be in [0, 1024], got 1e+19"),
        ({"sphere_radius": 1e30}, "surface.sphere_radius must be in [0, 1024], got 1e+30"),
        ({"light": "mlp", "light_samples": 1}, "losses.light_samples must be in [2, 16777216], got 1"),
        ({"growth": 16.0, "n_levels": 32}, "a level of the hash grid needs fewer than 1073741824 cells"),
        ({"export.faces": -1}, "export.faces must be in [0, 16777216], got -1"),
        ({"export.faces": 16777217}, "export.faces must be in [0, 16777216], got 16777217"),
        ({"surface.n_levels": 0}, "surface.n_levels must be in [1, 32], got 0"),
        ({"surface.n_levels": 33}, "surface.n_levels must be in [1, 32], got 33"),
        ({"surface.growth": 0.99}, "surface.growth must be in [1, 16], got 0.99"),
        ({"losses.albedo_width": 0.0}, "losses.albedo_width must be in (0, 1e+30], got 0.0"),
        ({"sampling.min_weight": 1.0}, "sampling.min_weight must be in [0, 1), got 1.0"),
        ({"surface.n_features": 3}, "surface.n_features must be one of 1, 2, 4, 8, got 3"),
        ({"light.kind": "cube"}, "light.kind must be one of mlp, pyramid, got 'cube'"),
        ({"light.resolution": 48}, "light.resolution must be a power of 2 in [16, 1024], got 48"),
        ({"light.resolution": 8}, "light.resolution must be a power of 2 in [16, 1024], got 8"),
        ({"light.resolution": 2048}, "light.resolution must be a power of 2 in [16, 1024], got 2048"),
        ({"occlusion.directions": 250}, "occlusion.directions must be a multiple of 32 in [64, 1024], got 250"),
        ({"occlusion.directions": 32}, "occlusion.directions must be a multiple of 32 in [64, 1024], got 32"),
        ({"occlusion.kind": "off"}, "shading.method = summed needs"),
        ({"shading.compositing": "srgb"}, "shading.method = summed needs"),
        ({"shading.fresnel": "code"}, "shading.method = summed needs"),
        (
            {"occlusion.directions": 224},
            "shading.method = summed needs occlusion.kind = bits with at least 256 occlusion.directions",
        ),
        ({"run.deterministic": True, "run.max_minutes": 1.0}, "a deterministic run ends by its steps alone; "),
        ({"run.cuda_graphs": True, "light.kind": "mlp"}, "run.cuda_graphs needs"),
        ({"run.cuda_graphs": True, "surface.normals": "finite_difference"}, "run.cuda_graphs needs"),
        ({"run.cuda_graphs": True, "losses.entropy_points": 1}, "run.cuda_graphs needs"),
        ({"run.cuda_graphs": True, "shading.method": "split", "occlusion.kind": "mlp"}, "run.cuda_graphs needs"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(settings, message):
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        Config().replace(settings)
    assert str(caught.value).startswith(message) and len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("settings", [
    {"surface.box": 2}, {"occlusion.directions": 1024}, {"light.resolution": 1024}, {"light.resolution": 16},
    {"surface.n_levels": 1}, {"surface.n_levels": 32}, {"sampling.min_weight": 0.0}, {"run.seed": -5},
    {"surface.growth": 1.0}, {"run.cuda_graphs": True}, {"run.deterministic": True}, {"run.max_minutes": 1.0},
    {"run.cuda_graphs": True, "shading.method": "split", "occlusion.kind": "off"},
    {"shading.method": "split", "occlusion.kind": "bits", "occlusion.directions": 64, "shading.fresnel": "code"},
])  # fmt: skip
def test_what_can_be_is_taken(settings):
    assert {name: Config().replace(settings)[name] for name in settings} == settings


def test_a_group_is_no_word():
    with pytest.raises(InputError, match="light is a group of settings, got 'cube'"):
        Config(light="cube")


def setting_values(name: str) -> st.SearchStrategy:
    """All values of a setting, but for rules that join several."""
    known, limits = FIELDS[name], FIELDS[name].metadata["limits"]
    if limits.choices:
        return st.sampled_from(limits.choices)
    if known.type == "bool":
        return st.booleans()
    if known.type == "str":
        return st.text(st.characters(exclude_categories=("Cs",)), max_size=8)
    if known.type == "float":
        return st.floats(limits.low, limits.high, exclude_min=limits.without_low, exclude_max=limits.without_high)
    if limits.power_of_2:
        return st.sampled_from([16, 64, 1024])
    unit = limits.multiple_of or 1
    return st.integers(-(-limits.low // unit), limits.high // unit).map(lambda n: n * unit)


@examples(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.fixed_dictionaries({}, optional={name: setting_values(name) for name in FIELDS}))
def test_all_settings_survive_their_file_and_their_checkpoint(tmp_path_factory, settings):
    try:
        config = Config().replace(settings)
    except InputError as error:
        assert " needs " in str(error) or "deterministic run" in str(error)  # by rules that join settings alone
        assume(False)
    path = tmp_path_factory.getbasetemp() / "settings.toml"
    config.write(path)
    for again in (Config.read(path), config_of({"config": dataclasses.asdict(config)})):
        assert again == config
        check_same(values(again), values(config))


def test_the_file_has_a_table_for_each_group(tmp_path):
    path = tmp_path / "config.toml"
    preset("paper").write(path)
    table = tomllib.loads(path.read_text())
    assert list(table) == list(GROUPS) and table["surface"]["n_levels"] == 16
    path.write_text('seed = 3\nlight = "mlp"\nlight_width = 32\n')  # as before there were groups
    assert Config.read(path) == Config().replace({"run.seed": 3, "light.kind": "mlp", "light.width": 32})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("steps = [", "not a readable run configuration"),
        (b"\xff", "not a readable run configuration"),
        (f"steps = {'1' * 5000}", "not a readable run configuration"),
        ("[surface]\nn_levels = 0", "surface.n_levels must be in"),
        ("[nothing]\nn = 0", "unknown setting 'nothing'"),
    ],
)
def test_files_that_hold_no_settings_are_named(tmp_path, text, message):
    path = tmp_path / "config.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=f"config.toml: {message}"):
        Config.read(path)
    with pytest.raises(InputError, match="nowhere.toml: not a readable"):
        Config.read(tmp_path / "nowhere.toml")


def test_settings_as_they_are_typed():
    typed = {
        "n_levels=4": ("surface.n_levels", 4), "surface.n_levels = 4": ("surface.n_levels", 4),
        "box=2.5": ("surface.box", 2.5), "light=mlp": ("light.kind", "mlp"), 'light="mlp"': ("light.kind", "mlp"),
        "indirect=false": ("occlusion.indirect", False), "light={width=8}": ("light", {"width": 8}),
        "no_such=1": ("no_such", 1), "query=": ("shading.query", ""),
        f"n_levels={'1' * 5000}": ("surface.n_levels", "1" * 5000),  # more digits than Python makes a number of
    }  # fmt: skip
    for text, expected in typed.items():
        name, value = parse_setting(text)
        assert (name, value) == expected and type(value) is type(expected[1]), text
    # Old name and new one are one setting, so that of two the last counts.
    assert dict(map(parse_setting, ["surface.n_levels=4", "n_levels=5"])) == {"surface.n_levels": 5}
    for text, message in (("n_levels", "takes key=value"), ("=4", "takes key=value"), ('n_levels="\n', "cannot read")):
        with pytest.raises(InputError, match=message):
            parse_setting(text)


def test_the_table_lists_every_setting_under_its_group(capsys):
    assert main(["info", "--settings", "paper"]) == DONE
    text = capsys.readouterr().out
    assert text.strip() == settings_table(preset("paper"))
    titles = [(group, kind.__doc__.splitlines()[0]) for group, kind in GROUPS.items()]
    assert re.findall(r"^\[(\w+)\] (.+)$", text, re.M) == titles
    lines = [line for line in text.splitlines() if line and not line.startswith("[")]
    assert [line.split(" = ")[0] for line in lines] == list(FIELDS)
    assert "run.steps = 20000 " in text and "shading.compensate = false " in text and " one of mlp, bits, off " in text
    starts = {line.index(FIELDS[line.split(" = ")[0]].metadata["meaning"]) for line in lines}
    assert len(starts) == 1
    for line in lines:
        name, value = line.split("  ")[0].strip().split(" = ")
        known = FIELDS[name].metadata
        assert value == str(SETTINGS[name][2]).lower()
        columns = f"{name} = {value}", str(known["limits"]).removeprefix("in "), known["unit"], known["meaning"]
        assert re.split(" {2,}", line) == [column for column in columns if column]


def test_a_whole_number_is_one_of_a_float():
    """As `--set initial_variance=10` gives it; a float that is none otherwise stays away from torch."""
    config = Config().replace({"initial_variance": 10, "losses": {"colour_weight": 3}})
    check_same(values(config), values(Config()) | {"surface.initial_variance": 10.0, "losses.colour_weight": 3.0})
