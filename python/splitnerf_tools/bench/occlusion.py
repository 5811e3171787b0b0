"""Occlusion factors: rays or bits against error, and rays a second with other tracers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
import trimesh
from splitnerf.config import preset
from splitnerf.fields import Light, SkyCells, VisibilityBits
from splitnerf.ops import MeshScene, occlusion_factors
from splitnerf.ops.light import sample_ggx_lobe
from torch import Tensor
from torch.nn import functional as F

from splitnerf_tools.bench.charts import Chart, Result
from splitnerf_tools.bench.harness import chart_of, check, interleaved, rms
from splitnerf_tools.bench.subjects import MapLight, armadillo, bumpy_sphere, drjit_ready, lights, peer

OFFSET = 0.0125
ROUGHNESS = 0.3
ENVIRONMENT_HEIGHT = 128
DISAGREEMENT = 1e-3  # share of rays that two tracers may answer differently: they graze a triangle
SOURCES = (
    "cpp/*occlusion*",
    "cpp/*visibility*",
    "cpp/*scene*",
    "python/splitnerf/ops/visibility.py",
    "python/splitnerf/fields/occlusion.py",
)
LARGE = 500  # columns and rows of the mesh of 500k triangles


class SurfacePoints:
    """Points on a mesh's faces with interpolated normals, mirror directions of random views, and the light above them."""

    def __init__(self, mesh: trimesh.Trimesh, n: int, environment: np.ndarray):
        self.vertices = torch.from_numpy(mesh.vertices.astype(np.float32))
        self.faces = torch.from_numpy(mesh.faces.astype(np.int64))
        self.scene = MeshScene(self.vertices.numpy(), mesh.faces)
        corners = self.faces[torch.multinomial(torch.from_numpy(mesh.area_faces), n, replacement=True)]
        shares = torch.distributions.Dirichlet(torch.ones(3)).sample((n, 1))
        normals = torch.from_numpy(np.array(mesh.vertex_normals, np.float32))
        self.positions = (shares @ self.vertices[corners])[:, 0]
        self.normals = F.normalize((shares @ normals[corners])[:, 0], dim=1)
        views = F.normalize(self.normals + 0.7 * F.normalize(torch.randn(n, 3), dim=1), dim=1)
        self.axes = 2 * (views * self.normals).sum(1, keepdim=True) * self.normals - views
        self.roughness = torch.full((n, 1), ROUGHNESS)
        level = next(x for x in MapLight(environment).levels if len(x) <= ENVIRONMENT_HEIGHT)
        self.environment = level.contiguous()
        self.light = MapLight(level.numpy())

    def traced(self, n_diffuse: int, n_specular: int, seed: int = 0) -> tuple[Tensor, Tensor]:
        return occlusion_factors(
            self.scene,
            self.positions,
            self.normals,
            lobe_dirs=self.axes,
            roughness=self.roughness,
            environment=self.environment,
            n_diffuse_rays=n_diffuse,
            n_specular_rays=n_specular,
            offset=OFFSET,
            seed=seed,
            n_channels=3,
        )


def run(quick: bool, rounds: int) -> Result:
    """Error of the factors against time, then rays a second, on one mesh of 100k and one of 500k triangles; `quick`: with one
    light, fewer points, and Open3D as the only other tracer. Raises CheckFailed where the tracers disagree."""
    torch.manual_seed(0)
    mesh = armadillo()
    environments = lights()
    charts = []
    for name in list(environments)[-1:] if quick else environments:
        charts += error_charts(name, SurfacePoints(mesh, 500 if quick else 2000, environments[name]), quick, rounds)
    environment = environments[next(iter(environments))]
    findings, rows = [], []
    meshes = {f"{len(mesh.faces)} triangles": mesh}
    if not quick:
        vertices, faces = bumpy_sphere(LARGE)
        meshes[f"{len(faces)} triangles"] = trimesh.Trimesh(vertices, faces, process=False)
    for name, shape in meshes.items():
        found, more = ray_rates(name, SurfacePoints(shape, 4000 if quick else 20000, environment), quick, rounds)
        findings += found
        rows += more
    table = ("Rays a second", ["mesh", "tracer", "Mrays/s", "what is timed"], rows)
    return Result("occlusion", "Occlusion: time against error", SOURCES, findings, charts, [table])


