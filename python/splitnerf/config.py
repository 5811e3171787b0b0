"""Every setting of a training run in one place, its presets, and its TOML form."""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from splitnerf.data.images import atomic_path
from splitnerf.errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


MIN_EXPORT_SIZE = 8  # nodes or texels along an edge
SUMMED_DIRECTIONS = 256  # fewer do not resolve the lobes that `shading = summed` sums
FORMS = ("square", "smooth_l1")
LARGEST_FLOAT = 1e30
LARGEST_INT = 1 << 24  # these have bounds of their own, and are at least 1 but for the seed
LARGEST = dict(
    seed=(1 << 63) - 1, steps=10**9, n_levels=32, n_features=8, base_resolution=4096, log2_table_size=24,
    sdf_width=1024, sdf_outputs=1024, material_width=1024, material_layers=16, occlusion_width=1024,
    occlusion_layers=16, light_width=1024, light_layers=16, light_direction_frequencies=32,
    light_roughness_frequencies=32, max_rays=1 << 20, initial_rays=1 << 20, grid_resolution=512, mesh_resolution=2048,
    export_resolution=4096, export_texture_size=1 << 15, export_environment_height=1 << 13,
    environment_height=1 << 13,
)  # fmt: skip


@dataclass
class Config:
    """Settings of one run. Lengths are in scene units of the box [-1.5, 1.5]^3; fractions are of the whole run.

    The defaults are the preset ``cpu``.
    """

    preset: str = "cpu"
    seed: int = 0
    steps: int = 6000
    max_minutes: float = 0.0  # training time; 0: only the steps count
    deterministic: bool = False  # two runs give the same bits, on one machine with one number of threads
    cuda_graphs: bool = False  # of a GPU: a step's launches are recorded and repeated, and rays change in number seldom
    tensor_cores: bool = True  # of a GPU, for products of matrices: TF32, factors of 10 bits; not where digits cancel
    box: float = 1.5

    # Surface: hash grid, progressive levels, one hidden layer.
    n_levels: int = 9
    n_features: int = 2
    base_resolution: int = 16
    growth: float = 1.4697344922755988  # 16 to 348 cells along an edge
    log2_table_size: int = 16
    table_dtype: str = (
        "float32"  # float32 | float16 | bfloat16: as what the hash table is read; it is trained in float32
    )
    start_levels: int = 4
    levels_open_by: float = 0.4  # the finest level opens at this fraction
    sdf_width: int = 64
    sdf_outputs: int = 13
    sphere_radius: float = 0.7
    normals: str = "analytic"  # analytic | finite_difference
    initial_variance: float = 0.3  # s = exp(10 v)
    cos_anneal_by: float = 0.4

    # Materials, occlusion and light.
    material_width: int = 64
    material_layers: int = 2
    head_inputs: str = "grid"  # outputs: the SDF's outputs (the paper) | grid: the hash features as well
    occlusion: str = "bits"  # mlp | bits (cached on the mesh) | off
    occlusion_channels: int = 3
    occlusion_directional: bool = True  # o_s as a function of the reflection; false: of position alone (the paper)
    occlusion_width: int = 64
    occlusion_layers: int = 2
    initial_roughness: float = 0.3
    min_roughness: float = 0.05  # a narrower lobe is finer than what images of this size resolve
    light: str = "pyramid"  # mlp (the paper) | pyramid
    light_resolution: int = 128  # texels along the edge of the pyramid's map, a power of 2
    light_width: int = 64
    light_layers: int = 3
    light_direction_frequencies: int = 6
    light_roughness_frequencies: int = 3
    light_activation: str = "exp"  # softplus (the paper) | exp
    shading: str = "summed"  # split (the paper) | summed (over the bits' directions, where lobes are wide)
    fresnel_mode: str = "exact"  # exact | paper | code
    query: str = "mean"  # mean | reflection (the paper)
    compensate: bool = True  # multiple-scattering compensation, as Blender has it
    compositing: str = "linear"  # linear | srgb (the paper)

    # Rays and samples.
    initial_rays: int = 1024
    max_rays: int = 8192
    target_samples: int = 4608
    max_samples_per_ray: int = 1024
    step_scale: float = 2.0  # sample length = step_scale / s, between the two bounds below
    min_step: float = 0.01
    max_step: float = 0.04
    min_transmittance: float = 1e-3
    sample_above: float = 1e-3  # samples of less weight are left out; 0 takes all
    shades_per_ray: int = 4  # samples of a ray that are shaded, others interpolate; 0 shades all
    occupancy: str = "distance"  # distance (bounds the density) | average (the paper)
    grid_resolution: int = 96
    grid_every: int = 32
    hull_until: float = 0.1  # the masks' visual hull is sampled until then
    foreground_share: float = 0.85  # of the rays, drawn near the masks

    # Losses.
    colour_weight: float = 10.0
    light_weight: float = 1.0
    occlusion_weight: float = 0.1
    eikonal_weight: float = 3.0
    metal_weight: float = 0.0001
    metal_regulariser: bool = True
    binary_metal_weight: float = 0.003  # of metallic between 0 and 1, from priors_from
    dark_metal_weight: float = 0.002  # of metals that reflect less than any does
    mask_weight: float = 1.0
    neutral_weight: float = 0.03  # of the diffuse light's log chroma
    entropy_weight: float = 0.002  # of the materials' quadratic entropy, from priors_from
    priors_from: float = 0.5  # the fraction of the run at which materials are told apart
    entropy_points: int = 384
    albedo_width: float = 0.6  # log albedos this close count as one
    gloss_width: float = 0.2
    neutral_queries: int = 256
    normal_smoothness: float = 0.01  # of the normals between neighbouring surface points
    smoothness_points: int = 512
    smoothness_radius: float = 0.02  # scene units, one standard deviation
    light_loss_form: str = "smooth_l1"  # square (the paper) | smooth_l1 (the released code)
    occlusion_loss_form: str = "square"  # the same choice
    metal_loss_form: str = "square"  # the same choice
    light_set: str = "fibonacci"  # fibonacci | uniform (the paper) | uniform_and_queries (the released code)
    light_samples: int = 2048  # of the MLP's consistency loss, at most
    light_noise: float = 0.1  # share of that loss's squared error that their noise may make; 0: always light_samples
    light_queries: int = 512
    light_every: int = 1
    light_step_every: int = 4  # steps that share one pass through the pyramid's maps and one step of its texels
    light_lobe_below: float = 0.15  # narrower lobes are sampled exactly
    light_lobe_samples: int = 16
    eikonal_points: int = 256  # uniform in the box, beside the rays' samples

    # Occlusion by tracing the mesh.
    mesh_every: float = 0.1
    mesh_resolution: int = 96
    background_meshes: bool = False  # made by a thread of their own; the training goes on with the old one meanwhile
    occlusion_share: float = 0.1  # of the shaded samples
    occlusion_rays: int = 32
    occlusion_ray_start: str = "normal"  # occlusion_offset along the normal | ray (the released code: along the ray)
    occlusion_offset: float = 0.0125
    environment_height: int = 32
    occlusion_directions: int = 256  # of the bits; a multiple of 32
    open_below: float = (
        0.02  # blocked share of any vertex's directions; where none has more, occlusion is left out; 0: never
    )
    indirect: bool = True  # with bits: light from the object itself
    indirect_every: int = 200  # steps between refreshes of what the mesh sends out

    # Optimiser.
    learning_rate: float = 0.01
    variance_learning_rate: float = 0.001
    light_learning_rate: float = 0.02  # of the pyramid's texels; the MLP has learning_rate
    warmup_steps: int = 100
    final_learning_rate: float = 0.02  # factor at the end
    weight_decay: float = 0.01
    sparse_steps: bool = False  # entries of the hash table that got no gradient are left alone, moments and decay too

    # Output.
    export_resolution: int = 192
    export_faces: int = 20000  # of the textured mesh; 0: all
    export_texture_size: int = 1024
    export_environment_height: int = 128
    preview_every: float = 0.1
    checkpoint_minutes: float = 2.0

    def __post_init__(self) -> None:
        choices = {
            "n_features": (1, 2, 4, 8),
            "table_dtype": ("float32", "float16", "bfloat16"),
            "normals": ("analytic", "finite_difference"),
            "head_inputs": ("outputs", "grid"),
            "occlusion": ("mlp", "bits", "off"),
            "occlusion_channels": (1, 3),
            "light": ("mlp", "pyramid"),
            "light_activation": ("softplus", "exp"),
            "shading": ("split", "summed"),
            "fresnel_mode": ("exact", "paper", "code"),
            "query": ("mean", "reflection"),
            "compositing": ("linear", "srgb"),
            "light_loss_form": FORMS,
            "occlusion_loss_form": FORMS,
            "metal_loss_form": FORMS,
            "light_set": ("fibonacci", "uniform", "uniform_and_queries"),
            "occupancy": ("distance", "average"),
            "occlusion_ray_start": ("normal", "ray"),
        }
        for key, allowed in choices.items():
            if getattr(self, key) not in allowed:
                raise InputError(f"{key} must be one of {', '.join(map(str, allowed))}, got {getattr(self, key)!r}")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.type in ("int", "float") and field.name != "seed" and value < 0:
                raise InputError(f"{field.name} must not be negative, got {value}")
            largest = LARGEST.get(field.name, LARGEST_INT) if field.type == "int" else LARGEST_FLOAT
            if field.type in ("int", "float") and not abs(value) <= largest:  # nor is NaN
                raise InputError(f"{field.name} must be at most {largest}, got {value}")
            if field.name in LARGEST and field.name != "seed" and value < 1:
                raise InputError(f"{field.name} must be at least 1, got {value}")
        for key in ("mesh_resolution", "export_resolution", "export_texture_size"):
            if getattr(self, key) < MIN_EXPORT_SIZE:
                raise InputError(f"{key} must be at least {MIN_EXPORT_SIZE}, got {getattr(self, key)}")
        if not 16 <= self.light_resolution <= 1024 or self.light_resolution & (self.light_resolution - 1):
            raise InputError(f"light_resolution must be a power of 2 in [16, 1024], got {self.light_resolution}")
        if self.shading == "summed" and not (
            self.occlusion == "bits" and self.compositing == "linear" and self.fresnel_mode == "exact"
            and self.occlusion_directions >= SUMMED_DIRECTIONS
        ):  # fmt: skip
            raise InputError(
                "shading = summed needs occlusion = bits with at least 256 occlusion_directions, compositing = linear and "
                "fresnel_mode = exact; set shading=split"
            )
        if self.deterministic and self.max_minutes > 0:
            raise InputError(
                "a deterministic run ends by its steps alone; leave out --max-minutes (max_minutes) and give --steps"
            )
        if self.cuda_graphs and (
            self.occlusion == "mlp" or self.light == "mlp" or self.normals != "analytic"
            or self.entropy_points == 1
        ):  # fmt: skip
            raise InputError(
                "cuda_graphs needs light = pyramid, occlusion = bits or off, normals = analytic and "
                "more than one of entropy_points; set cuda_graphs=false"
            )
        if not 1 <= self.growth <= 16:
            raise InputError(f"growth must be in [1, 16], got {self.growth}")
        if not 0 <= self.min_roughness < 1:
            raise InputError(f"min_roughness must be in [0, 1), got {self.min_roughness}")
        for key in ("entropy_points", "smoothness_points", "neutral_queries", "albedo_width", "gloss_width"):
            if getattr(self, key) <= 0:
                raise InputError(f"{key} must be positive, got {getattr(self, key)}")
        if not 64 <= self.occlusion_directions <= 1024 or self.occlusion_directions % 32:
            raise InputError(
                f"occlusion_directions must be a multiple of 32 in 64 to 1024, got {self.occlusion_directions}"
            )
        if self.indirect_every < 1:
            raise InputError(f"indirect_every must be at least 1, got {self.indirect_every}")
        if not 1 <= self.light_step_every <= 64:
            raise InputError(f"light_step_every must be in 1 to 64, got {self.light_step_every}")
        if self.shades_per_ray > 1024:
            raise InputError(f"shades_per_ray must be at most 1024, got {self.shades_per_ray}")
        if self.sample_above >= 1:
            raise InputError(f"sample_above must be in [0, 1), got {self.sample_above}")

    def replace(self, settings: dict[str, object]) -> Config:
        """A copy with some settings changed. Unknown keys and values of another type raise InputError."""
        known = {f.name: f.type for f in dataclasses.fields(self)}
        for key, value in settings.items():
            if key not in known:
                raise InputError(f"unknown setting {key!r}; `splitnerf info --settings` lists them")
            if type(value).__name__ != known[key] and not (known[key] == "float" and type(value) is int):
                raise InputError(f"setting {key} takes a {known[key]}, got {value!r}")
        return dataclasses.replace(self, **settings)

    def write(self, path: Path) -> None:
        with atomic_path(path) as temporary:
            temporary.write_text(tomli_w.dumps(dataclasses.asdict(self)))

    @staticmethod
    def read(path: Path) -> Config:
        try:
            table = tomllib.loads(path.read_text())
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(f"{path}: not a readable run configuration ({error})") from error
        return Config().replace(table)

