"""What a run does about numbers that are not finite: the rule, and where they came from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import torch
from torch import Tensor
from torch.nn.utils import get_total_norm

from splitnerf.training.batches import Batch
from splitnerf.data.dataset import Dataset
from splitnerf.notes import note
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import RenderedRays

MOST_SKIPPED = 10  # steps in a row
LARGEST = 1e18  # value of a gradient; the optimiser squares it, in single precision


class Diverged(RuntimeError):
    """A run met numbers that are not finite and stopped. Its last checkpoint stands.

    The rule:
        - Images whose pixels are NaN, infinite or outside [0, 1] are refused when they are read.
        - A loss that is not finite stops the run before the parameters move. The message names the loss's terms and
          the first that is not finite of what they come from: images, cameras, parameters, rendered rays.
        - A gradient that is not finite, or too large to be squared, skips the step: parameters and optimiser stay as
          they are. It is said on stderr, and metrics.jsonl counts such steps as ``skipped``. The tenth in a row stops
          the run.
        - Parameters are looked at with every line of metrics.jsonl, before a mesh is made of them and before they are
          saved. Where one is not finite the run stops and no checkpoint is written.
        - A checkpoint whose numbers are not finite is refused when it is read.
    """


class GradientWatch:
    """Decides whether a step may be taken.

    Attributes:
        skipped: Steps that were not, so far.
    """

    def __init__(self, parameters: Iterable[Tensor]):
        self.parameters = list(parameters)
        self.skipped = self._in_a_row = 0

    def largest(self) -> Tensor:
        """[] the largest magnitude among all gradients; reads each of them once."""
        return get_total_norm([p.grad for p in self.parameters if p.grad is not None], torch.inf)

    def allows(self, step: int, largest: float) -> bool:
        """Whether gradients are finite whose largest magnitude this is.

        Raises:
            Diverged: They were not in ten steps in a row.
        """
        if largest < LARGEST:
            self._in_a_row = 0
            return True
        self.skipped, self._in_a_row = self.skipped + 1, self._in_a_row + 1
        if self._in_a_row == MOST_SKIPPED:
            raise Diverged(
                f"step {step}: the gradient was not finite in {MOST_SKIPPED} steps in a row; "
                "lower --set learning_rate and --resume"
            )
        note(f"step {step}: the gradient is not finite; the step is skipped")
        return False


def first_not_finite(values: Iterable[tuple[str, Tensor]]) -> str | None:
    """Name and count of the first of these tensors that has NaN or infinite values; None where all are finite."""
    for name, tensor in values:
        if math.isfinite(tensor.sum().item()):  # several times faster than to look at each
            continue
        n = tensor.numel() - int(tensor.isfinite().sum())
        if n:
            return f"{name} ({n} of {tensor.numel()} values)"
    return None


def check_state(step: int, model: SceneModel, optimiser: torch.optim.Optimizer) -> None:
    """Looks at all parameters, and at what the optimiser keeps of them.

    Raises:
        Diverged: One is not finite.
    """
    state = list(_state(model, optimiser))
    if math.isfinite(torch.stack([value.sum() for _, value in state]).sum().item()):  # one number to wait for
        return
    found = first_not_finite(state)
    if found:
        raise Diverged(f"step {step}: not finite: {found}; lower --set learning_rate and --resume")


def explain_loss(
    step: int, terms: dict[str, float], dataset: Dataset, batch: Batch, model: SceneModel, ray: RenderedRays
) -> Diverged:
    """The error for a loss that is not finite: its terms, and the first in the order of the data flow that is not.

    Args:
        step: The step.
        terms: The loss by name.
        dataset: What is trained on.
        batch, ray: The rays of the step, and as they were rendered.
        model: The scene.
    """
    bad = ", ".join(name for name, term in terms.items() if not math.isfinite(term))
    found = first_not_finite(_data_flow(dataset, batch, model, ray)) or "none of what it comes from"
    return Diverged(
        f"step {step}: the loss is not finite ({bad}); first not finite: {found}; "
        "repair the data, or lower --set learning_rate, and --resume"
    )


def _state(model: SceneModel, optimiser: torch.optim.Optimizer) -> Iterator[tuple[str, Tensor]]:
    for name, parameter in model.named_parameters():
        yield f"parameter {name}", parameter
        for key, value in optimiser.state.get(parameter, {}).items():
            if key != "step":
                yield f"{key} of {name}", value


def _data_flow(dataset: Dataset, batch: Batch, model: SceneModel, ray: RenderedRays) -> Iterator[tuple[str, Tensor]]:
    for i, name in enumerate(dataset.frame_names):
        yield f"image {name}", torch.from_numpy(dataset.images[i])
        yield f"pose of {name}", torch.from_numpy(dataset.poses[i])
        yield f"intrinsics of {name}", torch.from_numpy(dataset.intrinsics[i])
    yield from ((f"rays' {name}", getattr(batch, name)) for name in ("rays_o", "rays_d", "target", "background"))
    yield from ((f"parameter {name}", parameter) for name, parameter in model.named_parameters())
    yield from ((f"rendered {name}", getattr(ray, name)) for name in ("sdf", "gradients", "normals", "weights"))
    yield from ((f"rendered {name}", values) for name, values in ray.points._asdict().items())
    yield from ((f"rendered {name}", getattr(ray, name)) for name in ("mean", "opacity"))
