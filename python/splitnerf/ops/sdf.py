"""The distance field and its hash grid: encoding, the field with its gradient, its values alone, the search for samples along rays.

``hash_encode`` is differentiable once in positions and table, ``sdf_field`` once in the table and the weights; it has the gradient by
the position as a result, so that a loss on it needs no second derivative. ``sdf_values`` and ``sample_rays`` have no gradient.

The operators can read a 16-bit copy (``stored``) of a float32 table: lookups gather half the memory, all computation is
in float32, and the table itself gets its gradient in float32. docs/ops.md lists the errors.

Source: Mueller et al. 2022, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.optim.optimizer import register_optimizer_step_post_hook

from splitnerf import _core
from splitnerf.ops._library import front, lib, refuse_gradients, register
from splitnerf.ops.rays import PackedSamples, _fake_packed


@dataclass(frozen=True)
class HashGridSpec:
    """Shape of a hash grid.

    Attributes:
        n_levels: The number of levels, 1 to 32.
        n_features: The number of features per level: 1, 2, 4 or 8.
        base_resolution: The number of cells along an edge of the coarsest level. Take one whose (n + 1)^3 nodes fit into
            the table: where no level does, all places share entries with places far away, and little is learned.
        growth: The factor between the resolutions of neighbouring levels, at least 1.
        log2_table_size: The base-2 logarithm of the largest number of entries per level; finer levels share their
            entries by hashing.

    Raises:
        ValueError: A number is out of its range; the message names it.
    """

    n_levels: int = 16
    n_features: int = 2
    base_resolution: int = 32
    growth: float = 1.3195079
    log2_table_size: int = 19

    def __post_init__(self):
        self.levels()

    def levels(self) -> list[tuple[int, int, int, bool]]:
        """The tuple (resolution, first entry, number of entries, is dense) of each level."""
        return _core.hash_grid_levels(
            self.n_levels, self.n_features, self.base_resolution, self.growth, self.log2_table_size
        )

    @property
    def n_entries(self) -> int:
        """The number of rows of the table."""
        _, offset, n, _ = self.levels()[-1]
        return offset + n

    @property
    def n_outputs(self) -> int:
        """The number of columns of the encoding."""
        return self.n_levels * self.n_features

    def arguments(self, n_active: int) -> tuple[int, int, float, int, int]:
        """The trailing arguments of the ``torch.ops.splitnerf.hash_encode*`` operators."""
        return self.n_levels, self.base_resolution, self.growth, self.log2_table_size, n_active


@front(positions=1)
def hash_encode(
    positions: Tensor, table: Tensor, spec: HashGridSpec, n_active: int | None = None, stored: Tensor | None = None
) -> Tensor:
    """Encodes points of the unit cube by trilinear interpolation on every open level.

    Args:
        positions: [n, 3] points, float32 or float64, in [0, 1]. A point outside is moved to the nearest point of the
            cube, and its gradient along the clamped axes is 0. A NaN coordinate gives NaN features.
        table: [spec.n_entries, spec.n_features] entries in the dtype of positions; or, if it needs no gradient, float16
            with float32 positions.
        spec: The shape of the grid.
        n_active: The number of open levels, coarsest first; the columns of closed levels are 0 and cost nothing.
            Default: all.
        stored: A copy of the float32 table in float16, which is read instead of the table and converted to float32; or
            None.

    Returns:
        [n, spec.n_outputs] features in the dtype of positions. Differentiable once in positions and table. The
        gradient of table has the table's dtype and is summed in it; with `stored` the rounding counts as the identity.

    Raises:
        RuntimeError: `stored` or a float16 table requires a gradient; raised in the backward pass.
    """
    return lib.hash_encode(positions, table, *spec.arguments(spec.n_levels if n_active is None else n_active), stored)


def rounded(table: Tensor) -> Tensor:
    """The table in float16, rounded to nearest even. A value beyond the largest number, 65504, becomes that number, never infinite.
    NaN stays NaN."""
    largest = torch.finfo(torch.float16).max
    return table.detach().clamp(-largest, largest).half()


_optimiser_steps = [0]  # steps of all optimisers of this process


@register_optimizer_step_post_hook
def _count_step(optimiser, *_) -> None:
    if not getattr(optimiser, "counts_versions", False):
        _optimiser_steps[0] += 1


class TableCopy:
    """A float16 copy of a float32 table. :func:`rounded` renews the copy when the table may have changed.

    Two signs tell of a change: torch's version counter, and the step of any optimiser, since torch's fused optimisers
    do not increase the counter. A write through ``table.data`` or by an optimiser's function without its class is not
    noticed.
    """

    def __init__(self):
        self._values: Tensor | None = None
        self._of: tuple | None = None

    def of(self, table: Tensor) -> Tensor:
        """The current copy of the table, with its shape and on its device.

        The copy is renewed in place: a backward pass through an older state of it raises RuntimeError.
        """
        if self._state(table) != self._of:
            with torch.inference_mode(False):  # a first call in inference mode must not make an inference tensor
                values, kept = rounded(table), self._values
                alike = kept is not None and (kept.shape, kept.device) == (values.shape, values.device)
                self._values, self._of = kept.copy_(values) if alike else values, self._state(table)
        return self._values

    def was_written(self, table: Tensor) -> None:
        """Declares the copy up to date after its values were written together with the table's."""
        self._of = self._state(table)

    @staticmethod
    def _state(table: Tensor) -> tuple:
        return table._version, _optimiser_steps[0], table.data_ptr(), table.device, table.shape