def error_charts(light_name: str, points: SurfacePoints, quick: bool, rounds: int) -> list[Chart]:
    """Charts of the errors of o_d and o_s by rays and by bits, against a reference with many rays."""
    n_true = 1024 if quick else 4096
    true = [torch.stack([points.traced(n_true, n_true, seed)[k] for seed in range(2)]).mean(0) for k in (0, 1)]
    calls: dict[tuple[str, str], Callable[[], tuple[Tensor, Tensor]]] = {}
    for n in (16, 64) if quick else (4, 16, 64, 256):
        calls["lattice rays", f"n = {n}"] = lambda n=n: points.traced(n, n, seed=7)
        calls["independent rays", f"n = {n}"] = lambda n=n: independent(points, n)
    for n in (256,) if quick else (64, 128, 256, 512, 1024):
        cells, mesh = SkyCells(n), (points.scene, points.vertices, points.faces)
        bits = VisibilityBits.trace(*mesh, cells.centres, offset=OFFSET, n_channels=3, indirect=False)
        bits.light = cells.light(EnvironmentOf(points.light)).radiance
        calls["bits", f"k = {n}"] = lambda bits=bits: bits(
            points.positions, points.normals, points.axes, points.roughness
        )[:2]
    with torch.no_grad():
        errors = {key: [rms(a - b) for a, b in zip(call(), true)] for key, call in calls.items()}
        times = interleaved(calls, rounds)
    cost, default = (
        f"ms for {len(points.positions)} points, both factors",
        f"k = {preset('cpu').constants.occlusion_directions}",
    )
    return [
        chart_of(
            f"{factor}, {light_name} light",
            cost,
            "RMS error",
            times,
            {key: pair[k] for key, pair in errors.items()},
            {("bits", default)},
        )
        for k, factor in enumerate(("o_d", f"o_s at roughness {ROUGHNESS:g}"))
    ]


class EnvironmentOf(Light):
    """A map as the light that weighs the visibility bits."""

    def __init__(self, light: MapLight):
        super().__init__()
        self.light = light

    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        alpha2 = roughness[:, 0] ** 4
        return self.light.filtered(directions, 4 * np.pi * alpha2)


def independent(points: SurfacePoints, n: int) -> tuple[Tensor, Tensor]:
    """Independent cosine-weighted and lobe-weighted rays, traced and summed step by step."""
    count = len(points.positions)
    normals = points.normals[:, None]
    cosine = F.normalize(normals + F.normalize(torch.randn(count, n, 3), dim=-1), dim=-1)
    lobe = sample_ggx_lobe(points.axes, points.roughness, n, int(torch.randint(1 << 30, ())))
    origins = (points.positions + OFFSET * points.normals)[:, None].expand(count, n, 3).reshape(-1, 3)
    factors = []
    for directions in (cosine, lobe):
        flat = directions.reshape(-1, 3)
        radiance = points.light(flat).view(count, n, 3) * ((directions * normals).sum(-1, keepdim=True) > 0)
        seen = points.scene.is_open(origins, flat).view(count, n, 1)
        factors.append((radiance * seen).sum(1) / radiance.sum(1).clamp(min=1e-12))
    return factors[0], factors[1]


