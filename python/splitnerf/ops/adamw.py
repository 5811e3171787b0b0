"""AdamW with one operator call for all tensors, on the CPU and the GPU. It can skip rows without a gradient.

Source: Loshchilov and Hutter 2019, Algorithm 2; rows without gradient: Mueller et al. 2022, section 4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import torch
from torch import Tensor

from splitnerf.ops._library import lib
from splitnerf.ops.sdf import TableCopy


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
            :class:`splitnerf.ops.HashGrid` with a table_dtype. Without it the grid renews its copy itself.

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

    def load_state_dict(self, state_dict: dict) -> None:
        """Loads moments and settings of this class or of torch.optim.AdamW; with the latter, groups keep their
        ``sparse``.

        Raises:
            ValueError: The stored optimiser maximises or uses AMSGrad.
        """
        if any(group.get("maximize") or group.get("amsgrad") for group in state_dict["param_groups"]):
            raise ValueError("AdamW: a state with maximize or amsgrad cannot be gone on from")
        ours = [group["sparse"] for group in self.param_groups]
        super().load_state_dict(state_dict)
        for group, theirs, sparse in zip(self.param_groups, state_dict["param_groups"], ours):
            group["sparse"] = theirs.get("sparse", sparse)

    def __setstate__(self, state: dict) -> None:
        super().__setstate__(state)
        self.__dict__.setdefault("_copies", {})
        self.counted = []
        for group in self.param_groups:
            group.setdefault("sparse", self.defaults["sparse"])
        for moments in self.state.values():
            moments["step"] = moments["step"].cpu()

    @torch.no_grad()
    def step(self, closure: Callable[[], Tensor] | None = None, allowed: Tensor | None = None) -> Tensor | None:
        """Moves every parameter that has a gradient; first calls the closure, if any, and returns its loss.

        ``allowed`` is a [] bool on the parameters' device: where it is false nothing moves, although the step counts. Nobody
        waits for it. Once it is known, :meth:`take_back` mends the count.
        """
        loss, self.counted = None, []
        if closure is not None:
            with torch.enable_grad():
                loss = closure()
        together: dict[tuple, list[tuple[Tensor, dict]]] = {}  # what one call takes
        for group in self.param_groups:
            for param in group["params"]:
                if param.grad is not None:
                    shared = param.dtype, param.device, tuple(group["betas"]), group["eps"]
                    together.setdefault(shared, []).append((param, group))
        for (_, _, betas, eps), members in together.items():
            self._step(members, *betas, eps, allowed)
        return loss

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
