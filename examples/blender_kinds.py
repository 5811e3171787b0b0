"""Photographs of objects of five kinds, in Blender, as data for training: matte, glossy, glass, hair and thin wires.

python blender_kinds.py LIGHT.hdr DATA [--kinds glass hair]     (Python 3.11 with bpy==5.0.1; writes DATA/KIND)
splitnerf train DATA/KIND --max-minutes 3 --out RUNS/KIND
"""

import argparse
import json
from pathlib import Path

import numpy as np

LOOKS = {  # colours, roughness, metallic, transmission
    "matte": (((0.5, 0.17, 0.08), (0.7, 0.5, 0.3)), 0.9, 0, 0),
    "glossy": (((0.02, 0.05, 0.3), (0.7, 0.68, 0.6)), 0.1, 0, 0),
    "glass": (((1, 1, 1),), 0, 0, 1),
    "hair": (((0.35, 0.16, 0.06),), 0.5, 0, 0),
    "thin": (((0.5, 0.3, 0.1),), 0.5, 1, 0),
}
JUG = "0 -80 40 -80 42 -75 62 -20 55 15 30 40 30 60 40 75 36 76 26 60 26 40 50 13 57 -20 38 -70 0 -72"  # radius, height
GOBLET = "0 -80 45 -80 45 -76 8 -68 6 -25 40 5 50 40 44 80 40 80 45 40 35 10 0 -10"
BASKET = "0 -40 25 -38 50 -25 68 0 78 30 82 55"
ANGLE, DISTANCE = 0.69, 3.0


def add_object(bpy, kind: str) -> None:
    """Adds the object of a kind to the scene: turned on a lathe, or a ball with hair."""
    (colours, *look), n = LOOKS[kind], 20 if kind == "thin" else 96
    profile = np.reshape([float(x) / 100 for x in {"glass": GOBLET, "thin": BASKET}.get(kind, JUG).split()], (-1, 2))
    points = [(r * np.cos(a), r * np.sin(a), z) for r, z in profile for a in np.arange(n) * 2 * np.pi / n]
    faces = [(k, b := k + 1 - n * ((k + 1) % n == 0), b + n, k + n) for k in range(len(points) - n)]
    if kind == "hair":
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.6)
    else:
        mesh = bpy.data.meshes.new(kind)
        mesh.from_pydata(points, [], faces)
        mesh.polygons.foreach_set("material_index", [i // n % len(colours) for i in range(len(faces))])
        bpy.context.collection.objects.link(bpy.data.objects.new(kind, mesh))
    made = bpy.context.collection.objects[0]
    made.data.shade_smooth()
    for colour in colours:
        made.data.materials.append(material := bpy.data.materials.new(kind))
        for name, value in zip(("Base Color", "Roughness", "Metallic", "Transmission Weight"), ((*colour, 1), *look)):
            material.node_tree.nodes["Principled BSDF"].inputs[name].default_value = value
    if kind == "thin":
        made.modifiers.new("wires", "WIREFRAME").thickness = 0.035
    elif kind == "hair":
        hair = made.modifiers.new("hair", "PARTICLE_SYSTEM").particle_system.settings
        hair.type, hair.count, hair.hair_length, hair.brownian_factor = "HAIR", 6000, 0.3, 0.05
        hair.root_radius, hair.tip_radius, hair.radius_scale = 1, 0.2, 0.012
    else:
        made.modifiers.new("smooth", "SUBSURF").render_levels = 2


def photograph(light: Path, out: Path, views: list[int], size: int, samples: int) -> None:
    """Writes data of the object of the kind that `out` ends in, alone under the light, with alpha."""
    import bpy
    from mathutils import Matrix, Vector

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    nodes, link = scene.world.node_tree.nodes, scene.world.node_tree.links.new
    around = nodes.new("ShaderNodeTexEnvironment")
    around.image = bpy.data.images.load(str(light.resolve()))
    link(around.outputs["Color"], nodes["Background"].inputs["Color"])
    add_object(bpy, out.name)
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.data.angle, scene.view_settings.view_transform = ANGLE, "Standard"
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", samples, True
    scene.render.film_transparent = scene.render.use_persistent_data = True
    scene.render.resolution_x = scene.render.resolution_y = size
    draw = np.random.default_rng(0)
    for split, n, heights in zip(("train", "test"), views, ((-0.3, 0.95), (0.3, 0.4))):
        frames = []
        for i in range(n):
            up, turn = draw.uniform(*heights), 2 * np.pi * (i + draw.random()) / n
            back = Vector((np.sqrt(1 - up * up) * np.cos(turn), np.sqrt(1 - up * up) * np.sin(turn), up))
            pose = Matrix.Translation(DISTANCE * back) @ back.to_track_quat("Z", "Y").to_matrix().to_4x4()
            scene.camera.matrix_world, name = pose, f"{split}/{i:03d}"
            scene.render.filepath = str(out.resolve() / f"{name}.png")
            bpy.ops.render.render(write_still=True)
            frames.append({"file_path": name, "transform_matrix": [list(row) for row in pose]})
        (out / f"transforms_{split}.json").write_text(json.dumps({"camera_angle_x": ANGLE, "frames": frames}))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("light", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--kinds", nargs="+", choices=LOOKS, default=LOOKS)
    parser.add_argument("--views", type=int, nargs=2, default=(40, 4), help="for training, for testing")
    parser.add_argument("--size", type=int, default=200)
    parser.add_argument("--samples", type=int, default=48)
    args = parser.parse_args()
    for kind in args.kinds:
        photograph(args.light, args.out / kind, args.views, args.size, args.samples)
