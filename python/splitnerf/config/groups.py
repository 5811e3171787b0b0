"""The groups of settings. The defaults are the preset ``cpu``.

Lengths are in scene units of the box [-1.5, 1.5]^3; times named ``_by``, ``_until`` and ``_from`` are shares of the
whole run, from 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from splitnerf.config.setting import setting
from splitnerf.data.reading import EVAL_MODES, MASK_KINDS

MIN_EXPORT_SIZE = 8  # nodes or texels along an edge
LARGEST_SEED = (1 << 63) - 1
FARTHEST = 1024.0  # scene units; the object is about two of them wide
OF_RUN = "share of the run"


@dataclass(frozen=True)
class RunSettings:
    """Length, reproducibility and saved state of a run."""

    preset: str = setting("cpu", "name of the preset that the settings started from")
    seed: int = setting(0, "seed of all random numbers", at_least=-LARGEST_SEED, at_most=LARGEST_SEED)
    steps: int = setting(6000, "optimiser steps of the whole run", unit="steps", at_least=1, at_most=10**9)
    max_minutes: float = setting(0.0, "time of training and refinement; 0: steps and sweeps end them", unit="minutes")
    deterministic: bool = setting(False, "the same bits in two runs on one machine with one number of threads")
    cuda_graphs: bool = setting(
        False, "launches of a step on a GPU recorded and replayed; the number of rays then changes seldom"
    )
    preview_every: float = setting(0.1, "time between two previews; 1: none before the end", unit=OF_RUN, above=0)
    checkpoint_minutes: float = setting(2.0, "time between two checkpoints", unit="minutes")


@dataclass(frozen=True)
class DataSettings:
    """Reading of the photos, where the data do not state it."""

    eval_mode: str = setting(
        "auto", "what is held out for testing; auto: as the data state, else a fraction", choices=EVAL_MODES
    )
    mask_kind: str = setting(
        "auto", "mask files: white is the object, or black is to be ignored; auto: detected", choices=MASK_KINDS
    )
    max_memory: float = setting(
        0.0, "memory that the photos may take, more are read from a file; 0: half of what is available", unit="GB"
    )


@dataclass(frozen=True)
class ExposureSettings:
    """Relative exposure of the photos."""

    refine: str = setting(
        "auto",
        "whether each photo's exposure is learned; auto: of JPEG files and photos that state exposures",
        choices=("auto", "yes", "no"),
    )
    white_balance: bool = setting(False, "whether each channel has an exposure of its own")


@dataclass(frozen=True)
class SeparationSettings:
    """How the object is found in photos that have no masks."""

    share: float = setting(0.15, "share of run.max_minutes for this search", unit=OF_RUN, above=0, below=1)
    steps: int = setting(6000, "optimiser steps where no minutes end the run", unit="steps", at_least=1)


@dataclass(frozen=True)
class SurfaceSettings:
    """The signed distance field: a hash grid whose levels open one by one, and a network of one hidden layer."""

    n_levels: int = setting(9, "levels of the hash grid", at_least=1, at_most=32)
    growth: float = setting(
        1.4697344922755988, "factor of cells from level to level (16 to 348 by default)", at_least=1, at_most=16
    )
    least_cell: float = setting(
        0.65,
        "least width of a cell at the object; finer levels are left out; 0: none",
        unit="pixels of the photos",
        at_least=0,
        at_most=1024,
    )
    log2_table_size: int = setting(
        17, "binary logarithm of the entries of a level's hash table", at_least=1, at_most=24
    )
    table_dtype: str = setting(
        "float32",
        "number format in which the hash table is read; it is trained in float32",
        choices=("float32", "float16"),
    )
    start: str = setting(
        "stereo",
        "first shape: the photos' stereo depths within their visual hull (a sphere where few are clear), or a "
        "sphere (the paper)",
        choices=("stereo", "sphere"),
    )
    normals: str = setting(
        "analytic",
        "how the normals are derived from the distance; finite_difference: the released code",
        choices=("analytic", "finite_difference"),
    )


@dataclass(frozen=True)
class MaterialsSettings:
    """The network of albedo, roughness and metallic."""

    inputs: str = setting(
        "grid",
        "inputs of the networks of material and occlusion; outputs: the surface's outputs (the paper); grid: "
        "the hash features as well",
        choices=("outputs", "grid"),
    )


@dataclass(frozen=True)
class LightSettings:
    """The distant light, as texels or as a network."""

    kind: str = setting("pyramid", "how the light is stored; mlp: the paper", choices=("mlp", "pyramid"))
    resolution: int = setting(
        128, "texels along the edge of the pyramid's map", unit="texels", choices=(16, 32, 64, 128, 256, 512, 1024)
    )


@dataclass(frozen=True)
class ShadingSettings:
    """The colour of a pixel from material and light."""

    method: str = setting(
        "summed",
        "split: the split sum (the paper); summed: a sum over the directions of the bits, where lobes are wide",
        choices=("split", "summed"),
    )
    fresnel: str = setting(
        "exact",
        "form of the Fresnel term; exact: the path tracer's and Blender's, Schlick's for metals and the exact one of "
        "index 1.5 for dielectrics; paper: as published",
        choices=("exact", "paper"),
    )
    query: str = setting(
        "mean",
        "query direction of the light: the lobe's mean, or the reflection (the paper)",
        choices=("mean", "reflection"),
    )
    compensate: bool = setting(True, "compensation of multiple scattering, as Blender has it")
    compositing: str = setting(
        "linear", "space in which samples are added; srgb: the paper", choices=("linear", "srgb")
    )


@dataclass(frozen=True)
class OcclusionSettings:
    """Occlusion of the light by the object, and interreflection."""

    kind: str = setting(
        "bits",
        "mlp: a network that learns traced factors (the paper); bits: visibility cached on the mesh; off: none",
        choices=("mlp", "bits", "off"),
    )
    channels: int = setting(3, "colours with factors of their own; 1: their mean (the paper)", choices=(1, 3))
    indirect: bool = setting(True, "light from the object itself, with bits")


@dataclass(frozen=True)
class MeshSettings:
    """The mesh that occlusion is traced on while training."""

    every: float = setting(0.1, "time between two meshes", unit=OF_RUN, above=0)
    resolution: int = setting(
        96, "nodes of marching cubes along an edge", unit="nodes", at_least=MIN_EXPORT_SIZE, at_most=2048
    )
    background: bool = setting(False, "meshes made in a background thread, while training continues with the last one")


@dataclass(frozen=True)
class SamplingSettings:
    """Rays, the samples along them, and the grid of cells that holds them."""

    max_rays: int = setting(8192, "most rays of a step", unit="rays", at_least=1, at_most=1 << 20)
    target_samples: int = setting(4608, "samples of a step that the number of rays aims at", unit="samples", at_least=1)
    min_weight: float = setting(1e-3, "weight below which samples are left out; 0 takes all", at_least=0.0, below=1.0)
    occupancy: str = setting(
        "distance",
        "how empty cells are found: distance bounds the density; average: a mean over time (the released code)",
        choices=("distance", "average"),
    )
    grid_resolution: int = setting(
        96, "cells of the occupancy grid along an edge", unit="cells", at_least=1, at_most=512
    )
    pixel_cells: float = setting(
        0.6,
        "width up to which pixels of large photos are averaged, in cells of the finest level; 0: no averages",
        at_most=1024,
    )


@dataclass(frozen=True)
class LossesSettings:
    """Weights and widths of the loss's terms."""

    colour_weight: float = setting(10.0 / 3.0, "weight of the squared error of colours, summed over channels")
    light_weight: float = setting(1.0, "weight of the light's consistency (of the MLP)")
    occlusion_weight: float = setting(0.1, "weight of the traced occlusion factors (of the MLP)")
    eikonal_weight: float = setting(0.3, "weight of |gradient of the distance| = 1")
    metal_weight: float = setting(0.0001, "weight of metallic squared")
    dark_metal_weight: float = setting(0.002, "weight of metals darker than real ones")
    mask_weight: float = setting(1.0, "weight of the masks")
    edge_pixels: int = setting(
        2,
        "width of the band at mask edges where colours are compared including the background; 0 turns it off. Only for "
        "separate mask files",
        unit="pixels",
        at_least=0,
        at_most=8,
    )
    neutral_weight: float = setting(0.03, "weight of the diffuse light's log chroma")
    light_prior_weight: float = setting(0.001, "weight of the distance to a smooth and grey light (of the pyramid)")
    entropy_weight: float = setting(0.002, "weight of the materials' quadratic entropy, from half of the run")
    seen_weight: float = setting(0.02, "weight of the distance to the light that photos show around the object")
    smoothness_weight: float = setting(
        0.01,
        "weight of the difference of normals of neighbouring surface points, where colours have an error of 31.8 dB",
    )


