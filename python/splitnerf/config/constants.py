"""The constants of a preset: numbers of the method that nobody tunes for a scene. Units as in
:mod:`splitnerf.config.groups`."""

from __future__ import annotations

from dataclasses import dataclass

from splitnerf.config.groups import FARTHEST
from splitnerf.config.setting import setting


def number(default: float | int | str, **limits: object) -> float | int | str:
    """A constant, which its name describes."""
    return setting(default, "", **limits)


@dataclass(frozen=True)
class Constants:
    """One record for each preset. A run keeps it in its files; no command lists it."""

    # signed distance
    box: float = number(1.5, above=0, at_most=FARTHEST)  # half the edge of the scene's box
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
    occlusion_directions: int = number(256, at_least=64, at_most=1024, multiple_of=32)
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
    hull_until: float = number(0.1)  # before, the masks' visual hull is sampled
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
    light_set: str = number("fibonacci", choices=("fibonacci", "uniform", "uniform_and_queries"))  # likewise
    light_samples: int = number(2048, at_least=2)  # most directions
    light_noise: float = number(0.1)  # share of the term's squared error that noise may make; 0: all light_samples
    light_queries: int = number(512, at_least=1)
    light_lobe_below: float = number(0.15)  # roughness of lobes with directions of their own
    light_lobe_samples: int = number(16, at_least=1)
    # optimiser
    learning_rate: float = number(0.01)
    light_step_every: int = number(4, at_least=1, at_most=64)  # steps that share one step of the pyramid's texels
    warmup_steps: int = number(100)
    final_learning_rate: float = number(0.02)  # factor at the end
    sparse_steps: bool = number(False)  # entries of the hash table without a gradient are left alone