def ray_rates(name: str, points: SurfacePoints, quick: bool, rounds: int) -> tuple[list[str], list[list[object]]]:
    """Mrays/s of our factors, with the making and summing of rays, beside tracers that get rays of the same lobes."""
    n, half = len(points.positions), preset("cpu").constants.occlusion_rays
    cosine = F.normalize(points.normals[:, None] + F.normalize(torch.randn(n, half, 3), dim=-1), dim=-1)
    lobes = sample_ggx_lobe(points.axes, points.roughness, half, seed=0)
    directions = torch.cat([cosine, lobes], dim=1).reshape(-1, 3)
    starts = points.positions + OFFSET * points.normals
    origins = starts[:, None].expand(n, 2 * half, 3).reshape(-1, 3).contiguous()
    seen = points.scene.is_open(origins, directions)
    tracers = {"Open3D test_occlusions": open3d_tracer} | (
        {} if quick else {"trimesh + embreex": embreex_tracer, "mitsuba ray_test": mitsuba_tracer}
    )
    calls: dict[str, Callable[[], object]] = {
        "splitnerf occlusion_factors": lambda: points.traced(half, half),
        "splitnerf is_open": lambda: points.scene.is_open(origins, directions),
    }
    for tracer, make in tracers.items():
        call = make(points, origins, directions)
        if call is None:
            continue
        differing = float((torch.from_numpy(np.asarray(call(), bool)) == seen).float().mean())
        check("share of the rays that is_open answers otherwise", {tracer: differing}, DISAGREEMENT)
        calls[tracer] = call
    times = interleaved(calls, rounds)
    factors, traced = list(calls)[:2]
    above = float(((directions.view(n, -1, 3) * points.normals[:, None]).sum(-1) > 0).float().mean())
    what = {factors: "rays made in the lattice's order, those above the horizon traced and counted, weighed and summed"}
    given = "tracing of given rays, independent of one another"
    rates = {call: (above if call == factors else 1) * len(origins) / times[call].median / 1e6 for call in calls}
    rows = [[name, call, f"{rate:.1f}", what.get(call, given)] for call, rate in rates.items()]
    ratios = {call: times.ratio(call, traced) for call in list(calls)[2:]}
    findings = [
        f"{name}: {traced} traces {ratio.median:.2f}x ({ratio.low:.2f} to {ratio.high:.2f}) as many given rays a second as {call}"
        for call, ratio in ratios.items()
    ]
    return findings, rows


def open3d_tracer(points: SurfacePoints, origins: Tensor, directions: Tensor) -> Callable[[], np.ndarray] | None:
    open3d = peer("open3d", "its tracer")
    if open3d is None:
        return None
    scene = open3d.t.geometry.RaycastingScene(nthreads=torch.get_num_threads())
    scene.add_triangles(points.vertices.numpy(), points.faces.numpy().astype(np.uint32))
    rays = open3d.core.Tensor(torch.cat([origins, directions], 1).numpy())
    return lambda: scene.test_occlusions(rays, nthreads=torch.get_num_threads()).numpy()


def embreex_tracer(points: SurfacePoints, origins: Tensor, directions: Tensor) -> Callable[[], np.ndarray] | None:
    if peer("embreex", "trimesh's tracer") is None:
        return None
    mesh = trimesh.Trimesh(points.vertices.numpy(), points.faces.numpy(), process=False)
    o, d = origins.numpy(), directions.numpy()
    return lambda: mesh.ray.intersects_any(o, d)


def mitsuba_tracer(points: SurfacePoints, origins: Tensor, directions: Tensor) -> Callable[[], np.ndarray] | None:
    mitsuba = peer("mitsuba", "its tracer")
    if mitsuba is None or not drjit_ready():
        return None
    import drjit

    mitsuba.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(torch.get_num_threads())
    mesh = mitsuba.Mesh("mesh", len(points.vertices), len(points.faces))
    params = mitsuba.traverse(mesh)
    params["vertex_positions"] = points.vertices.numpy().ravel()
    params["faces"] = points.faces.numpy().astype(np.uint32).ravel()
    params.update()
    scene = mitsuba.load_dict({"type": "scene", "mesh": mesh, "embree_use_robust_intersections": True})  # as ours
    o, d = (mitsuba.Point3f(*(x[:, k].numpy() for k in range(3))) for x in (origins, directions))
    ray = mitsuba.Ray3f(o, mitsuba.Vector3f(d))
    drjit.eval(ray)

    def call() -> np.ndarray:
        hit = scene.ray_test(ray)
        drjit.eval(hit)
        drjit.sync_thread()
        return hit.numpy()

    return call