@dataclass(frozen=True)
class RefinementSettings:
    """Refinement: the exported asset and its light are fitted to the photos."""

    enabled: bool = setting(True, "whether there is a refinement")
    share: float = setting(
        0.2, "share of run.max_minutes for the refinement; training gets the rest", unit=OF_RUN, below=1.0
    )
    sweeps: int = setting(16, "Gauss-Newton steps of the refinement where no minutes end it", unit="steps", at_least=1)
    albedo_size: int = setting(
        4096,
        "most texels along the edge of the albedo's texture, which gets the photos' detail; 0: it does not",
        unit="texels",
        at_most=8192,
    )


@dataclass(frozen=True)
class ExportSettings:
    """The files of the finished run."""

    resolution: int = setting(
        384, "nodes of marching cubes along an edge", unit="nodes", at_least=MIN_EXPORT_SIZE, at_most=4096
    )
    faces: int = setting(50000, "triangles of the textured mesh; 0: all", unit="triangles")
    texture_size: int = setting(
        1024, "texels along the edge of a texture", unit="texels", at_least=MIN_EXPORT_SIZE, at_most=8192
    )


number = partial(setting, meaning="")  # a constant, which its name describes


@dataclass(frozen=True)
class Constants:
    """Numbers of the method that nobody tunes for a scene, one record for each preset. A run keeps it in its files; no command
    lists it."""

    # signed distance
    box: float = number(1.5, at_least=1e-3, at_most=FARTHEST)  # half the edge of the scene's box
    base_resolution: int = number(16, at_least=1, at_most=4096)  # cells of the coarsest level along an edge
    start_levels: int = number(4)
    levels_open_by: float = number(0.4)
    surface_width: int = number(64, at_least=1, at_most=1024)  # neurons of a hidden layer; and so below
    sphere_radius: float = number(0.7, at_most=FARTHEST)  # of the networks at the start
    initial_variance: float = number(0.3)  # v, where s = exp(10 v) is the sharpness of the surface
    cos_anneal_by: float = number(0.4)  # from then on alphas follow the slope of the distance
    # materials
    materials_width: int = number(64, at_least=1, at_most=1024)
    initial_roughness: float = number(0.3)
    min_roughness: float = number(0.05, below=1.0)  # a narrower lobe is finer than what photos resolve
    # light as an MLP
    light_width: int = number(64, at_least=1, at_most=1024)
    light_layers: int = number(3, at_least=1, at_most=16)
    direction_frequencies: int = number(6, at_least=1, at_most=32)
    roughness_frequencies: int = number(3, at_least=1, at_most=32)
    light_activation: str = number("exp", choices=("softplus", "exp"))
    # occlusion as an MLP, and by bits from `occlusion_directions` on
    occlusion_width: int = number(64, at_least=1, at_most=1024)
    occlusion_share: float = number(0.1)  # of the shaded samples, whose factors are traced
    occlusion_rays: int = number(32, at_least=1)  # for each of the two factors
    occlusion_environment_height: int = number(32, at_least=1, at_most=1 << 13)  # rows of the light that weighs them
    occlusion_offset: float = number(0.0125, at_most=FARTHEST)  # from the surface to the start of a ray
    occlusion_directions: int = number(256, choices=range(64, 1025, 32))
    open_below: float = number(0.02)  # if no vertex has a larger blocked share, occlusion is skipped
    indirect_every: int = number(200, at_least=1)  # steps
    # samples
    initial_rays: int = number(1024, at_least=1, at_most=1 << 20)
    step_scale: float = number(2.0)  # length of a sample times s, between the next two
    min_step: float = number(0.01, above=0, at_most=FARTHEST)
    max_step: float = number(0.04, at_most=FARTHEST)
    min_transmittance: float = number(1e-3, below=1.0)  # at which a ray ends
    shades_per_ray: int = number(4, at_most=1024)  # the other samples interpolate; 0 shades all
    grid_every: int = number(32, at_least=1)  # steps between refreshes of the occupancy grid
    foreground_share: float = number(0.85)  # of the rays, drawn near the masks
    # losses
    shape_priors_until: float = number(0.7)  # share of the run; later the photos alone move the surface
    priors_from: float = number(0.5)  # from then on the priors of materials count
    entropy_points: int = number(384, at_least=1, at_most=1 << 16)
    albedo_width: float = number(0.6, above=0)  # difference of log albedos that counts as one
    gloss_width: float = number(0.2, above=0)  # of roughness and metallic, likewise
    neutral_queries: int = number(256, at_least=1, at_most=1 << 20)  # normals
    smoothness_points: int = number(512, at_most=1 << 20, at_least=1)
    smoothness_radius: float = number(0.02)  # standard deviation of a neighbour's offset
    eikonal_points: int = number(256, at_most=1 << 20)  # uniform in the box, in addition to the rays' samples
    # consistency of the light as an MLP
    light_form: str = number("smooth_l1", choices=("square", "smooth_l1"))  # square: the paper; else the released code
    light_set: str = number("fibonacci", choices=("fibonacci", "uniform"))  # uniform: the paper
    light_samples: int = number(2048, at_least=1)  # directions
    light_queries: int = number(512, at_least=1)
    light_lobe_below: float = number(0.15)  # roughness of lobes with directions of their own
    light_lobe_samples: int = number(16, at_least=1)
    # optimiser
    learning_rate: float = number(0.01)
    light_step_every: int = number(4, at_least=1, at_most=64)  # steps that share one step of the pyramid's texels
    warmup_steps: int = number(100)
    final_learning_rate: float = number(0.02)  # factor at the end
    sparse_steps: bool = number(False)  # entries of the hash table without a gradient are left alone
