"""The path tracer beside Mitsuba 3: time to an equal error on one textured asset, in one run.

    python tests/bench/path_tracer_mitsuba.py ASSET.glb LIGHT.hdr [--size 200] [--spp 64]

Both trace the same triangles, textures (base colour, roughness, metallic; no normal map), light and camera with
next-event estimation, multiple importance sampling and paths of up to 5 scattering events. Mitsuba's BSDF is
`principled`. Each is compared with its own converged image (the models differ in detail), by the root mean square
of the difference of linear radiance clipped to [0, 1], over foreground pixels. Error falls with the square root of
the samples, so the time to our error is t (error / our error)^2. Mitsuba does not count rays: its Mrays/s are our
rays a sample at its samples a second. Needs `pip install mitsuba`; llvm_ad_rgb needs an LLVM library
(DRJIT_LIBLLVM_PATH).
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from splitnerf import _core
from splitnerf.data.asset import Asset
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset

SCATTERINGS = 5
ANGLE_X = 0.69
DISTANCE = 3.0


def pose() -> np.ndarray:
    """A camera at an azimuth of 40 and an elevation of 25 degrees that looks at the origin, [3, 4]."""
    azimuth, elevation = np.radians(40), np.radians(25)
    back = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back, DISTANCE * back], axis=1).astype(np.float32)


def our_renderer(asset: Asset, light: np.ndarray, size: int):
    scene = _core.Scene(asset.vertices, asset.triangles)
    n = len(asset.vertices)
    focal = 0.5 * size / np.tan(0.5 * ANGLE_X)
    for material in asset.materials:
        material.normal_texture = None
    materials = _core.Materials(asset.materials)

    def render(spp: int, seed: int):
        out = _core.render(
            scene, np.ones((n, 3), np.float32), np.ones(n, np.float32), np.ones(n, np.float32), light, pose(), focal,
            focal, size / 2, size / 2, size, size, normals=asset.normals, materials=materials,
            material_ids=asset.material_ids, uv=asset.uv, spp=spp, max_bounces=SCATTERINGS - 1, seed=seed,
        )  # fmt: skip
        return out["radiance"], out["alpha"], out["rays"]

    return render


def mitsuba_renderer(variant: str, asset: Asset, light: np.ndarray, size: int):
    import mitsuba as mi

    mi.set_variant(variant)
    material = asset.materials[0]

    def texture(values: np.ndarray | None, factor, channels: int) -> dict:
        if values is None:
            values = np.ones((1, 1, channels), np.float32)
        bitmap = mi.Bitmap(np.ascontiguousarray(values * np.float32(factor)))
        return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear"}

    orm = material.roughness_metallic_texture
    bsdf = mi.load_dict({
        "type": "twosided",
        "bsdf": {
            "type": "principled", "specular": 0.5,
            "base_color": texture(material.albedo_texture, material.albedo, 3),
            "roughness": texture(None if orm is None else orm[..., :1], material.roughness, 1),
            "metallic": texture(None if orm is None else orm[..., 1:], material.metallic, 1),
        },
    })  # fmt: skip
    properties = mi.Properties()
    properties["mesh_bsdf"] = bsdf
    mesh = mi.Mesh("asset", len(asset.vertices), len(asset.triangles), has_vertex_normals=True,
                   has_vertex_texcoords=True, props=properties)  # fmt: skip
    params = mi.traverse(mesh)
    params["vertex_positions"] = asset.vertices.ravel()
    params["vertex_normals"] = asset.normals.ravel()
    params["vertex_texcoords"] = asset.uv.ravel()  # rows of a bitmap run downward, as glTF's v does
    params["faces"] = asset.triangles.ravel().astype(np.uint32)
    params.update()
    to_world = np.eye(4)
    to_world[:3] = pose()
    flip = mi.ScalarTransform4f().scale([-1, 1, -1])  # its cameras look along +z with x to the left
    # Its maps have the pole along +y; u runs as Blender's after a quarter turn.
    up = mi.ScalarTransform4f().rotate([0, 0, 1], 90) @ mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    scene = mi.load_dict({
        "type": "scene", "mesh": mesh,
        "integrator": {"type": "path", "max_depth": SCATTERINGS + 1, "rr_depth": SCATTERINGS, "hide_emitters": True},
        "light": {"type": "envmap", "bitmap": mi.Bitmap(light), "to_world": up},
        "sensor": {
            "type": "perspective", "fov": float(np.degrees(ANGLE_X)), "fov_axis": "x",
            "to_world": mi.ScalarTransform4f(to_world) @ flip,
            "film": {"type": "hdrfilm", "width": size, "height": size, "pixel_format": "rgba", "rfilter": {"type": "box"}},
            "sampler": {"type": "multijitter", "sample_count": 64},
        },
    })  # fmt: skip

    def render(spp: int, seed: int):
        mi.set_variant(variant)
        image = np.array(mi.render(scene, spp=spp, seed=seed))
        return image[..., :3], image[..., 3], 0

    return render


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("asset", type=Path)
    parser.add_argument("light", type=Path)
    parser.add_argument("--size", type=int, default=200)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--reference-spp", type=int, default=4096)
    parser.add_argument("--variants", nargs="*", default=["scalar_rgb", "llvm_ad_rgb"])
    args = parser.parse_args()
    asset, light = read_asset(args.asset), read_environment(args.light)
    renderers = {"splitnerf": our_renderer(asset, light, args.size)}
    renderers |= {name: mitsuba_renderer(name, asset, light, args.size) for name in args.variants}

    references, rows = {}, {}
    for name, render in renderers.items():
        if name == "splitnerf" or not name.startswith("scalar"):
            # Averaged over seeds: a wavefront of all samples at once would not fit into memory.
            n = max(1, args.reference_spp // 256)
            images = [render(256, 1000 + i)[:2] for i in range(n)]
            references[name] = [np.mean([image[k] for image in images], axis=0) for k in range(2)]
    peer = next((references[n] for n in references if n != "splitnerf"), None)
    for name, render in renderers.items():
        radiance, alpha = references.get(name, peer)
        mask = alpha > 0.99
        seconds, errors, rays = [], [], 0
        for seed in range(3):
            start = time.perf_counter()
            image, _, rays = render(args.spp, seed)
            seconds.append(time.perf_counter() - start)
            errors.append(np.sqrt(np.mean((np.clip(image, 0, 1) - np.clip(radiance, 0, 1))[mask] ** 2)))
        rows[name] = (min(seconds), float(np.mean(errors)), rays)
    if peer is not None:
        mask = (references["splitnerf"][1] > 0.99) & (peer[1] > 0.99)
        apart = np.clip(references["splitnerf"][0], 0, 1)[mask] - np.clip(peer[0], 0, 1)[mask]
        print(f"references apart by RMS {np.sqrt(np.mean(apart**2)):.4f} (other details of the model)")
    t0, e0, n_rays = rows["splitnerf"]
    print(
        f"{'':12s} {'s at ' + str(args.spp) + ' spp':>12s} {'RMS error':>10s} {'Mrays/s':>8s} {'s to our error':>15s} {'ratio':>7s}"
    )
    for name, (t, e, _) in rows.items():
        equal = t * (e / e0) ** 2
        print(f"{name:12s} {t:12.3f} {e:10.5f} {n_rays / t / 1e6:8.2f} {equal:15.3f} {equal / t0:7.2f}")


if __name__ == "__main__":
    main()
