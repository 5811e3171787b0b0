"""The optimiser of a training and its learning rates."""

from __future__ import annotations

from splitnerf.config import Config
from splitnerf.ops import AdamW
from splitnerf.render.model import SceneModel


def make_optimiser(model: SceneModel, config: Config) -> AdamW:
    """AdamW with the released code's settings; sharpness and light texels have their own rates and no decay."""
    c, grid = config, model.sdf_field.grid
    texels = [model.light.texels] if c.light.kind == "pyramid" else []
    table = [grid.table] if c.optimiser.sparse_steps else []
    apart = {id(p) for p in [model.variance, *texels, *table]}
    groups = [
        ([p for p in model.parameters() if id(p) not in apart], c.optimiser.learning_rate, c.optimiser.weight_decay),
        ([model.variance], c.optimiser.variance_learning_rate, 0.0), (texels, c.optimiser.light_learning_rate, 0.0),
        (table, c.optimiser.learning_rate, c.optimiser.weight_decay),
    ]  # fmt: skip
    groups = [
        {"params": params, "rate": rate, "lr": rate, "weight_decay": decay, "sparse": params is table}
        for params, rate, decay in groups
        if params
    ]
    copies = {grid.table: grid.copy} if grid.copy else None
    return AdamW(groups, betas=(0.9, 0.99), eps=1e-15, copies=copies)


def set_learning_rate(optimiser: AdamW, config: Config, step: int, progress: float) -> None:
    """Linear warm-up over ``warmup_steps``, then exponential decay to ``final_learning_rate`` at the end."""
    warmup = min(config.optimiser.warmup_steps / config.run.steps, 0.5)
    decayed = max(0.0, (progress - warmup) / (1.0 - warmup))
    factor = (
        min(1.0, (step + 1) / max(1, config.optimiser.warmup_steps)) * config.optimiser.final_learning_rate**decayed
    )
    for group in optimiser.param_groups:
        group["lr"] = group["rate"] * factor
