"""The path tracer: time against error, with Mitsuba 3, on one textured asset.

Both trace the same triangles, textures (base colour, roughness, metallic; no normal map), light and camera, with
next-event estimation, multiple importance sampling and paths of up to 5 scattering events. Mitsuba's BSDF is
``principled``, whose details differ. So each renderer is compared with its own converged image; the difference of these
images is reported too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from splitnerf import _core
from splitnerf.data.asset import Asset, Material
from splitnerf.data.gltf import read_asset

from splitnerf_tools.bench.charts import Result
from splitnerf_tools.bench.harness import Quartiles, chart_of, check, interleaved, rms
from splitnerf_tools.bench.subjects import bumpy_sphere, data_folder, drjit_ready, lights, peer
from splitnerf_tools.synth.orbits import orbit

SCATTERINGS = 5
ANGLE_X = 0.69  # radians
POSE = orbit(9, distance=3.0, elevation=25.0, start=1.0)[0]
BATCH = 256  # samples per pixel at a time: a wavefront of all samples would not fit into memory
APART = 0.05  # largest RMS difference of two converged images that details of the BSDFs may explain
SEEDS = 3  # images whose errors are averaged
SOURCES = ("cpp/*path_tracer*", "cpp/*principled*", "cpp/*environment_sampler*", "cpp/*texture*", "cpp/*scene*")
INSIDE = 0.99  # least alpha of the foreground

Render = Callable[[int, int], tuple[np.ndarray, np.ndarray]]  # samples a pixel, seed -> radiance and alpha


def run(quick: bool, rounds: int) -> Result:
    """Root mean square error of linear radiance, clipped to [0, 1], over the foreground, by samples a pixel.

    Args:
        quick: Whether to use a smaller image and fewer samples, without Mitsuba.
        rounds: The number of timing rounds.

    Raises:
        CheckFailed: Two renderers converge to different images.
    """
    size, samples, converged = (64, (4, 16, 64), 512) if quick else (128, (4, 16, 64, 256), 2048)
    asset = subject()
    name, light = list(lights().items())[0]
    renderers: dict[str, Render] = {"splitnerf": our_renderer(asset, light, size)}
    if not quick and peer("mitsuba", "its path tracer") is not None:
        variants = ["scalar_rgb"] + (["llvm_ad_rgb"] if drjit_ready() else [])
        renderers |= {f"Mitsuba {v}": mitsuba_renderer(v, asset, light, size) for v in variants}
    means, findings = {}, []
    for way, render in renderers.items():
        images = [render(BATCH, 1000 + i) for i in range(converged // BATCH)]
        means[way] = tuple(np.mean([image[k] for image in images], axis=0) for k in range(2))
    image, inside = (np.clip(means["splitnerf"][0], 0, 1), means["splitnerf"][1] > INSIDE)
    for way in (w for w in renderers if w != "splitnerf"):
        apart = rms((np.clip(means[way][0], 0, 1) - image)[inside & (means[way][1] > INSIDE)])
        check("path tracer: RMS from its converged image", {way: apart}, APART)
        findings.append(f"converged images of splitnerf and {way} differ by {apart:.4f} (RMS)")
    errors = {
        (way, f"{n} spp"): float(np.mean([error_of(render(n, seed), means[way]) for seed in range(SEEDS)]))
        for way, render in renderers.items()
        for n in samples
    }
    # One renderer after the other: Mitsuba's variants are switched for the whole process, which takes time.
    times: dict[tuple[str, str], Quartiles] = {}
    for way, render in renderers.items():
        calls = {(way, f"{n} spp"): lambda n=n, r=render: r(n, SEEDS) for n in samples}
        found = interleaved(calls, max(3, rounds // 3))
        times |= {key: found[key] for key in calls}
    most = samples[-1]
    for way in (w for w in renderers if w != "splitnerf"):
        ours, theirs = (
            [(times[key].median, error) for key, error in errors.items() if key[0] == w] for w in ("splitnerf", way)
        )
        ratio = time_to(theirs, ours[-1][1]) / ours[-1][0]
        findings.append(f"{way} takes {ratio:.2f}x the time of splitnerf to the error that this has at {most} spp")
    paths = most * size * size / times["splitnerf", f"{most} spp"].median
    findings.insert(0, f"{paths / 1e6:.2f} M paths a second of up to {SCATTERINGS} scattering events")
    title = f"{asset.name}, {name} light, {size} x {size}"
    chart = chart_of(title, "s", "RMS error of radiance", times, errors, {("splitnerf", "64 spp")}, scale=1)
    return Result("path_tracer", "Path tracer: time against error", SOURCES, findings, [chart])


def time_to(curve: list[tuple[float, float]], error: float) -> float:
    """The time at which a renderer reaches an error, by the power law through the last two points of its curve."""
    (t0, e0), (t1, e1) = curve[-2:]
    return t1 * (error / e1) ** (np.log(t1 / t0) / np.log(e1 / e0))


def error_of(image: tuple[np.ndarray, np.ndarray], mean: tuple[np.ndarray, np.ndarray]) -> float:
    return rms((np.clip(image[0], 0, 1) - np.clip(mean[0], 0, 1))[mean[1] > INSIDE])


def subject() -> Asset:
    """The boombox of the data folder without its normal map, or a bumpy sphere with textures."""
    path = data_folder() / "scenes" / "boombox" / "asset.glb"
    if path.is_file():
        asset = replace(read_asset(path), name="boombox")
        for material in asset.materials:
            material.normal_texture = None
        return asset
    vertices, faces = bumpy_sphere(96)
    normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    uv = np.stack([0.5 + np.arctan2(vertices[:, 1], vertices[:, 0]) / (2 * np.pi), np.arccos(normals[:, 2]) / np.pi], 1)
    random = np.random.default_rng(0)
    material = Material(
        albedo_texture=random.random((16, 32, 3), np.float32) * 0.8,
        roughness_metallic_texture=0.2 + 0.6 * random.random((16, 32, 2), np.float32),
    )
    ids = np.zeros(len(faces), np.int32)
    return Asset("bumpy sphere", vertices, faces, normals, ids, [material], uv=uv.astype(np.float32))


def our_renderer(asset: Asset, light: np.ndarray, size: int) -> Render:
    n, scene = len(asset.vertices), _core.Scene(asset.vertices, asset.triangles)
    focal = 0.5 * size / np.tan(0.5 * ANGLE_X)
    materials = _core.Materials(list(asset.materials))

    def render(spp: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        out = _core.render(
            scene,
            np.ones((n, 3), np.float32),
            np.ones(n, np.float32),
            np.ones(n, np.float32),
            light,
            POSE[:3].astype(np.float32),
            focal,
            focal,
            size / 2,
            size / 2,
            size,
            size,
            normals=asset.normals,
            materials=materials,
            material_ids=asset.material_ids,
            uv=asset.uv,
            spp=spp,
            max_bounces=SCATTERINGS - 1,
            seed=seed,
        )
        return out["radiance"], out["alpha"]

    return render


def mitsuba_renderer(variant: str, asset: Asset, light: np.ndarray, size: int) -> Render:
    import drjit
    import mitsuba as mi

    mi.set_variant(variant)
    drjit.set_thread_count(torch.get_num_threads())
    scene = mi.load_dict(
        {
            "type": "scene",
            "mesh": mitsuba_mesh(mi, asset),
            "integrator": {
                "type": "path",
                "max_depth": SCATTERINGS + 1,
                "rr_depth": SCATTERINGS,
                "hide_emitters": True,
            },
            # Its maps have the pole along +y; u runs as Blender's after a quarter turn.
            "light": {
                "type": "envmap",
                "bitmap": mi.Bitmap(light),
                "to_world": mi.ScalarTransform4f().rotate([0, 0, 1], 90) @ mi.ScalarTransform4f().rotate([1, 0, 0], 90),
            },
            "sensor": {
                "type": "perspective",
                "fov": float(np.degrees(ANGLE_X)),
                "fov_axis": "x",
                # Its cameras look along +z with x to the left.
                "to_world": mi.ScalarTransform4f(POSE) @ mi.ScalarTransform4f().scale([-1, 1, -1]),
                "film": {
                    "type": "hdrfilm",
                    "width": size,
                    "height": size,
                    "pixel_format": "rgba",
                    "rfilter": {"type": "box"},
                },
                "sampler": {"type": "multijitter", "sample_count": 64},
            },
        }
    )

    def render(spp: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
        if mi.variant() != variant:
            mi.set_variant(variant)
        image = np.array(mi.render(scene, spp=spp, seed=seed))
        return image[..., :3], image[..., 3]

    return render


def mitsuba_mesh(mi, asset: Asset):
    """The asset's first material on all of its triangles."""
    material = asset.materials[0]

    def texture(values: np.ndarray | None, factor, channels: int) -> dict:
        values = np.ones((1, 1, channels), np.float32) if values is None else values
        bitmap = mi.Bitmap(np.ascontiguousarray(values * np.float32(factor)))
        return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear"}

    orm = material.roughness_metallic_texture
    bsdf = {
        "type": "principled",
        "specular": 0.5,
        "base_color": texture(material.albedo_texture, material.albedo, 3),
        "roughness": texture(None if orm is None else orm[..., :1], material.roughness, 1),
        "metallic": texture(None if orm is None else orm[..., 1:], material.metallic, 1),
    }
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict({"type": "twosided", "bsdf": bsdf})
    counts = len(asset.vertices), len(asset.triangles)
    mesh = mi.Mesh("asset", *counts, has_vertex_normals=True, has_vertex_texcoords=True, props=properties)
    params = mi.traverse(mesh)
    params["vertex_positions"] = asset.vertices.ravel()
    params["vertex_normals"] = asset.normals.ravel()
    params["vertex_texcoords"] = asset.uv.ravel()  # rows of a bitmap run downward, as glTF's v does
    params["faces"] = asset.triangles.ravel().astype(np.uint32)
    params.update()
    return mesh
