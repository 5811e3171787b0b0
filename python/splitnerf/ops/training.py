"""What the trainer minimises, and how it steps: terms of the loss, and AdamW.

One pass over the pixels, points or pairs finds the values of terms, another one their gradients. All are differentiable
once, in the arguments that the docstrings name; a gradient to any other argument raises.

AdamW has one operator call for all tensors, on the CPU and the GPU. It can skip rows without a gradient.

Source: Loshchilov and Hutter 2019, Algorithm 2; rows without gradient: Mueller et al. 2022, section 4.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor

from splitnerf.ops._library import front, lib, refuse_gradients, register
from splitnerf.ops.sdf import TableCopy


@front()
def pixel_losses(
    mean: Tensor,
    opacity: Tensor,
    *,
    target: Tensor,
    background: Tensor,
    whole: Tensor | None = None,
    exposure: Tensor | None = None,
    linear: bool = True,
) -> Tensor:
    """Mean squared sRGB error of pixels against photos over the same background, and the cross entropy with their
    masks.

    Where a photo's channel is clipped, the true value is at least 1. There, and only there, the prediction is clipped
    too.

    Args:
        mean: [n, 3] colours of the object alone, not premultiplied.
        opacity: [n] opacities in [0, 1].
        target: [n, 4] sRGB values of the photos in [0, 1], straight alpha.
        background: [n, 3] sRGB colours in [0, 1].
        whole: [n] bool, the pixels whose photo is what the camera saw, the object and the background together (both added up
            as light, if ``linear``): there the background is what it would have seen without the object, the target's alpha
            says nothing of the colour, and the mask counts a tenth. None: no pixel.
        exposure: [n, 3] factors of ``mean``, by which a photo shows more or less than an exposure of 1. None: all are 1.
        linear: Whether ``mean`` is linear; otherwise it is sRGB.

    Returns:
        [2]: colour, the mean over channels and pixels, and mask, the mean over pixels; 0 without pixels.
        Differentiable in mean and opacity.

    Source: SplitNeRF Eq. (3); NeuS Eq. (17).
    """
    return lib.pixel_losses(mean, opacity, target, background, whole, exposure, linear)


@front()
def gradient_losses(gradients: Tensor, weights: Tensor, beside: Tensor) -> Tensor:
    """The eikonal loss and the smoothness loss of a distance field's gradients.

    The eikonal loss asks for gradients of length 1. The smoothness loss asks for equal directions at neighbouring
    points: among the surfaces that explain the images it prefers the one with the least variation of normals. It sums
    distances of unit normals, which are equal for a smooth bend and for a sharp edge, so that edges survive. It leaves
    out neighbours whose normals differ by more than 90 degrees (they lie on the other side of a thin part) and
    gradients shorter than 1e-3.

    Args:
        gradients: [n, 3] gradients of the field: the first k belong to samples, the last m to neighbours.
        weights: [k] rendering weights of the samples.
        beside: [m] int64, the sample beside each neighbour.

    Returns:
        [2]: eikonal, the mean of :math:`(|g| - 1)^2`, and smoothness, the weighted mean distance of unit normals; 0 without
        points. Differentiable in the gradients.

    Source: Gropp et al. 2020 (eikonal).
    """
    return lib.gradient_losses(gradients, weights, beside)[0]


@front()
def quadratic_entropy(x: Tensor) -> Tensor:
    r"""The entropy of points, over all n^2 pairs of them, i = j included.

    .. math:: -\ln \frac{1}{n^2} \sum_{i,j} e^{-|x_i - x_j|^2 / 4}

    Args:
        x: [n, c] points, n > 0; coordinates divided by the width within which points count as similar.

    Returns:
        [] entropy, from 0 (all points equal) to ln n. Differentiable in x.

    Source: Renyi's quadratic entropy of a kernel density (Principe 2010, section 2.2), as Barron and Malik 2015 use it.
    """
    return lib.quadratic_entropy(x)[0]


def _keep_with_second(ctx, inputs, output):
    """Saves the inputs and the second result, to which there is no gradient."""
    ctx.mark_non_differentiable(output[1])
    ctx.set_materialize_grads(False)  # else zeros are made for it
    ctx.save_for_backward(*inputs, output[1])


def _gradient_backward(ctx, grad, _):
    refuse_gradients(ctx, "gradient_losses", weights=1)
    return None if grad is None else lib.gradient_losses_backward(*ctx.saved_tensors, grad), None, None


class _FirstOnly(torch.autograd.Function):
    """A first derivative that depends on x, of which no further one is defined."""

    @staticmethod
    def forward(ctx, value: Tensor, x: Tensor) -> Tensor:
        return value.view_as(value)

    @staticmethod
    def backward(ctx, _) -> None:
        raise RuntimeError("quadratic_entropy: no gradient is defined of its gradient; see the table in docs/ops.md")


def _entropy_backward(ctx, grad, _):
    x, gradient = ctx.saved_tensors
    return None if grad is None else _FirstOnly.apply(gradient * grad, x)


register("pixel_losses", fake=lambda mean, *rest: mean.new_empty(2), gradients="mean opacity")
register(
    "gradient_losses",
    fake=lambda gradients, *rest: (gradients.new_empty(2), gradients.new_empty(())),
    setup_context=_keep_with_second,
    backward=_gradient_backward,
)
register("gradient_losses_backward", fake=lambda gradients, *rest: gradients.new_empty(gradients.shape))
register(
    "quadratic_entropy",
    fake=lambda x: (x.new_empty(()), x.new_empty(x.shape)),
    setup_context=_keep_with_second,
    backward=_entropy_backward,
)


class AdamW(torch.optim.Optimizer):
    r"""torch.optim.AdamW, all parameters of one dtype in one call; each class loads the other's state_dict.

    .. math::

       m &\leftarrow \beta_1 m + (1 - \beta_1)\, g, \qquad v \leftarrow \beta_2 v + (1 - \beta_2)\, g^2 \\
       p &\leftarrow p\, (1 - lr\, weight\_decay)
           - lr\, \frac{m / (1 - \beta_1^{step})}{\sqrt{v / (1 - \beta_2^{step})} + \epsilon}

    A NaN gradient makes its parameter and both moments NaN. A gradient whose square times 1 - beta2 overflows the dtype
    makes v infinite; from then on only weight decay moves its parameter. A gradient whose square underflows counts as 0
    in v.

    Args:
        params: Contiguous tensors, float32 or float64, or groups of them with their own settings.
        lr: The learning rate, at least 0.
        betas: The decay rates of the moments, in [0, 1).
        eps: The stabiliser of the division, at least 0.
        weight_decay: The decoupled weight decay, at least 0.
        sparse: Whether to skip rows (of the last dimension) whose gradients are all exactly 0: the parameter and both
            moments do not change there.
        copies: Rounded copies that a step also writes, by parameter: ``{grid.table: grid.copy}`` of a
            :class:`splitnerf.ops.sdf.HashGrid` with a table_dtype. Without it the grid renews its copy itself.

    Attributes:
        counted: The counts of steps that the last step has raised, those of the parameters with a gradient.

    Raises:
        ValueError: A setting, a parameter or a gradient does not fit; raised in a step.

    Example:
        >>> table = torch.nn.Parameter(torch.zeros(4, 2))
        >>> optimiser = AdamW([table], lr=0.1, sparse=True)
        >>> table.grad = torch.tensor([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
        >>> optimiser.step()
        >>> table.detach()[0]
        tensor([-0.1000,  0.0000])
    """

    counts_versions = True  # tells TableCopy that it needs no hook to notice the steps

    def __init__(
        self,
        params: Iterable,
        lr: float = 1e-3,
        betas: tuple[float, float] = (0.9, 0.999),
        eps: float = 1e-8,
        weight_decay: float = 1e-2,
        *,
        sparse: bool = False,
        copies: Mapping[Tensor, TableCopy] | None = None,
    ):
        super().__init__(params, {"lr": lr, "betas": betas, "eps": eps, "weight_decay": weight_decay, "sparse": sparse})
        self._copies = dict(copies or {})
        self.counted: list[Tensor] = []

    def __setstate__(self, state: dict) -> None:
        super().__setstate__(state)
        self.__dict__.setdefault("_copies", {})
        self.counted = []
        for group in self.param_groups:
            group.setdefault("sparse", self.defaults["sparse"])
        for moments in self.state.values():
            moments["step"] = moments["step"].cpu()

    @torch.no_grad()
    def step(self, allowed: Tensor | None = None) -> None:
        """Moves every parameter that has a gradient.

        ``allowed`` is a [] bool on the parameters' device: where it is false nothing moves, although the step counts. Nobody
        waits for it. Once it is known, :meth:`take_back` mends the count.
        """
        self.counted = []
        together: dict[tuple, list[tuple[Tensor, dict]]] = {}  # what one call takes
        for group in self.param_groups:
            for param in group["params"]:
                if param.grad is not None:
                    shared = param.dtype, param.device, tuple(group["betas"]), group["eps"]
                    together.setdefault(shared, []).append((param, group))
        for (_, _, betas, eps), members in together.items():
            self._step(members, *betas, eps, allowed)

    @staticmethod
    def take_back(counted: list[Tensor]) -> None:
        """Counts a step no more whose ``allowed`` was false; ``counted`` is what :attr:`counted` was after it."""
        torch._foreach_sub_(counted, 1)

    def _step(
        self, members: list[tuple[Tensor, dict]], beta1: float, beta2: float, eps: float, allowed: Tensor | None
    ) -> None:
        params, groups = [param for param, _ in members], [group for _, group in members]
        states = [self._state(param) for param in params]
        counts, means, squares = ([state[name] for state in states] for name in ("step", "exp_avg", "exp_avg_sq"))
        copied = [i for i, param in enumerate(params) if param in self._copies]
        copies = [self._copies[params[i]].of(params[i]) for i in copied]
        lib.adamw_steps_(
            params,
            [param.grad for param in params],
            means,
            squares,
            [float(group["lr"]) for group in groups],
            beta1,
            beta2,
            eps,
            [group["weight_decay"] for group in groups],
            [int(count) + 1 for count in counts],
            [group["sparse"] for group in groups],
            copies,
            copied,
            allowed,
        )
        torch.autograd.graph.increment_version([*params, *means, *squares, *copies])
        torch._foreach_add_(counts, 1)  # on the CPU
        self.counted += counts
        for i in copied:
            self._copies[params[i]].was_written(params[i])

    def _state(self, param: Tensor) -> dict[str, Tensor]:
        """A parameter's moments and its count of steps, which is on the CPU."""
        state = self.state[param]
        if not state:
            state["step"] = torch.zeros((), dtype=torch.float32)
            state["exp_avg"] = torch.zeros_like(param)
            state["exp_avg_sq"] = torch.zeros_like(param)
        return state


torch.library.register_fake("splitnerf::adamw_steps_", lambda *arguments: None)