class HashGrid(nn.Module):
    """A hash grid with a learnable table.

    Args:
        spec: The shape of the grid.
        init_scale: The bound of the table's first values, which are uniform in [-init_scale, init_scale].
        table_dtype: The dtype of a copy that is read instead of the parameter, torch.float16; None reads the parameter.
            The parameter and its gradient stay float32. The copy is renewed when the parameter has changed and is not
            part of state_dict. Entries beyond float16's largest number, 65504, are read as that number.

    Raises:
        ValueError: table_dtype is another dtype.

    Example:
        >>> grid = HashGrid(HashGridSpec(n_levels=4, base_resolution=8, log2_table_size=12))
        >>> grid(torch.rand(5, 3)).shape
        torch.Size([5, 8])
    """

    def __init__(self, spec: HashGridSpec, init_scale: float = 1e-4, table_dtype: torch.dtype | None = None):
        super().__init__()
        if not isinstance(spec, HashGridSpec):
            raise TypeError(f"HashGrid: spec must be a HashGridSpec, got {type(spec).__name__}")
        if table_dtype not in (None, torch.float16):
            raise ValueError(f"table_dtype must be torch.float16 or None, got {table_dtype}")
        self.spec = spec
        self.copy = None if table_dtype is None else TableCopy()
        self.n_active = spec.n_levels
        self.table = nn.Parameter((torch.rand(spec.n_entries, spec.n_features) * 2 - 1) * init_scale)

    def stored(self) -> Tensor | None:
        """The table's current float16 copy; None without `table_dtype`."""
        return None if self.copy is None else self.copy.of(self.table)

    def extra_repr(self) -> str:
        stored = "" if self.copy is None else ", table_dtype=torch.float16"
        return f"{self.spec}, n_active={self.n_active}{stored}"

    def forward(self, positions: Tensor) -> Tensor:
        """Features [n, C] of positions [n, 3] in the unit cube; see :func:`hash_encode`."""
        return hash_encode(positions, self.table, self.spec, self.n_active, self.stored())


def _table_rows(grid: tuple) -> int:
    n_levels, base_resolution, growth, log2_table_size, *_ = grid
    return HashGridSpec(n_levels, 1, base_resolution, growth, log2_table_size).n_entries


def _keep_encoded(ctx, inputs, output):
    """Saves positions, table and, if given, the table's copy; the grid's numbers are between them in ``inputs``."""
    positions, table, *grid, stored = inputs
    ctx.save_for_backward(positions, table, *([] if stored is None else [stored]))
    ctx.grid = grid


def refuse_rounded_gradients(ctx, op: str, table: Tensor, stored: list[Tensor], place: int = 7) -> None:
    """Raises where a float16 table, or its copy, argument number `place`, needs a gradient: small ones would round to
    0."""
    if stored:
        refuse_gradients(ctx, op, stored=place)
    if ctx.needs_input_grad[1] and table.dtype == torch.float16:
        raise RuntimeError(
            f"{op}: no gradient to a table of {table.dtype} is defined; give it as stored, beside the float32 table"
        )


def _encode_backward(ctx, grad):
    positions, table, *stored = ctx.saved_tensors
    refuse_rounded_gradients(ctx, "hash_encode", table, stored)
    grad_positions = grad_table = None
    if ctx.needs_input_grad[0]:
        grad_positions = lib.hash_encode_backward_positions(positions, *(stored or [table]), grad, *ctx.grid)
    if ctx.needs_input_grad[1]:
        grad_table = lib.hash_encode_backward(positions, grad, *ctx.grid)
    return grad_positions, grad_table, *(None,) * 6


