"""What Mitsuba 3 makes of the same start: it fits the textures and the light of a run's trained mesh to the photos.

    python tests/bench/mitsuba_fit.py RUN DATA OUT --minutes 5 [--spp 16] [--rate 0.002]

Needs `pip install mitsuba` and an LLVM library (Mitsuba 3.9: not 14, 19 works). Begins where the refinement of RUN began, at
RUN/trained: mesh, textures and light. Each step renders one photo by `prb` (paths of at most four segments) and moves albedo,
roughness, metallic and the light by Adam. Writes OUT/mesh.glb and OUT/environment.exr, for `splitnerf evaluate OUT/mesh.glb
--data DATA`; the normal map is left out.
"""

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from splitnerf.data.dataset import load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import srgb_to_linear, write_image
from splitnerf.export.writers import write_glb

LEAST, MOST = 0.05, 1.0  # of the roughness
AXES = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)  # Mitsuba's maps have y up


def scene_of(mi, asset, maps: dict[str, np.ndarray], light: np.ndarray):
    """The asset under the light, as a Mitsuba scene."""
    mesh = mi.Mesh(
        "object", len(asset.vertices), len(asset.triangles), has_vertex_normals=True, has_vertex_texcoords=True
    )
    values = mi.traverse(mesh)
    values["vertex_positions"], values["vertex_normals"] = asset.vertices.ravel(), asset.normals.ravel()
    values["vertex_texcoords"], values["faces"] = asset.uv.ravel(), asset.triangles.ravel()
    values.update()
    file = Path(tempfile.mkdtemp()) / "mesh.ply"
    mesh.write_ply(str(file))
    bsdf = {
        name: {"type": "bitmap", "bitmap": mi.Bitmap(image.astype(np.float32)), "raw": True}
        for name, image in maps.items()
    }
    bsdf |= {"type": "principled", "specular": 0.5}
    around = mi.Bitmap(light.astype(np.float32))
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "prb", "max_depth": 4},
            "object": {"type": "ply", "filename": str(file), "bsdf": {"type": "twosided", "bsdf": bsdf}},
            "light": {"type": "envmap", "bitmap": around, "to_world": mi.ScalarTransform4f(AXES)},
        }
    )


def sensor_of(mi, pose: np.ndarray, intrinsics: np.ndarray, width: int, height: int):
    fx, _, cx, cy = map(float, intrinsics)
    return mi.load_dict(
        {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f(pose.astype(float) @ np.diag([-1.0, 1, -1, 1])),
            "fov": 2 * np.degrees(np.arctan(0.5 * width / fx)),
            "principal_point_offset_x": cx / width - 0.5,
            "principal_point_offset_y": cy / height - 0.5,
            "near_clip": 0.01,
            "far_clip": 100.0,
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "rfilter": {"type": "box"},
                "pixel_format": "rgba",
            },
        }
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--rate", type=float, default=0.002)
    args = parser.parse_args()
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(1)
    asset, light = read_asset(args.run / "trained/mesh.glb"), read_environment(args.run / "trained/environment.exr")
    material, photos = asset.materials[0], load_dataset(args.data)
    surface = material.roughness_metallic_texture
    maps = {"base_color": material.albedo_texture, "metallic": surface[..., 1:]}
    maps["roughness"] = surface[..., :1].clip(LEAST, MOST)
    scene = scene_of(mi, asset, maps, light)
    parameters = mi.traverse(scene)
    names = [name for name in parameters.keys() if name.endswith((*(f"{k}.data" for k in maps), "light.data"))]
    parameters.keep(names)
    optimiser = mi.ad.Adam(lr=args.rate)
    for name in names:
        optimiser[name] = parameters[name]
    parameters.update(optimiser)
    alpha = photos.images[..., 3:]
    colour = srgb_to_linear(photos.images[..., :3])
    sensors = [sensor_of(mi, pose, k, photos.width, photos.height) for pose, k in zip(photos.poses, photos.intrinsics)]
    random, began, step = np.random.default_rng(0), time.monotonic(), 0
    while time.monotonic() - began < 60 * args.minutes:
        i = int(random.integers(len(sensors)))
        image = mi.render(scene, parameters, sensor=sensors[i], spp=args.spp, seed=step)
        inside = mi.TensorXf(alpha[i])
        ours = dr.power(dr.maximum(image[..., :3], 1e-4), 1 / 2.2)
        theirs = mi.TensorXf(np.maximum(colour[i], 1e-4) ** (1 / 2.2))
        loss = dr.mean(dr.square((ours - theirs) * inside))
        dr.backward(loss)
        optimiser.step()
        for name in names:
            low, high = (LEAST, MOST) if "roughness" in name else (0.0, 1e4 if "light" in name else 1.0)
            optimiser[name] = dr.clip(optimiser[name], low, high)
        parameters.update(optimiser)
        step += 1
        if step % 20 == 0:
            print(f"step {step}, {time.monotonic() - began:.0f} s, error {float(loss.array[0]):.5f}", flush=True)
    found = {
        key: np.array(optimiser[next(name for name in names if name.endswith(f"{key}.data"))])
        for key in (*maps, "light")
    }
    args.out.mkdir(parents=True, exist_ok=True)
    surface = np.concatenate([found["roughness"], found["metallic"]], axis=2)
    fitted = replace(
        material, albedo_texture=found["base_color"], roughness_metallic_texture=surface, normal_texture=None
    )
    write_glb(args.out / "mesh.glb", replace(asset, materials=[fitted], tangents=None))
    write_image(args.out / "environment.exr", found["light"][:, : light.shape[1], :3])


if __name__ == "__main__":
    main()
