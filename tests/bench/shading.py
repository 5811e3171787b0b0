"""Split-sum shading and the pre-integration operator beside torch eager and torch.compile, and the memory's
bandwidth."""

from collections.abc import Callable

import reference
import torch
from splitnerf.ops import fibonacci_directions, prefilter_light, split_sum_shade
from splitnerf.ops.shading import SHADED, brdf_lut
from splitnerf_tools.bench.charts import Result
from splitnerf_tools.bench.harness import chart_of, check, interleaved, with_gradients
from splitnerf_tools.bench.subjects import leave_out
from torch import Tensor
from torch.nn import functional as F

TOLERANCE = 1e-3  # error of results and gradients, relative to the largest value
FLOATS_A_POINT = 23 + 3  # read forward and written
SOURCES = ("cpp/*split_sum*", "cpp/*shad*", "cpp/*prefilter*")
SOURCES += ("python/splitnerf/ops/shading.py", "python/splitnerf/ops/light.py")
FLOATS_BACK = 26 + 23  # read backward and written


def run(quick: bool, rounds: int) -> Result:
    """Times forward and backward passes, after a comparison of results and gradients with float64.

    Args:
        quick: Whether to use fewer points and directions, without torch.compile.
        rounds: The number of timing rounds.

    Raises:
        CheckFailed: A result or a gradient is wrong.
    """
    torch.manual_seed(0)
    charts, findings = [], []
    sizes, n_lights = ((1 << 13, 1 << 15), 2048) if quick else ((1 << 13, 1 << 18), 8192)
    subjects = {f"split-sum shading, {n} points": (n, shading_calls(n, compiled=not quick)) for n in sizes}
    subjects[f"gbar with gradient, 512 queries, {n_lights} light directions"] = (0, prefilter_calls(512, n_lights))
    for title, (n, (calls, errors)) in subjects.items():
        extra = {"copy": copy_of(n * FLOATS_A_POINT)} if n else {}
        times = interleaved(calls | extra, rounds)
        keyed = {(name, ""): error for name, error in errors.items()}
        named = title, "ms forward and backward", "largest relative RMS error"
        charts.append(chart_of(*named, {key: times[key[0]] for key in keyed}, keyed, {("splitnerf", "")}))
        findings += [
            f"{title}: {times.ratio(name, 'splitnerf')} as fast as {name}" for name in calls if name != "splitnerf"
        ]
        if extra:
            moved = n * (FLOATS_A_POINT + FLOATS_BACK) * 4
            rate, copy_rate = moved / times["splitnerf"].median, 2 * n * FLOATS_A_POINT * 4 / times["copy"].median
            findings.append(
                f"{title}: {rate / 1e9:.1f} GB/s of inputs, results and gradients, {rate / copy_rate:.0%} of what a copy moves"
            )
    return Result("shading", "Shading and pre-integration: time against error", SOURCES, findings, charts)


def shading_calls(n: int, compiled: bool) -> tuple[dict[str, Callable[[], object]], dict[str, float]]:
    inputs = shading_inputs(n)
    lut = brdf_lut()

    def plain(*leaves: Tensor) -> Tensor:
        return reference.split_sum_shade(*leaves, lut, 0, True)

    def ours(*leaves: Tensor) -> Tensor:
        return split_sum_shade(**dict(zip(SHADED, leaves)), compensate=True)

    ways = {"splitnerf": ours, "torch eager": plain}
    if compiled:
        torch.compiler.reset()
        fast = torch.compile(plain, dynamic=False)
        try:
            with_gradients(fast, inputs, torch.ones(n, 3))()
            ways["torch.compile"] = fast
        except Exception as error:  # its compiler raises many types
            leave_out(f"torch.compile does not work here ({str(error).splitlines()[0]}): it is left out")
    return checked(ways, plain, inputs)


def prefilter_calls(n_queries: int, n_lights: int) -> tuple[dict[str, Callable[[], object]], dict[str, float]]:
    queries = F.normalize(torch.randn(n_queries, 3), dim=1)
    roughness = 0.2 + 0.8 * torch.rand(n_queries, 1)
    directions = fibonacci_directions(n_lights)
    light = (torch.rand(n_lights, 3),)

    def plain(light: Tensor) -> Tensor:
        return reference.prefilter_light(*(t.to(light.dtype) for t in (queries, roughness, directions)), light)

    def ours(light: Tensor) -> Tensor:
        return prefilter_light(queries, roughness, light_dirs=directions, light=light)

    return checked({"splitnerf": ours, "torch eager": plain}, plain, light)


def shading_inputs(n: int) -> tuple[Tensor, ...]:
    normals, views = (F.normalize(torch.randn(n, 3), dim=1) for _ in range(2))
    return normals, views, *(torch.rand(n, columns) for columns in (3, 1, 1, 3, 3, 3, 3))


def checked(
    ways: dict[str, Callable[..., Tensor]], true: Callable[..., Tensor], inputs: tuple[Tensor, ...]
) -> tuple[dict[str, Callable[[], object]], dict[str, float]]:
    """Calls with gradients of all inputs, and their root mean square errors against `true` in float64.

    Raises:
        CheckFailed: A result or a gradient is wrong.
    """
    cotangent = torch.randn_like(true(*inputs))
    exact = with_gradients(true, tuple(x.double() for x in inputs), cotangent.double())()
    calls, errors = {}, {}
    for name, way in ways.items():
        calls[name] = with_gradients(way, inputs, cotangent)
        apart = [(a - b).square().mean().sqrt() / b.square().mean().sqrt() for a, b in zip(calls[name](), exact)]
        errors[name] = float(max(apart))
    check("relative to float64", errors, TOLERANCE)
    return calls, errors


def copy_of(n_floats: int) -> Callable[[], object]:
    source, target = torch.rand(n_floats), torch.empty(n_floats)
    return lambda: target.copy_(source)
