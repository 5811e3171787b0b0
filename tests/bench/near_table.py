"""The change of a rendering when the table becomes a part of the distant light, and when there is no table.

    python tests/bench/near_table.py CAPTURE OUT [--samples 64] [--threads N]

CAPTURE holds truth/: asset.glb, table.jpg, light.hdr, cameras.json (object_min, object_max, table_radius, each frame's
exposure) and scene/transforms_test.json. OUT gets the environment that the object's middle sees (seen.exr), the views
as EXR, and a sheet. Prints the PSNR of the views over white, in sRGB at the capture's exposure, and the relative root
mean square of the radiance on the object. Needs bpy 5 (`splitnerf[blender]`).
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path

import bpy
import mathutils
import numpy as np

from splitnerf.data.images import linear_to_srgb, write_image

TOP = -0.0004  # of the table, metres: just under the object
SIDES = 128  # of the round table
SIZE, PANORAMA = 256, (1024, 512)  # pixels
SHOWN = (0, 3, 6)  # views on the sheet


def add_table(radius: float, texture: Path) -> bpy.types.Object:
    """A round matte table with a texture, its middle under the origin."""
    ring = [(radius * math.cos(2 * math.pi * i / SIDES), radius * math.sin(2 * math.pi * i / SIDES), TOP) for i in range(SIDES)]
    mesh = bpy.data.meshes.new("table")
    mesh.from_pydata(ring, [], [list(range(SIDES))])
    places = mesh.uv_layers.new(name="uv")
    for loop in mesh.loops:
        x, y, _ = mesh.vertices[loop.vertex_index].co
        places.data[loop.index].uv = (x / (2 * radius) + 0.5, y / (2 * radius) + 0.5)
    material = bpy.data.materials.new("table")
    material.use_nodes = True
    tree = material.node_tree
    image, matte = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    image.image = bpy.data.images.load(str(texture))
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(image.outputs[0], matte.inputs[0])
    tree.links.new(matte.outputs[0], output.inputs[0])
    mesh.materials.append(material)
    table = bpy.data.objects.new("table", mesh)
    bpy.context.scene.collection.objects.link(table)
    return table


class Stage:
    """Blender's scene: the asset, its table, an environment and a camera.

    Args:
        capture: The capture's folder.
        samples: Paths a pixel.
        threads: Threads; 0: all.
    """

    def __init__(self, capture: Path, samples: int, threads: int):
        truth = capture / "truth"
        self.facts = json.loads((truth / "cameras.json").read_text())
        self.views = json.loads((truth / "scene/transforms_test.json").read_text())
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        bpy.ops.import_scene.gltf(filepath=str(truth / "asset.glb"))
        self.parts = [part for part in self.scene.objects if part.type == "MESH"]
        self.table = add_table(self.facts["table_radius"], truth / "table.jpg")
        self.scene.world = bpy.data.worlds.new("world")
        self.scene.world.use_nodes = True
        tree = self.scene.world.node_tree
        self.environment = tree.nodes.new("ShaderNodeTexEnvironment")
        tree.links.new(self.environment.outputs[0], tree.nodes["Background"].inputs[0])
        render, cycles = self.scene.render, self.scene.cycles
        render.engine, cycles.device, cycles.max_bounces, cycles.samples = "CYCLES", "CPU", 4, samples
        cycles.use_denoising, cycles.use_adaptive_sampling = True, False
        if threads:
            render.threads_mode, render.threads = "FIXED", threads
        render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
        render.image_settings.color_mode = "RGBA"
        self.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.camera.data.clip_start = 0.01
        self.scene.collection.objects.link(self.camera)
        self.scene.camera = self.camera

    def light(self, path: Path) -> None:
        self.environment.image = bpy.data.images.load(str(path))

    def shoot(self, path: Path, width: int, height: int) -> np.ndarray:
        """[h, w, 4] linear, premultiplied; kept as a file."""
        self.scene.render.resolution_x, self.scene.render.resolution_y = width, height
        self.scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(path))
        pixels = np.empty(4 * width * height, np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(height, width, 4)[::-1]

    def panorama(self, path: Path) -> None:
        """What the object's middle sees of table and light; the object's shadow lies on the table."""
        for part in self.parts:
            part.visible_camera = False
        self.camera.data.type, self.camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
        self.camera.location = np.add(self.facts["object_min"], self.facts["object_max"]) / 2
        self.camera.rotation_euler = math.pi / 2, 0, -math.pi / 2
        self.shoot(path, *PANORAMA)
        for part in self.parts:
            part.visible_camera = True
        self.camera.data.type = "PERSP"

    def shoot_views(self, folder: Path, name: str) -> np.ndarray:
        """[n, h, w, 4] the object alone at the test cameras."""
        self.camera.data.sensor_fit, self.camera.data.angle_x = "HORIZONTAL", self.views["camera_angle_x"]
        self.scene.render.film_transparent, self.table.visible_camera = True, False
        images = []
        for i, frame in enumerate(self.views["frames"]):
            self.camera.matrix_world = mathutils.Matrix(frame["transform_matrix"])
            images.append(self.shoot(folder / f"{name}_{i}.exr", SIZE, SIZE))
        return np.stack(images)


def over_white(images: np.ndarray, exposure: float) -> np.ndarray:
    return linear_to_srgb((images[..., :3] * exposure + 1 - images[..., 3:]).clip(0, 1))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--threads", type=int, default=0)
    args = parser.parse_args()
    capture, out = args.capture.resolve(), args.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    stage = Stage(capture, args.samples, args.threads)
    exposure = math.exp(np.mean([math.log(frame["exposure"]) for frame in stage.facts["frames"]]))
    stage.light(capture / "truth/light.hdr")
    stage.panorama(out / "seen.exr")
    near = stage.shoot_views(out, "near")
    stage.table.hide_render = True
    without = stage.shoot_views(out, "without")
    stage.light(out / "seen.exr")
    far = stage.shoot_views(out, "far")
    opaque, truth = near[..., 3] > 0.99, over_white(near, exposure)
    for name, images in (("table far away", far), ("no table", without)):
        errors = np.square(over_white(images, exposure) - truth).mean((1, 2, 3))
        radiance, apart = near[..., :3].mean(-1)[opaque], (images - near)[..., :3].mean(-1)[opaque]
        relative = np.sqrt(np.square(apart).mean()) / radiance.mean()
        print(f"{name}: {np.mean(-10 * np.log10(errors)):.1f} dB, radiance {100 * relative:.1f} % apart")
    rows = [np.concatenate(over_white(images[list(SHOWN)], exposure), axis=1) for images in (near, far, without)]
    write_image(out / "sheet.png", np.concatenate(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
