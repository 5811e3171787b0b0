"""The rule for numbers that are not finite, its checks, and the search for where such numbers came from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import torch
from torch import Tensor

from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import RenderedRays
from splitnerf.training.batches import Batch

UNEXPLAINED = "none of what it comes from"


class Diverged(RuntimeError):
    """The error of a run that stopped because of numbers that are not finite. Its last checkpoint is kept.

    The rule:
        - Images whose pixels are NaN, infinite or outside [0, 1] are refused when they are read.
        - A loss that is not finite stops the run before the parameters move. The message names the loss's terms and
          the first of what they come from that is not finite: rays, parameters, rendered rays.
        - A gradient that is not finite, or too large to be squared, skips the step: parameters and optimiser do not
          change (:meth:`splitnerf.training.step.Step.judge`). A message on stderr says so, and metrics.jsonl counts such steps as ``skipped``. The tenth in a row
          stops the run.
        - Parameters are checked before a mesh is made from them and before they are saved; on the CPU, where nobody waits
          for it, with every line of metrics.jsonl as well. Where one is not finite the run stops and no checkpoint is written.
        - A checkpoint whose numbers are not finite is refused when it is read.
    """


def first_not_finite(values: Iterable[tuple[str, Tensor]]) -> str | None:
    """Name and count of bad values of the first tensor that has NaN or infinite values; None where all are finite."""
    for name, tensor in values:
        if math.isfinite(tensor.sum().item()):  # several times faster than a test of each value
            continue
        n = tensor.numel() - int(tensor.isfinite().sum())
        if n:
            return f"{name} ({n} of {tensor.numel()} values)"
    return None


def check_state(step: int, model: SceneModel, optimiser: torch.optim.Optimizer) -> None:
    """Checks all parameters and the optimiser's moments. Raises Diverged where one is not finite."""
    state = list(_state(model, optimiser))
    norms = torch._foreach_norm([value for _, value in state])
    if math.isfinite(
        torch.stack(norms).sum().item()
    ):  # waits for the device once; what has no square is looked at below
        return
    found = first_not_finite(state)
    if found:
        raise Diverged(f"step {step}: not finite: {found}; lower --set learning_rate and --resume")


def explain_loss(step: int, terms: dict[str, float], model: SceneModel, batch: Batch, ray: RenderedRays) -> Diverged:
    """The error for a loss that is not finite: it names the terms and, in order of the data flow, the first bad input.

    Args:
        terms: The values of the loss's terms by name.
        batch, ray: The rays of the step, and their rendering; of one that is read late, those of a step after it, which
            nothing has moved.
    """
    bad = ", ".join(name for name, term in terms.items() if not math.isfinite(term))
    found = first_not_finite(_data_flow(model, batch, ray)) or UNEXPLAINED
    return Diverged(
        f"step {step}: the loss is not finite ({bad}); first not finite: {found}; lower --set learning_rate and --resume"
    )


def _state(model: SceneModel, optimiser: torch.optim.Optimizer) -> Iterator[tuple[str, Tensor]]:
    for name, parameter in model.named_parameters():
        yield f"parameter {name}", parameter
        for key, value in optimiser.state.get(parameter, {}).items():
            if key != "step":
                yield f"{key} of {name}", value


def _data_flow(model: SceneModel, batch: Batch, ray: RenderedRays) -> Iterator[tuple[str, Tensor]]:
    yield from ((f"rays' {name}", getattr(batch, name)) for name in ("rays_o", "rays_d", "target", "background"))
    yield from ((f"parameter {name}", parameter) for name, parameter in model.named_parameters())
    yield from ((f"rendered {name}", getattr(ray, name)) for name in ("sdf", "gradients", "weights"))
    yield from ((f"rendered {name}", values) for name, values in ray.points._asdict().items())
    yield from ((f"rendered {name}", getattr(ray, name)) for name in ("mean", "opacity"))
