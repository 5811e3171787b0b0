"""Normals of a distance field: the analytic gradient and finite differences, time against angle.

The field is fitted to a surface with known normals, so that two errors can be measured: that against the field's own
gradient in float64, and that against the fitted surface.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from splitnerf.fields import SdfField
from splitnerf.ops import HashGridSpec
from torch import Tensor
from torch.nn import functional as F

from splitnerf_tools.bench.charts import Result
from splitnerf_tools.bench.harness import chart_of, check, interleaved

BOX = 1.5
SPEC = HashGridSpec(n_levels=9, n_features=2, base_resolution=16, growth=1.4697344922755988, log2_table_size=16)
CELLS = (0.01, 0.1, 0.25, 0.5, 1.0, 2.0)  # eps of the differences, in finest cells
METHOD_CELLS = 1.0  # of normals = finite_difference
TOLERANCE = 0.5  # degrees in the mean, between the analytic gradient in float32 and in float64
SOURCES = ("cpp/*hash*", "cpp/*sdf*", "python/splitnerf/fields/sdf.py", "python/splitnerf/ops/hash_grid.py")
AMPLITUDE, FREQUENCY = 0.04, 9.0  # of the bumps on the sphere

Gradient = Callable[[SdfField, Tensor], Tensor]


def run(quick: bool, rounds: int) -> Result:
    """Fits a field, then measures its gradients on the surface: the angle to the truth, the time without and with the
    backward pass.

    Args:
        quick: Whether to use fewer points and a rougher fit.
        rounds: The number of timing rounds.

    Raises:
        CheckFailed: The analytic gradient is wrong.
    """
    torch.manual_seed(0)
    n, steps = (4096, 300) if quick else (16384, 1500)
    field = fitted(steps)
    positions = on_surface(n)
    true_surface = surface_gradient(positions)
    exact = analytic(field.double(), positions.double())
    field.float()
    ways: dict[tuple[str, str], Gradient] = {("analytic", ""): analytic}
    for cells in CELLS:
        ways["finite differences", f"eps = {cells:g} cells"] = lambda f, x, c=cells: finite_differences(f, x, c)
    with torch.no_grad():
        found = {key: way(field, positions) for key, way in ways.items()}
    from_field = {key: angle(normals, exact) for key, normals in found.items()}
    from_surface = {key: angle(normals, true_surface) for key, normals in found.items()}
    first, shipped = ("analytic", ""), ("finite differences", f"eps = {METHOD_CELLS:g} cells")
    check("normals, degrees from float64", {first: from_field[first]}, TOLERANCE)
    charts, findings = [], []
    for title, training in (("one view's pixels", False), ("one step, gradients to the field", True)):
        calls = {key: timed(way, field, positions, training) for key, way in ways.items()}
        times = interleaved(calls, rounds)
        findings.append(f"{title}: {times.ratio(shipped, first)} as fast as finite differences")
        for against, errors in (("the field's gradient in float64", from_field), ("the surface", from_surface)):
            named = (f"{title}: angle to {against}", f"ms for {n} points", "mean angle, degrees")
            charts.append(chart_of(*named, times, errors, {first}))
    findings += [
        f"angle to {what}: analytic {errors[first]:.3g} degrees, finite differences of one cell {errors[shipped]:.3g}"
        for what, errors in (("the field's gradient in float64", from_field), ("the surface", from_surface))
    ]
    return Result("normals", "Normals of the distance field: time against angle", SOURCES, findings, charts)


def surface(x: Tensor) -> Tensor:
    """[n]: an implicit function of a sphere with bumps, zero on it, and of about unit slope."""
    return x.norm(dim=1) - 0.8 - AMPLITUDE * torch.sin(FREQUENCY * x).prod(1)


def surface_gradient(x: Tensor) -> Tensor:
    leaf = x.detach().double().requires_grad_()
    with torch.enable_grad():
        (gradient,) = torch.autograd.grad(surface(leaf).sum(), leaf)
    return gradient


def on_surface(n: int) -> Tensor:
    """[n, 3] float32 points, by Newton steps along the gradient."""
    x = 0.8 * F.normalize(torch.randn(n, 3, dtype=torch.float64), dim=1)
    for _ in range(8):
        gradient = surface_gradient(x)
        x = x - (surface(x) / gradient.square().sum(1))[:, None] * gradient
    return x.float()


def fitted(steps: int) -> SdfField:
    """A field of the preset ``cpu``'s shape, fitted to the surface from points near it."""
    field = SdfField(SPEC, BOX)
    optimiser = torch.optim.Adam(field.parameters(), lr=0.01, eps=1e-15)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps, 1e-4)
    near = on_surface(1 << 16)
    for _ in range(steps):
        points = near[torch.randint(len(near), (4096,))] + 0.03 * torch.randn(4096, 3)
        error = field.sdf(points) - surface(points)
        optimiser.zero_grad()
        error.abs().mean().backward()
        optimiser.step()
        schedule.step()
    return field


def analytic(field: SdfField, positions: Tensor) -> Tensor:
    return field.sample(positions).gradient


def finite_differences(field: SdfField, positions: Tensor, cells: float) -> Tensor:
    return field.sample_finite_difference(positions, cells).gradient


def timed(way: Gradient, field: SdfField, positions: Tensor, training: bool) -> Callable[[], object]:
    """A call that computes the field's gradients and, with `training`, the eikonal loss's backward pass."""
    parameters = tuple(field.parameters())

    def render() -> Tensor:
        with torch.no_grad():
            return way(field, positions)

    def train() -> tuple[Tensor, ...]:
        loss = (way(field, positions).norm(dim=1) - 1).square().mean()
        return torch.autograd.grad(loss, parameters, allow_unused=True)

    return train if training else render


def angle(a: Tensor, b: Tensor) -> float:
    """Mean angle between two sets of vectors, degrees."""
    a, b = (F.normalize(v.detach().double(), dim=1) for v in (a, b))
    return float(torch.rad2deg(2 * torch.asin((0.5 * (a - b).norm(dim=1)).clamp(max=1))).mean())
