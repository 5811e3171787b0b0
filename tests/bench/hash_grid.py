"""The hash grid encoding: throughput forward and backward, beside plain torch and Dr.Jit."""

from collections.abc import Callable
from functools import partial

import reference
import torch
from splitnerf.ops import HashGridSpec, hash_encode
from splitnerf_tools.bench.charts import Result
from splitnerf_tools.bench.harness import chart_of, check, interleaved, with_gradients
from splitnerf_tools.bench.subjects import drjit_ready, leave_out
from torch import Tensor

SPEC = HashGridSpec(n_levels=16, n_features=2, base_resolution=32, growth=1.3195079, log2_table_size=19)
TOLERANCE = 1e-3  # difference between ours and plain torch, relative to the largest value
SOURCES = ("cpp/*hash*", "python/splitnerf/ops/sdf.py")


def run(quick: bool, rounds: int) -> Result:
    """Forward and backward of 16 levels x 2 features, 2^19 entries a level, on random points.

    Args:
        quick: Whether to use fewer points and leave out Dr.Jit, which takes a minute to compile.
        rounds: The number of timing rounds.

    Raises:
        CheckFailed: A result is wrong.
    """
    torch.manual_seed(0)
    n = 1 << (15 if quick else 17)
    x, cotangent = torch.rand(n, 3), torch.randn(n, SPEC.n_outputs)
    table = 0.1 * torch.randn(SPEC.n_entries, SPEC.n_features)
    arguments = SPEC.arguments(SPEC.n_levels)

    def ours(x: Tensor, table: Tensor) -> Tensor:
        return hash_encode(x, table, SPEC)

    def plain(x: Tensor, table: Tensor) -> Tensor:
        return reference.hash_encode(x, table, *arguments)

    def way(encode: Callable[[Tensor, Tensor], Tensor], dtype: torch.dtype) -> Callable[[], tuple]:
        at, leaf, grad = (t.to(dtype) for t in (x, table, cotangent))
        return with_gradients(partial(encode, at), (leaf,), grad)

    true = way(plain, torch.float64)()
    calls: dict[tuple[str, str], Callable[[], object]] = {
        ("splitnerf", "float32"): way(ours, torch.float32),
        ("splitnerf", "float64"): way(ours, torch.float64),
        ("torch eager", "float32"): way(plain, torch.float32),
    }
    errors = {key: max(relative(a, b) for a, b in zip(call(), true)) for key, call in calls.items()}
    check("hash grid", errors, TOLERANCE)
    if not quick and drjit_ready():
        for storage in ("Float32", "Float16"):
            peer = DrJitHashGrid(SPEC, storage, x, cotangent)
            try:
                peer.forward_backward()
                calls["Dr.Jit", storage.lower()] = peer.forward_backward
            except RuntimeError as error:
                leave_out(f"Dr.Jit with {storage.lower()} is left out: {str(error).splitlines()[0]}")
    times = interleaved(calls, rounds)

    first, peer = ("splitnerf", "float32"), ("torch eager", "float32")
    findings = [f"forward and backward of {n} points: {times.ratio(peer, first)} as fast as torch eager"]
    findings += [f"{times.ratio(key, first)} as fast as Dr.Jit with {key[1]}" for key in calls if key[0] == "Dr.Jit"]
    title, cost = f"{n} points, 16 levels x 2, 2^19 entries", "ms forward and backward"
    chart = chart_of(title, cost, "largest error, of the largest value", times, errors, {first})
    rows = [
        [*key, f"{1e3 * times[key].median:.1f}", f"{1e3 * times[key].low:.1f} to {1e3 * times[key].high:.1f}"]
        for key in calls
    ]
    beside = ("Time of peers; Dr.Jit has a grid of its own", ["", "dtype", "ms", "quartiles"], rows)
    return Result("hash_grid", "Hash grid encoding: time against error", SOURCES, findings, [chart], [beside])


def relative(a: Tensor, true: Tensor) -> float:
    """The largest difference, relative to the largest true value."""
    return float((a.double() - true).abs().max() / true.abs().max())


class DrJitHashGrid:
    """Dr.Jit's encoding of a grid of the same shape, with a random table of its own.

    Its nodes are shifted by half a cell, so that its features differ from ours and only times can be compared.

    Args:
        spec: The shape of the grid.
        storage: The type of table and features, ``Float16`` or ``Float32``.
        positions: [n, 3] points in [0, 1].
        cotangent: [n, C] gradient of the features.
    """

    def __init__(self, spec: HashGridSpec, storage: str, positions: Tensor, cotangent: Tensor):
        import drjit
        from drjit.llvm import ad
        from drjit.nn import HashGridEncoding

        self.drjit, kind = drjit, getattr(ad, storage)
        self.grid = HashGridEncoding(
            kind,
            3,
            n_levels=spec.n_levels,
            n_features_per_level=spec.n_features,
            hashmap_size=2**spec.log2_table_size,
            base_resolution=spec.base_resolution,
            per_level_scale=spec.growth,
            init_scale=0.1,
        )
        self.positions = ad.ArrayXf(positions.T.contiguous().numpy())
        self.cotangent = [kind(column.numpy()) for column in cotangent.T.contiguous()]
        drjit.eval(self.positions, self.cotangent, self.grid.data)

    def forward_backward(self) -> None:
        """Features, and the gradient to the table."""
        dr = self.drjit
        dr.enable_grad(self.grid.data)
        dr.set_grad(self.grid.data, 0)
        features = self.grid(self.positions)
        dr.backward(dr.sum(sum(f * g for f, g in zip(features, self.cotangent))))
        dr.eval(*features, dr.grad(self.grid.data))
        dr.sync_thread()
        dr.disable_grad(self.grid.data)
