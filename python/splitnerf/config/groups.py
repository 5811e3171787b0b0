"""The groups of settings. The defaults are the preset ``cpu``.

Lengths are in scene units of the box [-1.5, 1.5]^3; times named ``_by``, ``_until`` and ``_from`` are shares of the
whole run, from 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass

from splitnerf.config.setting import setting
from splitnerf.data.reading import EVAL_MODES, MASK_KINDS

MIN_EXPORT_SIZE = 8  # nodes or texels along an edge
LOSS_FORMS = ("square", "smooth_l1")
LARGEST_SEED = (1 << 63) - 1
FARTHEST = 1024.0  # scene units; the object is about two of them wide


@dataclass(frozen=True)
class Run:
    """How long a run takes, what it repeats, what it keeps while it goes on."""

    preset: str = setting("cpu", "name of the preset that the settings started from")
    seed: int = setting(0, "seed of all random numbers", at_least=-LARGEST_SEED, at_most=LARGEST_SEED)
    steps: int = setting(6000, "optimiser steps of the whole run", unit="steps", at_least=1, at_most=10**9)
    max_minutes: float = setting(0.0, "time of training and refinement; 0: steps and sweeps end them", unit="minutes")
    deterministic: bool = setting(False, "the same bits in two runs on one machine with one number of threads")
    cuda_graphs: bool = setting(False, "a GPU's launches of a step recorded and repeated; rays change in number seldom")
    tensor_cores: bool = setting(
        True, "TF32 (factors of 10 bits) for a GPU's products of matrices, but where digits cancel"
    )
    preview_every: float = setting(0.1, "time between two previews", unit="share of the run")
    checkpoint_minutes: float = setting(2.0, "time between two checkpoints", unit="minutes")


@dataclass(frozen=True)
class Data:
    """How the photos are read where they leave it open."""

    eval_mode: str = setting(
        "auto", "what is held out for testing; auto: what the data say, else a fraction", choices=EVAL_MODES
    )
    mask_kind: str = setting(
        "auto", "mask files: white is the object, or black is to be ignored; auto: as they look", choices=MASK_KINDS
    )
    max_memory: float = setting(
        0.0, "memory that the photos may take, more are read from a file; 0: half of what is available", unit="GB"
    )


@dataclass(frozen=True)
class Exposure:
    """How bright the photos are beside each other."""

    refine: str = setting(
        "auto",
        "whether each photo's exposure is learned; auto: of photos that cameras wrote, which are JPEG or state exposures",
        choices=("auto", "yes", "no"),
    )  # fmt: skip
    white_balance: bool = setting(False, "whether each channel has an exposure of its own")


@dataclass(frozen=True)
class Separation:
    """How the object is found in photos that have no masks."""

    share: float = setting(0.15, "part of run.max_minutes that it takes", unit="share of the run", above=0, below=1)
    steps: int = setting(6000, "optimiser steps where no minutes end the run", unit="steps", at_least=1)


@dataclass(frozen=True)
class Surface:
    """The signed distance field: a hash grid whose levels open one by one, and a network of one hidden layer."""

    box: float = setting(1.5, "half the edge of the scene's box", unit="scene units", above=0, at_most=FARTHEST)
    n_levels: int = setting(9, "levels of the hash grid", at_least=1, at_most=32)
    n_features: int = setting(2, "features of a level", choices=(1, 2, 4, 8))
    base_resolution: int = setting(
        16, "cells along an edge on the coarsest level", unit="cells", at_least=1, at_most=4096
    )
    growth: float = setting(
        1.4697344922755988, "factor of cells from level to level (16 to 348 by default)", at_least=1, at_most=16
    )
    log2_table_size: int = setting(
        16, "binary logarithm of the entries of a level's hash table", at_least=1, at_most=24
    )
    table_dtype: str = setting(
        "float32", "numbers as which the hash table is read; it is trained in float32",
        choices=("float32", "float16", "bfloat16"),
    )  # fmt: skip
    start_levels: int = setting(4, "levels that are open from the start")
    levels_open_by: float = setting(0.4, "time at which the finest level opens", unit="share of the run")
    width: int = setting(64, "neurons of the hidden layer", at_least=1, at_most=1024)
    outputs: int = setting(13, "outputs of the network, the distance among them", at_least=1, at_most=1024)
    start: str = setting(
        "stereo", "shape that training starts from; stereo: what the photos' depths leave of their visual hull, or a sphere where too few depths are clear; sphere: the paper",
        choices=("stereo", "sphere"),
    )  # fmt: skip
    sphere_radius: float = setting(
        0.7, "radius of the sphere that networks start as", unit="scene units", at_most=FARTHEST
    )
    normals: str = setting(
        "analytic", "how the normals are derived from the distance; finite_difference: the paper",
        choices=("analytic", "finite_difference"),
    )  # fmt: skip
    initial_variance: float = setting(0.3, "v at the start, where s = exp(10 v) is the sharpness of the surface")
    cos_anneal_by: float = setting(
        0.4, "time at which alphas follow the true slope of the distance", unit="share of the run"
    )

    @property
    def finest_cells(self) -> float:
        """The cells along an edge of the finest level, which the grid rounds down."""
        return self.base_resolution * self.growth ** (self.n_levels - 1)


@dataclass(frozen=True)
class Materials:
    """The network of albedo, roughness and metallic."""

    width: int = setting(64, "neurons of a hidden layer", at_least=1, at_most=1024)
    layers: int = setting(2, "hidden layers", at_least=1, at_most=16)
    inputs: str = setting(
        "grid", "what the networks of material and occlusion read; outputs: the surface's outputs (the paper); grid: "
        "the hash features as well", choices=("outputs", "grid"),
    )  # fmt: skip
    initial_roughness: float = setting(0.3, "roughness at the start")
    min_roughness: float = setting(
        0.05, "least roughness; a narrower lobe is finer than what images of this size resolve", at_least=0.0, below=1.0
    )


@dataclass(frozen=True)
class Light:
    """The distant light, as texels or as a network."""

    kind: str = setting("pyramid", "how the light is stored; mlp: the paper", choices=("mlp", "pyramid"))
    resolution: int = setting(
        128, "texels along the edge of the pyramid's map", unit="texels", at_least=16, at_most=1024, power_of_2=True
    )
    width: int = setting(64, "neurons of a hidden layer of the MLP", at_least=1, at_most=1024)
    layers: int = setting(3, "hidden layers of the MLP", at_least=1, at_most=16)
    direction_frequencies: int = setting(6, "frequencies of the direction that the MLP reads", at_least=1, at_most=32)
    roughness_frequencies: int = setting(3, "frequencies of the roughness that the MLP reads", at_least=1, at_most=32)
    activation: str = setting("exp", "last function of the MLP; softplus: the paper", choices=("softplus", "exp"))


@dataclass(frozen=True)
class Shading:
    """From material and light to the colour of a pixel."""

    method: str = setting(
        "summed",
        "split: the split sum (the paper); summed: a sum over the directions of the bits, where lobes are wide",
        choices=("split", "summed"),
    )  # fmt: skip
    fresnel: str = setting(
        "exact",
        "form of the Fresnel term; exact: the path tracer's and Blender's, Schlick's for metals and the exact one of "
        "index 1.5 for dielectrics; paper, code: as published, as released",
        choices=("exact", "paper", "code"),
    )  # fmt: skip
    query: str = setting(
        "mean", "direction asked of the light: the lobe's mean, or the reflection (the paper)",
        choices=("mean", "reflection"),
    )  # fmt: skip
    compensate: bool = setting(True, "compensation of multiple scattering, as Blender has it")
    compositing: str = setting(
        "linear", "space in which samples are added; srgb: the paper", choices=("linear", "srgb")
    )


@dataclass(frozen=True)
class Occlusion:
    """What the object hides of the light, and what it reflects onto itself."""

    kind: str = setting(
        "bits", "mlp: a network that learns traced factors (the paper); bits: visibility cached on the mesh; off: none",
        choices=("mlp", "bits", "off"),
    )  # fmt: skip
    channels: int = setting(3, "colours that factors are told apart for; 1: their mean (the paper)", choices=(1, 3))
    directional: bool = setting(
        True, "specular factor as a function of the reflection; false: of position alone (the paper)"
    )
    width: int = setting(64, "neurons of a hidden layer of the MLP", at_least=1, at_most=1024)
    layers: int = setting(2, "hidden layers of the MLP", at_least=1, at_most=16)
    share: float = setting(0.1, "share of the shaded samples whose factors the MLP learns", unit="share of the samples")
    rays: int = setting(32, "rays for each of the two factors of a sample that the MLP learns", unit="rays", at_least=1)
    ray_start: str = setting(
        "normal", "direction of the offset: along the normal, or along the ray (the released code)",
        choices=("normal", "ray"),
    )  # fmt: skip
    offset: float = setting(
        0.0125, "distance from the surface at which occlusion rays start", unit="scene units", at_most=FARTHEST
    )
    environment_height: int = setting(
        32, "rows of the light's image that weighs the MLP's rays", unit="texels", at_least=1, at_most=1 << 13
    )
    directions: int = setting(
        256, "directions of the bits of a vertex", unit="directions", at_least=64, at_most=1024, multiple_of=32
    )
    open_below: float = setting(
        0.02, "blocked share of directions; where no vertex has more, occlusion is left out; 0: never",
        unit="share of the directions",
    )  # fmt: skip
    indirect: bool = setting(True, "light from the object itself, with bits")
    indirect_every: int = setting(
        200, "steps between refreshes of the light that the mesh sends out", unit="steps", at_least=1
    )


@dataclass(frozen=True)
class Mesh:
    """The mesh that occlusion is traced on while training."""

    every: float = setting(0.1, "time between two meshes", unit="share of the run")
    resolution: int = setting(
        96, "nodes of marching cubes along an edge", unit="nodes", at_least=MIN_EXPORT_SIZE, at_most=2048
    )
    background: bool = setting(
        False, "meshes made by a thread of their own, while training goes on with the one before"
    )


@dataclass(frozen=True)
class Sampling:
    """Rays, the samples along them, and the grid of cells that holds them."""

    initial_rays: int = setting(1024, "rays of the first step", unit="rays", at_least=1, at_most=1 << 20)
    max_rays: int = setting(8192, "most rays of a step", unit="rays", at_least=1, at_most=1 << 20)
    target_samples: int = setting(4608, "samples of a step that the number of rays aims at", unit="samples", at_least=1)
    max_samples_per_ray: int = setting(1024, "most samples of a ray", unit="samples", at_least=1)
    step_scale: float = setting(2.0, "length of a sample times s, between min_step and max_step")
    min_step: float = setting(0.01, "least length of a sample", unit="scene units", above=0, at_most=FARTHEST)
    max_step: float = setting(0.04, "largest length of a sample", unit="scene units", at_most=FARTHEST)
    min_transmittance: float = setting(1e-3, "transmittance at which a ray ends", below=1.0)
    min_weight: float = setting(1e-3, "weight below which samples are left out; 0 takes all", at_least=0.0, below=1.0)
    shades_per_ray: int = setting(
        4, "samples of a ray that are shaded, others interpolate; 0 shades all", unit="samples", at_most=1024
    )
    occupancy: str = setting(
        "distance", "how cells are told empty: distance bounds the density; average: a mean over time (the paper)",
        choices=("distance", "average"),
    )  # fmt: skip
    grid_resolution: int = setting(
        96, "cells of the occupancy grid along an edge", unit="cells", at_least=1, at_most=512
    )
    grid_every: int = setting(32, "steps between refreshes of the occupancy grid", unit="steps", at_least=1)
    hull_until: float = setting(0.1, "time until which the masks' visual hull is sampled", unit="share of the run")
    pixel_cells: float = setting(
        0.6, "width up to which training averages the pixels of large photos, in cells of the finest level; 0: no averages",
        at_most=1024,
    )  # fmt: skip
    foreground_share: float = setting(0.85, "share of the rays that are drawn near the masks", unit="share of the rays")


@dataclass(frozen=True)
class Losses:
    """Weights of the loss's terms, and what these terms compare."""

    colour_weight: float = setting(10.0 / 3.0, "weight of the squared error of colours, summed over channels")
    light_weight: float = setting(1.0, "weight of the light's consistency (of the MLP)")
    occlusion_weight: float = setting(0.1, "weight of the traced occlusion factors (of the MLP)")
    eikonal_weight: float = setting(0.3, "weight of |gradient of the distance| = 1")
    metal_weight: float = setting(0.0001, "weight of metallic squared")
    metal_regulariser: bool = setting(True, "whether that term is used")
    binary_metal_weight: float = setting(0.003, "weight of metallic between 0 and 1, from priors_from")
    dark_metal_weight: float = setting(0.002, "weight of metals that reflect less than any does")
    mask_weight: float = setting(1.0, "weight of the masks")
    edge_pixels: int = setting(
        2, "pixels (of averages, where training draws from these) on each side of a mask's edge that are compared whole, with what lies behind the object; 0: the mask is "
        "exact. Of photos whose masks are files of their own", unit="pixels", at_least=0, at_most=8,
    )  # fmt: skip
    neutral_weight: float = setting(0.03, "weight of the diffuse light's log chroma")
    light_prior_weight: float = setting(0.001, "weight of the distance to a smooth and grey light (of the pyramid)")
    entropy_weight: float = setting(0.002, "weight of the materials' quadratic entropy, from priors_from")
    priors_from: float = setting(0.5, "time from which materials are told apart", unit="share of the run")
    entropy_points: int = setting(384, "surface points of the entropy", unit="points", at_least=1, at_most=1 << 16)
    albedo_width: float = setting(0.6, "distance of log albedos that count as one", above=0)
    gloss_width: float = setting(0.2, "distance of roughness and metallic that count as one", above=0)
    seen_weight: float = setting(0.02, "weight of the distance to the light that photos show around the object")
    neutral_queries: int = setting(
        256, "normals at which the light's chroma is taken", unit="normals", at_least=1, at_most=1 << 20
    )
    smoothness_weight: float = setting(0.01, "weight of how far normals of neighbouring surface points are apart")
    smoothness_points: int = setting(512, "surface points of that term", unit="points", at_least=1, at_most=1 << 20)
    smoothness_radius: float = setting(0.02, "standard deviation of a neighbour's offset", unit="scene units")
    light_form: str = setting(
        "smooth_l1", "error of the light; square: the paper; smooth_l1: the released code", choices=LOSS_FORMS
    )
    occlusion_form: str = setting("square", "error of the occlusion factors, likewise", choices=LOSS_FORMS)
    metal_form: str = setting("square", "error of metallic, likewise", choices=LOSS_FORMS)
    light_set: str = setting(
        "fibonacci",
        "directions of the light's consistency; uniform: the paper; uniform_and_queries: the released code",
        choices=("fibonacci", "uniform", "uniform_and_queries"),
    )  # fmt: skip
    light_samples: int = setting(2048, "most directions of the light's consistency", unit="directions", at_least=2)
    light_noise: float = setting(
        0.1, "share of that term's squared error that its noise may make; 0: always light_samples"
    )
    light_queries: int = setting(512, "directions at which the light is compared", unit="directions", at_least=1)
    light_every: int = setting(1, "steps between two uses of the light's consistency", unit="steps", at_least=1)
    light_lobe_below: float = setting(0.15, "roughness below which a lobe is sampled exactly")
    light_lobe_samples: int = setting(16, "directions of such a lobe", unit="directions", at_least=1)
    eikonal_points: int = setting(
        256, "points of the eikonal term, uniform in the box, beside the rays' samples", unit="points", at_most=1 << 20
    )


