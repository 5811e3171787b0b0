"""The presets, and settings as they are typed."""

from __future__ import annotations

from splitnerf.config.settings import SHORT_NAMES, Config, tomllib
from splitnerf.errors import InputError

# The paper's settings, or those of its released code, where they state them, and ours where they do not:
# tests/python/test_config.py names the source of most of theirs. Shares of the run stand for 20,000 steps.
PAPER = dict(
    run=dict(preset="paper", steps=20000),
    surface=dict(
        n_levels=16, growth=1.3195079, least_cell=0.0, log2_table_size=19, start="sphere", normals="finite_difference"
    ),
    materials=dict(inputs="outputs"),
    light=dict(kind="mlp"),
    shading=dict(method="split", fresnel="paper", query="reflection", compensate=False, compositing="srgb"),
    occlusion=dict(kind="mlp", channels=1, indirect=False),
    mesh=dict(resolution=512, background=True),
    sampling=dict(target_samples=262144, min_weight=0.0, occupancy="average", grid_resolution=128, pixel_cells=0.0),
    losses=dict(
        colour_weight=10.0,
        eikonal_weight=0.1,
        light_weight=10.0,
        occlusion_weight=0.01,
        metal_weight=0.001,
        mask_weight=0.0,
        # beyond the paper
        edge_pixels=0,
        neutral_weight=0.0,
        light_prior_weight=0.0,
        seen_weight=0.0,
        entropy_weight=0.0,
        dark_metal_weight=0.0,
        smoothness_weight=0.0,
    ),
    refinement=dict(enabled=False),
    export=dict(resolution=512),
    constants=dict(
        base_resolution=32,
        levels_open_by=0.6,
        sphere_radius=0.5,
        cos_anneal_by=1.0,
        materials_width=256,
        initial_roughness=0.5,
        min_roughness=0.0,
        light_width=256,
        light_layers=5,
        direction_frequencies=10,
        roughness_frequencies=5,
        light_activation="softplus",
        occlusion_width=256,
        occlusion_rays=64,
        occlusion_environment_height=128,
        initial_rays=256,
        step_scale=0.0,
        min_step=3**0.5 * 3 / 1024,
        min_transmittance=0.0,
        shades_per_ray=0,
        grid_every=16,
        foreground_share=0.0,
        shape_priors_until=1.0,
        light_form="square",
        light_set="uniform",
        light_samples=8129,
        light_queries=8129,
        light_lobe_below=0.0,
        eikonal_points=0,
        warmup_steps=500,
        final_learning_rate=0.1,
    ),
)

# The CPU's method with the samples, the levels (16 to 1024 cells) and the meshes of a GPU.
FAST = dict(
    run=dict(preset="fast", steps=20000, cuda_graphs=True),
    surface=dict(n_levels=16, growth=1.3195079, least_cell=0.0, log2_table_size=19, table_dtype="float16"),
    mesh=dict(resolution=192, background=True),
    sampling=dict(max_rays=16384, target_samples=32768, grid_resolution=128),
    export=dict(texture_size=2048),
    constants=dict(
        initial_rays=4096,
        eikonal_points=2048,
        smoothness_points=4096,
        neutral_queries=1024,
        entropy_points=1024,
        sparse_steps=True,
        warmup_steps=200,
    ),
)

PRESETS: dict[str, dict] = {"cpu": {}, "fast": FAST, "paper": PAPER}


def preset(name: str) -> Config:
    """The settings of a preset. Raises InputError for an unknown name."""
    if name not in PRESETS:
        raise InputError(f"unknown preset {name!r}; there are {', '.join(PRESETS)}")
    return Config().replace(PRESETS[name])


def parse_setting(text: str) -> tuple[str, object]:
    """The name of a setting and its value from ``key=value`` with a TOML value; a bare word counts as a string. Raises
    InputError where the text has another form."""
    key, separator, value = text.partition("=")
    if not separator or not key:
        raise InputError(f"--set takes key=value, got {text!r}")
    for candidate in (value, f'"{value}"'):
        try:
            parsed = tomllib.loads(f"value = {candidate}")["value"]
        except ValueError:
            continue
        name = key.strip()
        return SHORT_NAMES.get(name, name), parsed
    raise InputError(f"--set {key}: cannot read the value {value!r}")
