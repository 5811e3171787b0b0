"""Multiresolution hash grid encoding, with the Jacobian as an output.

Gradients that exist (a missing one raises):

===========================  =======  ===========  ================  ===============
function                     to table to positions second order      note
===========================  =======  ===========  ================  ===============
``hash_encode``              yes      yes          yes, both         through the Jacobian
``hash_encode_jacobian``     yes      yes          no                features and Jacobian
===========================  =======  ===========  ================  ===============

A float32 table may be read from a 16-bit copy of it (``stored``): half the memory to gather from, while everything is still
computed in float32 and the gradient arrives in float32 at the table itself. docs/ops.md has the errors.

With the Jacobian as an output, an SDF normal is a product of two tensors, and a loss on it needs one
backward pass instead of two.
Measured on two cores, 12 levels x 2, 2^17 entries: 3.1 times as fast at 10k and at 100k points.

Source: Mueller et al. 2022, section 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.optim.optimizer import register_optimizer_step_post_hook

from splitnerf import _core
from splitnerf.ops._library import lib, refuse_gradients, register


@dataclass(frozen=True)
class HashGridSpec:
    """Shape of a hash grid.

    Attributes:
        n_levels: Levels, 1 to 32.
        n_features: Features of one level: 1, 2, 4 or 8.
        base_resolution: Cells along an edge of the coarsest level.
        growth: Factor between the resolutions of neighbouring levels, at least 1.
        log2_table_size: A level holds at most ``2**log2_table_size`` entries; finer levels share them by hashing.

    Raises:
        ValueError: No grid can have this shape; the message names the number.
    """

    n_levels: int = 16
    n_features: int = 2
    base_resolution: int = 32
    growth: float = 1.3195079
    log2_table_size: int = 19

    def __post_init__(self):
        self.levels()

    def levels(self) -> list[tuple[int, int, int, bool]]:
        """(resolution, first entry, number of entries, dense) of each level."""
        return _core.hash_grid_levels(
            self.n_levels, self.n_features, self.base_resolution, self.growth, self.log2_table_size
        )

    @property
    def n_entries(self) -> int:
        """Rows of the table."""
        _, offset, n, _ = self.levels()[-1]
        return offset + n

    @property
    def n_outputs(self) -> int:
        """Columns of the encoding."""
        return self.n_levels * self.n_features

    def arguments(self, n_active: int) -> tuple[int, int, float, int, int]:
        """The trailing arguments of the ``torch.ops.splitnerf.hash_encode*`` operators."""
        return self.n_levels, self.base_resolution, self.growth, self.log2_table_size, n_active


def hash_encode(
    positions: Tensor, table: Tensor, spec: HashGridSpec, n_active: int | None = None, stored: Tensor | None = None
) -> Tensor:
    """Encodes points of the unit cube by trilinear interpolation on every open level.

    Args:
        positions: [n, 3], float32 or float64, in [0, 1]; outside, the nearest point of the cube is encoded
            and the gradient along that axis is 0. A NaN coordinate gives NaN features.
        table: [spec.n_entries, spec.n_features], same dtype; or, where no gradient to it is asked, float16 or bfloat16
            beside float32 positions.
        spec: Shape of the grid.
        n_active: Open levels, coarsest first; the columns of closed ones are 0 and cost nothing. Default: all.
        stored: Like table, float16 or bfloat16: is read in place of a float32 table, each entry turned into float32.

    Returns:
        [n, spec.n_outputs] in the dtype of positions. Differentiable twice in positions and table. The gradient to table has
        its dtype and is summed in it, float32 with `stored`: rounding counts as the identity.

    Raises:
        ValueError: A shape, dtype or level count does not fit; the message names it.
        RuntimeError: In the backward pass, where a gradient to `stored` or to a 16-bit table is asked for.
    """
    return lib.hash_encode(positions, table, *spec.arguments(spec.n_levels if n_active is None else n_active), stored)


def hash_encode_jacobian(
    positions: Tensor, table: Tensor, spec: HashGridSpec, n_active: int | None = None, stored: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Encodes points and returns the derivative of the features in one pass over the table.

    Args and Raises: as :func:`hash_encode`.

    Returns:
        features [n, C] and jacobian [n, 3, C], ``jacobian[i, a, c] = d features[i, c] / d positions[i, a]``,
        C = spec.n_outputs. Differentiable once in positions and table.
    """
    return lib.hash_encode_jacobian(
        positions, table, *spec.arguments(spec.n_levels if n_active is None else n_active), stored
    )