# Section 4 and supplement of the paper; fractions stand for 20,000 steps.
PAPER = dict(
    preset="paper", light="mlp", occlusion="mlp", shading="split", occlusion_channels=1, indirect=False,
    # beyond the paper
    neutral_weight=0.0, entropy_weight=0.0, binary_metal_weight=0.0, dark_metal_weight=0.0, normal_smoothness=0.0,
    # the scene
    steps=20000, n_levels=16, base_resolution=32, growth=1.3195079, log2_table_size=19, start_levels=4, levels_open_by=0.6,
    sphere_radius=0.5, normals="finite_difference", cos_anneal_by=1.0, material_width=256, initial_roughness=0.5,
    min_roughness=0.0, head_inputs="outputs", occlusion_directional=False, occlusion_width=256, light_width=256,
    light_layers=5, light_direction_frequencies=10, light_roughness_frequencies=5, light_activation="softplus",
    fresnel_mode="paper", query="reflection", compensate=False, compositing="srgb",
    # rays and samples
    initial_rays=256, target_samples=262144, step_scale=0.0, min_step=3**0.5 * 3 / 1024, min_transmittance=0.0,
    sample_above=0.0, shades_per_ray=0, occupancy="average", grid_resolution=128, grid_every=16, hull_until=0.0, foreground_share=0.0,
    # losses
    eikonal_weight=0.1, light_weight=10.0, occlusion_weight=0.01, metal_weight=0.001, mask_weight=0.0,
    light_loss_form="square", light_set="uniform", light_samples=8129, light_noise=0.0, light_queries=8129, light_lobe_below=0.0,
    eikonal_points=0, mesh_resolution=512, occlusion_rays=64, environment_height=128, warmup_steps=500,
    final_learning_rate=0.1, export_resolution=512,
)  # fmt: skip

