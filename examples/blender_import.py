"""Brings an asset and its light into Blender and renders one view of it.

    blender --background --python blender_import.py -- ASSET.glb LIGHT.exr CAMERAS.json [--blend FILE]
    python blender_import.py ASSET.glb LIGHT.exr CAMERAS.json      (Python 3.11 with bpy==5.0.1)

CAMERAS.json is a transforms.json; `splitnerf relight --path CAMERAS.json` renders the same views. --against 000.png
prints the PSNR against such a picture, over white. Needs Blender alone, not this project.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix


def set_light(path: str, degrees: float) -> None:
    """Makes an equirectangular map the world. Its centre column lies along +x in Blender as in this project."""
    world = bpy.context.scene.world = bpy.data.worlds.new("light")
    if world.node_tree is None:  # before Blender 5
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    environment, mapping = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeMapping")
    environment.image = bpy.data.images.load(str(Path(path).resolve()))
    environment.image.pack()
    mapping.inputs["Rotation"].default_value[2] = -math.radians(degrees)  # the mapping turns directions, not the light
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], environment.inputs["Vector"])
    links.new(environment.outputs["Color"], nodes["Background"].inputs["Color"])


def set_camera(path: str, frame: int, size: int) -> None:
    """Takes pose, lens and size of a transforms.json, whose axes (OpenGL, z up) are Blender's."""
    cameras = json.loads(Path(path).read_text())
    lens, scene = cameras | cameras["frames"][frame], bpy.context.scene
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.matrix_world = Matrix(lens["transform_matrix"])
    width, height, camera = int(lens.get("w", size)), int(lens.get("h", size)), scene.camera.data
    scene.render.resolution_x, scene.render.resolution_y = width, height
    tall = lens["fl_x"] / lens["fl_y"] if "fl_y" in lens else 1  # a pixel's height over its width
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = max(1, 1 / tall), max(1, tall)  # no less
    camera.sensor_fit = "HORIZONTAL"
    camera.angle_x = lens.get("camera_angle_x") or 2 * math.atan(0.5 * width / lens["fl_x"])
    camera.shift_x = 0.5 - lens.get("cx", width / 2) / width  # of the width, both
    camera.shift_y = (lens.get("cy", height / 2) - height / 2) * tall / width


def set_colours(exposure: float) -> None:
    """The sRGB curve alone, as `splitnerf relight` writes PNG files; Blender's default, AgX, is another picture."""
    view = bpy.context.scene.view_settings
    view.view_transform, view.look, view.exposure, view.gamma = "Standard", "None", exposure, 1


def over_white(path: str) -> np.ndarray:
    image = bpy.data.images.load(str(Path(path).resolve()))
    pixels = np.array(image.pixels[:]).reshape(-1, image.channels)
    return pixels[:, :3] * pixels[:, 3:] + 1 - pixels[:, 3:] if image.channels == 4 else pixels


def main(words: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="blender_import.py", description=__doc__.splitlines()[0])
    for name in ("asset", "light", "cameras"):
        parser.add_argument(name)
    parser.add_argument("--frame", type=int, default=0, help="which of the cameras")
    parser.add_argument("--size", type=int, default=512, help="pixels, where the cameras do not say")
    parser.add_argument("--rotate-env", type=float, default=0, help="degrees, counter-clockwise from above")
    parser.add_argument("--exposure", type=float, default=0, help="stops brighter")
    parser.add_argument("--spp", type=int, default=128)
    parser.add_argument("--denoise", action="store_true", help="by Open Image Denoise")
    parser.add_argument("--out", default="blender.png")
    parser.add_argument("--blend", help="keep the scene as this .blend too")
    parser.add_argument("--against", help="a PNG of the same view")
    arguments = parser.parse_args(words)

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(Path(arguments.asset).resolve()))
    set_light(arguments.light, arguments.rotate_env)
    set_camera(arguments.cameras, arguments.frame, arguments.size)
    set_colours(arguments.exposure)
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples = "CYCLES", arguments.spp
    scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = arguments.denoise, False
    scene.render.film_transparent = True
    scene.render.filepath = str(Path(arguments.out).resolve())
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGBA"
    if arguments.blend:
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(arguments.blend).resolve()))
    bpy.ops.render.render(write_still=True)
    if arguments.against:
        error = np.mean((over_white(arguments.out) - over_white(arguments.against)) ** 2)
        print(f"PSNR against {arguments.against}: {-10 * math.log10(max(error, 1e-10)):.2f} dB")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