def rounded(table: Tensor, dtype: torch.dtype) -> Tensor:
    """The table in 16 bits, to nearest even; what is beyond the largest number of dtype (float16: 65504) becomes that number,
    never infinite. NaN stays NaN."""
    largest = torch.finfo(dtype).max
    return table.detach().clamp(-largest, largest).to(dtype)


_optimiser_steps = [0]  # of this process


@register_optimizer_step_post_hook
def _count_step(optimiser, *_) -> None:
    if not getattr(optimiser, "counts_versions", False):
        _optimiser_steps[0] += 1


class TableCopy:
    """A 16-bit copy of a float32 table, renewed by :func:`rounded` once the table may have been written to.

    That is noticed by torch's version counter and, since torch's fused optimisers leave the counter as it is, by any optimiser's
    step. What goes through ``table.data``, or through an optimiser's function without its class, is not seen.

    Args:
        dtype: torch.float16 or torch.bfloat16.

    Raises:
        ValueError: Another dtype.
    """

    def __init__(self, dtype: torch.dtype):
        if dtype not in (torch.float16, torch.bfloat16):
            raise ValueError(f"table_dtype must be torch.float16 or torch.bfloat16, got {dtype}")
        self.dtype = dtype
        self._values: Tensor | None = None
        self._of: tuple | None = None

    def of(self, table: Tensor) -> Tensor:
        """The copy, of the table as it stands; in its shape and on its device. It is renewed in place: a backward pass through
        an older state of it raises."""
        if self._state(table) != self._of:
            with torch.inference_mode(False):  # whoever asks first, autograd may keep it later
                values, kept = rounded(table, self.dtype), self._values
                alike = kept is not None and (kept.shape, kept.device) == (values.shape, values.device)
                self._values, self._of = kept.copy_(values) if alike else values, self._state(table)
        return self._values

    def was_written(self, table: Tensor) -> None:
        """Tells that the values of :meth:`of` have been changed as the table has."""
        self._of = self._state(table)

    @staticmethod
    def _state(table: Tensor) -> tuple:
        return table._version, _optimiser_steps[0], table.data_ptr(), table.device, table.shape


class HashGrid(nn.Module):
    """A hash grid with a learnable table.

    Args:
        spec: Shape of the grid.
        init_scale: The table starts uniform in [-init_scale, init_scale].
        table_dtype: torch.float16 or torch.bfloat16: the parameter stays float32 and receives float32 gradients, and a copy in
            this dtype is read in its place; it is renewed when the parameter has changed and is no part of state_dict. Entries
            beyond the dtype's largest number (float16: 65504) are read as that number. Default: none, the parameter is read.

    Raises:
        ValueError: Another table_dtype.

    Example:
        >>> grid = HashGrid(HashGridSpec(n_levels=4, log2_table_size=12))
        >>> grid(torch.rand(5, 3)).shape
        torch.Size([5, 8])
    """

    def __init__(self, spec: HashGridSpec, init_scale: float = 1e-4, table_dtype: torch.dtype | None = None):
        super().__init__()
        self.spec = spec
        self.copy = None if table_dtype is None else TableCopy(table_dtype)
        self.n_active = spec.n_levels
        self.table = nn.Parameter((torch.rand(spec.n_entries, spec.n_features) * 2 - 1) * init_scale)

    def stored(self) -> Tensor | None:
        """The table's copy of 16 bits as it stands; None without `table_dtype`."""
        return None if self.copy is None else self.copy.of(self.table)

    def forward(self, positions: Tensor) -> Tensor:
        return hash_encode(positions, self.table, self.spec, self.n_active, self.stored())

    def jacobian(self, positions: Tensor) -> tuple[Tensor, Tensor]:
        """Features [n, C] and their Jacobian [n, 3, C]."""
        return hash_encode_jacobian(positions, self.table, self.spec, self.n_active, self.stored())


def _table_rows(grid: tuple) -> int:
    n_levels, base_resolution, growth, log2_table_size, *_ = grid
    return HashGridSpec(n_levels, 1, base_resolution, growth, log2_table_size).n_entries


_NO_GRID = (None,) * 5