register(
    "hash_encode",
    fake=lambda positions, table, *grid: positions.new_empty(positions.shape[0], grid[0] * table.shape[1]),
    setup_context=_keep_encoded,
    backward=_encode_backward,
)
register(
    "hash_encode_backward",
    fake=lambda positions, grad, *grid: grad.new_empty(_table_rows(grid), grad.shape[1] // grid[0]),
)
register("hash_encode_backward_positions", fake=lambda positions, *rest: positions.new_empty(positions.shape))


class SdfNetwork(NamedTuple):
    """The numbers of a field ``outputs(x) = out softplus(hidden [x, features(x)] + hidden_bias) + out_bias``.

    The first output is the signed distance.

    Attributes:
        spec: The shape of the hash grid that computes the features.
        n_active: The number of open levels.
        table: [spec.n_entries, spec.n_features] entries in the dtype of the other tensors; or in float16 where the
            others are float32.
        hidden, hidden_bias: [width, 3 + spec.n_outputs] weights and [width] biases of the hidden layer.
        out, out_bias: [m, width] weights and [m] biases of the output layer.
        beta: The sharpness of the activation softplus(y) = log(1 + exp(beta y)) / beta, positive.
        box: The half size of the cube that the grid covers, scene units.
    """

    spec: HashGridSpec
    n_active: int
    table: Tensor
    hidden: Tensor
    hidden_bias: Tensor
    out: Tensor
    out_bias: Tensor
    beta: float
    box: float

    def snapshot(self) -> SdfNetwork:
        """A copy in memory of its own, which later training steps do not change."""
        return SdfNetwork(*(x.clone() if isinstance(x, Tensor) else x for x in self))

    def arguments(self) -> tuple:
        """The arguments that the operators take for a network."""
        weights = self.hidden, self.hidden_bias, self.out, self.out_bias, self.beta
        return self.table, *weights, *self.spec.arguments(self.n_active), self.box


@front(positions=1)
def sdf_field(
    positions: Tensor,
    table: Tensor,
    *,
    hidden: Tensor,
    hidden_length: Tensor,
    hidden_bias: Tensor,
    out: Tensor,
    out_length: Tensor,
    out_bias: Tensor,
    beta: float,
    box: float,
    spec: HashGridSpec,
    n_active: int | None = None,
    stored: Tensor | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    r"""A distance field at points, with the features of its hash grid and the distance's gradient, in one pass.

    Rows of weights are normalised, row by row:

    .. math::

       W &= hidden\_length\ \frac{hidden}{|hidden|}, \qquad V = out\_length\ \frac{out}{|out|} \\
       a &= W\, [positions, features] + hidden\_bias \\
       outputs &= V\, \mathrm{softplus}(a) + out\_bias

    By the chain rule the gradient is :math:`q_{0..2} + J\, q_{3..} / (2\, box)` with
    :math:`q = (V_0\, \mathrm{softplus}'(a))\, W`, and J the derivatives of the features by the position in the unit cube.

    Args:
        positions: [n, 3] points, scene units, float32 or float64. Features of a point outside of [-box, box] are those of the
            nearest point of this cube. A NaN coordinate gives NaN.
        table: [spec.n_entries, spec.n_features] entries in the dtype of positions; or, if it needs no gradient, float16
            with float32 positions.
        hidden, hidden_length, hidden_bias: [width, 3 + C] directions, [width, 1] lengths and [width] biases of the hidden layer,
            C = spec.n_outputs. A direction of zeros gives NaN.
        out, out_length, out_bias: [m, width] directions, [m, 1] lengths and [m] biases of the output layer, m > 0.
        beta: The sharpness of the activation softplus(y) = log(1 + exp(beta y)) / beta, positive.
        box: The half size of the cube that the grid covers, scene units, positive.
        spec: The shape of the grid.
        n_active: The number of open levels, coarsest first; features of closed levels are 0. Default: all.
        stored: A copy of the float32 table in float16, which is read instead of the table; or None.

    Returns:
        outputs [n, m], features [n, C] and gradient [n, 3] = d outputs[:, 0] / d positions. Differentiable once in table, weights,
        lengths and biases; the backward pass evaluates the field again. With `stored` the gradient goes to the table.

    Raises:
        RuntimeError: positions, `stored` or a 16-bit table requires a gradient; raised in the backward pass.

    Source: SplitNeRF, section 4.1; weight normalisation: Salimans and Kingma 2016; grid: Mueller et al. 2022, section 3.
    """
    numbers = spec.arguments(spec.n_levels if n_active is None else n_active)
    return lib.sdf_field(
        positions, table, hidden, hidden_length, hidden_bias, out, out_length, out_bias, beta, *numbers, box, stored
    )


@front(positions=1)
def sdf_values(positions: Tensor, network: SdfNetwork) -> Tensor:
    """Signed distances [n] at positions [n, 3], scene units: hash grid and network in one pass."""
    return lib.sdf_values(positions, *network.arguments())


@front()
def sample_rays(
    rays_o: Tensor,
    rays_d: Tensor,
    jitter: Tensor,
    cells: Tensor,
    network: SdfNetwork,
    *,
    step: float,
    s: float,
    anneal: float = 1.0,
    min_weight: float,
    min_transmittance: float,
    reach: float,
    lipschitz: float,
    max_samples: int = 1024,
    capacity: int = 0,
) -> tuple[PackedSamples, Tensor, Tensor]:
    """The samples of :func:`splitnerf.ops.rays.march_rays` that contribute to a pixel; the search evaluates the distance along the rays.

    Two neighbouring samples are kept where one of them may have a rendering weight above `min_weight`. The weight is
    that of :func:`splitnerf.ops.rays.surface_weights` with the slope between their midpoints, or a bound for a surface between the
    midpoints. The ray ends where the transmittance is below `min_transmittance`. After a sample at distance f the
    search skips the samples within ``(|f| - reach) / lipschitz``. Where it then meets density or the other sign, the
    field is steeper than `lipschitz`: the search goes back and looks at what it skipped. It does that 32 times on a ray
    at most. After that it skips a quarter as much and does not go back. So a steep field costs few evaluations, and one
    of up to 4 `lipschitz` is still followed.

    Args:
        rays_o, rays_d: [n_rays, 3] origins (scene units) and unit directions.
        jitter: [n_rays] offsets of each ray's lattice of samples in [0, 1), as shares of the step.
        cells: [r, r, r] uint8 cells as in :func:`splitnerf.ops.rays.march_rays`; they cover the network's box.
        network: The distance field.
        step: The length of a sample, scene units.
        s: The sharpness of the density, positive.
        anneal: The annealing of the cosine in [0, 1], see :func:`splitnerf.ops.rays.surface_weights`.
        min_weight: The rendering weight above which samples are kept, in [0, 1).
        min_transmittance: The transmittance at which a ray ends, in [0, 1).
        reach: The distance outside the surface beyond which the density vanishes, scene units.
        lipschitz: The bound on the length of the field's gradient.
        max_samples: The largest number of evaluated distances of one ray.
        capacity: If positive, the number of samples in the result, so that the host need not wait for a GPU's count. The last
            rays lose what does not fit. Zeros that belong to no ray fill it up.

    Returns:
        The kept samples; [n_rays] int64, the number of distances per ray that the search asked for (on a GPU more are
        evaluated: a group of neighbours at once); and [] int64, the number of samples that were found.
    """
    rules = step, max_samples, s, anneal, min_weight, min_transmittance, reach, lipschitz, capacity
    *samples, evaluated, found = lib.sample_rays(rays_o, rays_d, jitter, cells, *network.arguments(), *rules)
    return PackedSamples(*samples), evaluated, found


def _fake_sample(rays_o, rays_d, jitter, cells, table, *rest):
    n = rest[-1] or torch.library.get_ctx().new_dynamic_size()
    evaluated = rays_o.new_empty(rays_o.shape[0], dtype=torch.int64)
    return *_fake_packed(rays_o, n), evaluated, evaluated.new_empty(())


def _keep_field(ctx, inputs, output):
    """Saves the tensors, and with them the table's copy if there is one; the numbers are in between."""
    positions, table, *weights, stored = inputs
    ctx.save_for_backward(positions, table, *weights[:6], *([] if stored is None else [stored]))
    ctx.numbers = weights[6:]


def _field_backward(ctx, *grads):
    positions, table, *weights = ctx.saved_tensors
    stored = weights[6:]
    refuse_gradients(ctx, "sdf_field", positions=0)
    refuse_rounded_gradients(ctx, "sdf_field", table, stored, 15)
    found = lib.sdf_field_backward(positions, *(stored or [table]), *weights[:6], *ctx.numbers, *grads)
    return None, *found, *(None for _ in ctx.numbers), None


register(
    "sdf_field",
    fake=lambda positions, table, hidden, length, bias, out, *rest: (
        positions.new_empty(positions.shape[0], out.shape[0]),
        positions.new_empty(positions.shape[0], hidden.shape[1] - 3),
        positions.new_empty(positions.shape),
    ),
    setup_context=_keep_field,
    backward=_field_backward,
)
register(
    "sdf_field_backward", fake=lambda positions, *tensors: tuple(positions.new_empty(t.shape) for t in tensors[:7])
)
register("sdf_values", fake=lambda positions, *rest: positions.new_empty(positions.shape[0]))
register("sample_rays", fake=_fake_sample)
