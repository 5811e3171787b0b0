"""What changes in the course of a training, and when."""

from __future__ import annotations

from splitnerf.config import Config

NEARLY = 0.1  # of the budget of samples
RAY_UNITS = 16  # numbers of rays between a power of 2 and the next that `cuda_graphs` takes


def cosine_anneal(config: Config, progress: float) -> float:
    """0 at the start, 1 from ``cos_anneal_by`` of the run."""
    return min(1.0, progress / config.surface.cos_anneal_by) if config.surface.cos_anneal_by > 0 else 1.0


def light_period(config: Config) -> int:
    """Steps that share one pass through the light's maps."""
    return config.optimiser.light_step_every if config.light.kind == "pyramid" else 1


def light_moves(config: Config, step: int) -> bool:
    """Whether the light takes its gradients in this step."""
    return (step + 1) % light_period(config) == 0 or step + 1 == config.run.steps


def next_ray_count(n_rays: int, n_samples: float, config: Config) -> int:
    """As many rays as fill the budget of samples, moving by at most a factor of 1.25 a step; with ``cuda_graphs`` as many as
    before while the budget is nearly met, so that sizes repeat."""
    wanted = n_rays * config.sampling.target_samples / max(1, n_samples)
    if config.run.cuda_graphs and abs(wanted / n_rays - 1.0) < NEARLY:
        return n_rays
    n = int(min(config.sampling.max_rays, max(64, min(1.25 * n_rays, max(0.8 * n_rays, wanted)))))
    unit = max(1, 2 ** (n.bit_length() - 1) // RAY_UNITS) if config.run.cuda_graphs else 1
    return n // unit * unit