@dataclass(frozen=True)
class Optimiser:
    """AdamW and its rates."""

    learning_rate: float = setting(0.01, "rate of all networks and of the hash grid")
    variance_learning_rate: float = setting(0.001, "rate of the surface's sharpness")
    light_learning_rate: float = setting(0.02, "rate of the pyramid's texels; the MLP has learning_rate")
    light_step_every: int = setting(
        4, "steps that share one pass through the pyramid's maps and one step of its texels", unit="steps", at_least=1,
        at_most=64,
    )  # fmt: skip
    warmup_steps: int = setting(100, "steps in which the rates rise", unit="steps")
    final_learning_rate: float = setting(0.02, "factor of the rates at the end")
    weight_decay: float = setting(0.01, "decay of the parameters")
    sparse_steps: bool = setting(
        False, "entries of the hash table without a gradient are left alone, moments and decay too"
    )


@dataclass(frozen=True)
class Refinement:
    """Refinement: the exported asset and its light are fitted to the photos."""

    enabled: bool = setting(True, "whether there is a refinement")
    share: float = setting(
        0.2, "share of run.max_minutes that it gets, training the rest", unit="share of the run", below=1.0
    )
    sweeps: int = setting(16, "Gauss-Newton steps of the refinement where no minutes end it", unit="steps", at_least=1)


@dataclass(frozen=True)
class Export:
    """The files of the finished run."""

    resolution: int = setting(
        384, "nodes of marching cubes along an edge", unit="nodes", at_least=MIN_EXPORT_SIZE, at_most=4096
    )
    faces: int = setting(50000, "triangles of the textured mesh; 0: all", unit="triangles")
    texture_size: int = setting(
        1024, "texels along the edge of a texture", unit="texels", at_least=MIN_EXPORT_SIZE, at_most=8192
    )
    environment_height: int = setting(128, "rows of the light's image", unit="texels", at_least=1, at_most=1 << 13)