def _keep_encoded(ctx, inputs, output):
    """Saves positions, table and, where there is one, the table's copy; between them stand the grid's numbers."""
    positions, table, *grid, stored = inputs
    ctx.save_for_backward(positions, table, *([] if stored is None else [stored]))
    ctx.grid = grid


def _keep_scattered(ctx, inputs, output):
    positions, grad_features, *ctx.grid = inputs
    ctx.save_for_backward(positions, grad_features)


def _refuse_rounded_gradients(ctx, op: str, table: Tensor, stored: list[Tensor]) -> None:
    """To what is 16 bits itself: autograd would round the gradient, and small ones vanish in it."""
    if stored:
        refuse_gradients(ctx, op, stored=7)
    if ctx.needs_input_grad[1] and table.dtype in (torch.float16, torch.bfloat16):
        raise RuntimeError(
            f"{op}: no gradient to a table of {table.dtype} is defined; give it as stored, beside the float32 table"
        )


def _encode_backward(ctx, grad):
    positions, table, *stored = ctx.saved_tensors
    _refuse_rounded_gradients(ctx, "hash_encode", table, stored)
    grad_positions = grad_table = None
    if ctx.needs_input_grad[0]:
        _, jacobian = lib.hash_encode_jacobian(positions, table, *ctx.grid, *stored)
        grad_positions = torch.einsum("nac,nc->na", jacobian, grad)
    if ctx.needs_input_grad[1]:
        grad_table = lib.hash_encode_backward(positions, grad, *ctx.grid)
    return grad_positions, grad_table, *_NO_GRID, None


def _scatter_backward(ctx, grad_grad_table):
    """grad_table = sum_p w(p) grad_features(p) is linear in both: its adjoint encodes with grad_grad_table."""
    positions, grad_features = ctx.saved_tensors
    grad_positions = grad_grad_features = None
    if ctx.needs_input_grad[0]:
        _, jacobian = lib.hash_encode_jacobian(positions, grad_grad_table, *ctx.grid)
        grad_positions = torch.einsum("nac,nc->na", jacobian, grad_features)
    if ctx.needs_input_grad[1]:
        grad_grad_features = lib.hash_encode(positions, grad_grad_table, *ctx.grid)
    return grad_positions, grad_grad_features, *_NO_GRID


def _jacobian_backward(ctx, grad_features, grad_jacobian):
    positions, table, *stored = ctx.saved_tensors
    _refuse_rounded_gradients(ctx, "hash_encode_jacobian", table, stored)
    grad_positions = grad_table = None
    if ctx.needs_input_grad[0]:
        grad_positions = lib.hash_encode_jacobian_backward_positions(
            positions, *(stored or [table]), grad_features, grad_jacobian, *ctx.grid
        )
    if ctx.needs_input_grad[1]:
        grad_table = lib.hash_encode_jacobian_backward(positions, grad_features, grad_jacobian, *ctx.grid)
    return grad_positions, grad_table, *_NO_GRID, None


register(
    "hash_encode",
    fake=lambda positions, table, *grid: positions.new_empty(positions.shape[0], grid[0] * table.shape[1]),
    setup_context=_keep_encoded,
    backward=_encode_backward,
)
register(
    "hash_encode_backward",
    fake=lambda positions, grad, *grid: grad.new_empty(_table_rows(grid), grad.shape[1] // grid[0]),
    setup_context=_keep_scattered,
    backward=_scatter_backward,
)
register(
    "hash_encode_jacobian",
    fake=lambda positions, table, *grid: (
        positions.new_empty(positions.shape[0], grid[0] * table.shape[1]),
        positions.new_empty(positions.shape[0], 3, grid[0] * table.shape[1]),
    ),
    setup_context=_keep_encoded,
    backward=_jacobian_backward,
)
register(
    "hash_encode_jacobian_backward",
    fake=lambda positions, grad, grad_jacobian, *grid: grad.new_empty(_table_rows(grid), grad.shape[1] // grid[0]),
)
register(
    "hash_encode_jacobian_backward_positions",
    fake=lambda positions, table, grad_features, grad_jacobian, *grid: positions.new_empty(positions.shape),
)


def growth_for(base_resolution: int, finest_resolution: int, n_levels: int) -> float:
    """Growth that leads from the base to the finest resolution over ``n_levels`` levels."""
    return math.exp(math.log(finest_resolution / base_resolution) / max(1, n_levels - 1))
