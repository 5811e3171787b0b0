"""The optimiser and the schedule of a training: what changes with the progress, and when."""

from __future__ import annotations

import math
from collections.abc import Callable

from splitnerf.config import Config
from splitnerf.ops import AdamW
from splitnerf.render.model import SceneModel

FEWEST, MOST = 0.9, 1.05  # shares of the sample budget between which the ray count stays; a step has a capacity of 1.15
VARIANCE_RATE, LIGHT_RATE = 0.001, 0.02  # of the surface's sharpness and of the pyramid's texels
WEIGHT_DECAY = 0.01
RAY_UNITS = 16  # `cuda_graphs` uses this many ray counts between one power of 2 and the next


def progress_by(config: Config) -> Callable[[int, float], float]:
    """The progress of the schedule in [0, 1] as a function of the steps and the seconds of a run: the larger of the share
    of steps done and the share of minutes used."""
    n_steps, most_seconds = config.run.steps, 60.0 * config.training_minutes or math.inf
    return lambda step, seconds: min(1.0, max(step / n_steps, seconds / most_seconds))


def cosine_anneal(config: Config, progress: float) -> float:
    """The annealing of the cosine at this progress: 0 at the start, 1 from ``cos_anneal_by`` of the run on."""
    return min(1.0, progress / config.constants.cos_anneal_by) if config.constants.cos_anneal_by > 0 else 1.0


def light_period(config: Config) -> int:
    """The number of steps that share one evaluation of the light's maps."""
    return config.constants.light_step_every if config.light.kind == "pyramid" else 1


def light_moves(config: Config, step: int) -> bool:
    """Whether the light's parameters move in this step."""
    return (step + 1) % light_period(config) == 0 or step + 1 == config.run.steps


def next_ray_count(n_rays: int, n_samples: float, config: Config) -> int:
    """The number of rays that fills the sample budget. It changes by a factor in [0.8, 1.25] a step. With
    ``cuda_graphs`` it does not change while the samples nearly fill the budget, so that sizes repeat."""
    wanted = n_rays * config.sampling.target_samples / max(1, n_samples)
    if config.run.cuda_graphs and FEWEST < n_samples / config.sampling.target_samples < MOST:
        return n_rays
    n = int(min(config.sampling.max_rays, max(64, min(1.25 * n_rays, max(0.8 * n_rays, wanted)))))
    unit = max(1, 2 ** (n.bit_length() - 1) // RAY_UNITS) if config.run.cuda_graphs else 1
    return n // unit * unit


def make_optimiser(model: SceneModel, config: Config) -> AdamW:
    """AdamW with the released code's settings; sharpness and light texels have their own rates and no decay."""
    c, grid = config, model.sdf_field.grid
    texels = [model.light.texels] if c.light.kind == "pyramid" else []
    table = [grid.table] if c.constants.sparse_steps else []
    separate = {id(p) for p in [model.variance, *texels, *table]}
    groups = [
        ([p for p in model.parameters() if id(p) not in separate], c.constants.learning_rate, WEIGHT_DECAY),
        ([model.variance], VARIANCE_RATE, 0.0),
        (texels, LIGHT_RATE, 0.0),
        (table, c.constants.learning_rate, WEIGHT_DECAY),
    ]
    groups = [
        {"params": params, "rate": rate, "lr": rate, "weight_decay": decay, "sparse": params is table}
        for params, rate, decay in groups
        if params
    ]
    copies = {grid.table: grid.copy} if grid.copy else None
    return AdamW(groups, betas=(0.9, 0.99), eps=1e-15, copies=copies)


def has_shape_priors(config: Config, progress: float) -> bool:
    """Whether distances, masks and the smoothness of normals count fully. Together they move the inner side of thin walls, on
    which a photo says little: by 0.03 scene units within 200 steps."""
    return progress < config.constants.shape_priors_until


def set_learning_rate(optimiser: AdamW, config: Config, step: int, progress: float) -> None:
    """Linear warm-up over ``warmup_steps``, then exponential decay to ``final_learning_rate`` at the end."""
    warmup = min(config.constants.warmup_steps / config.run.steps, 0.5)
    decayed = max(0.0, (progress - warmup) / (1.0 - warmup))
    factor = (
        min(1.0, (step + 1) / max(1, config.constants.warmup_steps)) * config.constants.final_learning_rate**decayed
    )
    for group in optimiser.param_groups:
        group["lr"] = group["rate"] * factor