# The CPU's method with the samples, the levels and the meshes of a GPU.
FAST = dict(
    preset="fast", steps=20000, n_levels=16, growth=1.3195079, log2_table_size=19,  # 16 to 1024 cells along an edge
    initial_rays=4096, max_rays=16384, target_samples=32768, grid_resolution=128, eikonal_points=2048,
    smoothness_points=4096, neutral_queries=1024, entropy_points=1024, mesh_resolution=192, background_meshes=True,
    table_dtype="float16", sparse_steps=True, warmup_steps=200, export_resolution=384, export_faces=50000, export_texture_size=2048,
)  # fmt: skip

PRESETS: dict[str, dict] = {"cpu": {}, "fast": FAST, "paper": PAPER}


def preset(name: str) -> Config:
    """The settings of a preset. Raises InputError for an unknown name."""
    if name not in PRESETS:
        raise InputError(f"unknown preset {name!r}; there are {', '.join(PRESETS)}")
    return Config().replace(PRESETS[name])


def parse_setting(text: str) -> tuple[str, object]:
    """``key=value`` with a TOML value; a bare word counts as a string. Raises InputError."""
    key, separator, value = text.partition("=")
    if not separator or not key:
        raise InputError(f"--set takes key=value, got {text!r}")
    for candidate in (value, f'"{value}"'):
        try:
            return key.strip(), tomllib.loads(f"value = {candidate}")["value"]
        except tomllib.TOMLDecodeError:
            continue
    raise InputError(f"--set {key}: cannot read the value {value!r}")
