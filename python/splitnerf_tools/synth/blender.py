"""Renders with Blender's Cycles through the Python module `bpy` (the extra `blender`), one process long."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from splitnerf.data.images import write_image
from splitnerf.errors import InputError

BOUNCES = 4
PASSES = {"albedo": "RGB", "roughness": "X", "metallic": "X", "smooth_normal": "RGB"}  # and their channels in the file


class BlenderRenderer:
    """A glTF file in an empty Blender scene, lit by an environment map alone.

    Args:
        path: The file.
        centre: [3] the point of the file's world, z up, that is moved to the origin.
        scale: The scale that is applied after the move.

    Raises:
        InputError: `bpy` is not installed, or the file holds nothing to render.
    """

    def __init__(self, path: Path, centre: np.ndarray, scale: float):
        try:
            import bpy
        except ImportError:
            raise InputError(
                "--renderer blender needs the module bpy; install it with `pip install splitnerf[blender]`"
            ) from None
        from mathutils import Matrix

        self._bpy, self._matrix = bpy, Matrix
        self._folder = tempfile.TemporaryDirectory()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.import_scene.gltf(filepath=str(path.resolve()))
        scene = bpy.context.scene
        for item in [item for item in scene.objects if item.type not in ("MESH", "EMPTY", "ARMATURE")]:
            bpy.data.objects.remove(item)
        meshes = [item for item in scene.objects if item.type == "MESH"]
        if not meshes:
            raise InputError(f"{path}: holds no mesh; export it again")
        place = Matrix.Scale(scale, 4) @ Matrix.Translation([-float(x) for x in centre])
        for item in [item for item in scene.objects if item.parent is None]:
            item.matrix_world = place @ item.matrix_world
        for item in meshes:
            if not item.data.materials:
                item.data.materials.append(bpy.data.materials.new("default"))
        for material in {m for item in meshes for m in item.data.materials if m is not None}:
            _prepare_material(material)
        self._set_up(scene)

    def _set_up(self, scene) -> None:
        bpy = self._bpy
        scene.render.engine = "CYCLES"
        scene.cycles.device = "CPU"
        scene.cycles.use_adaptive_sampling = False
        scene.cycles.use_denoising = False
        scene.cycles.max_bounces = BOUNCES
        scene.render.film_transparent = True
        scene.render.use_persistent_data = True
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):  # Blender 5
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format = "OPEN_EXR_MULTILAYER"
        settings.color_depth = "32"
        for name, letters in PASSES.items():
            aov = bpy.context.view_layer.aovs.add()
            aov.name, aov.type = name, "VALUE" if letters == "X" else "COLOR"
        camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        scene.collection.objects.link(camera)
        scene.camera = camera
        scene.world = bpy.data.worlds.new("world")
        if scene.world.node_tree is None:  # before Blender 5
            scene.world.use_nodes = True
        tree = scene.world.node_tree
        self._light = tree.nodes.new("ShaderNodeTexEnvironment")
        tree.links.new(self._light.outputs[0], tree.nodes["Background"].inputs[0])
        self._environment: np.ndarray | None = None

    def render(
        self,
        environment: np.ndarray,
        pose: np.ndarray,
        intrinsics: tuple[float, float, float, float],
        width: int,
        height: int,
        *,
        spp: int,
        seed: int,
    ) -> dict[str, np.ndarray]:
        """Renders one view; for the arguments see `AssetRenderer.render`. Returns its maps `radiance`, `alpha`,
        `albedo`, `roughness`, `metallic` and `smooth_normal`. The principal point must be the image's centre.

        Raises:
            RuntimeError: Blender wrote no image.
        """
        scene, folder = self._bpy.context.scene, Path(self._folder.name)
        if self._environment is not environment:
            path = folder / f"light_{len(self._bpy.data.images)}.exr"  # a new name: Blender keeps what it loaded
            write_image(path, environment)
            self._light.image = self._bpy.data.images.load(str(path))
            self._environment = environment
        scene.camera.matrix_world = self._matrix(np.asarray(pose, np.float64).tolist())
        scene.camera.data.sensor_fit = "HORIZONTAL"
        scene.camera.data.angle_x = 2 * np.arctan(0.5 * width / intrinsics[0])
        scene.render.resolution_x, scene.render.resolution_y = width, height
        scene.render.resolution_percentage = 100
        scene.cycles.samples, scene.cycles.seed = spp, seed
        scene.render.filepath = str(folder / "view.exr")
        self._bpy.ops.render.render(write_still=True)
        return _read_passes(folder / "view.exr")


def _prepare_material(material) -> None:
    """Takes emission away and sends the Principled inputs and the normal to the passes."""
    tree = material.node_tree
    shader = next((node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    if shader is None:
        raise InputError(f"material '{material.name}' is no metallic-roughness material; use --renderer project")
    for link in list(shader.inputs["Emission Color"].links):
        tree.links.remove(link)
    shader.inputs["Emission Strength"].default_value = 0.0
    material.use_backface_culling = False
    normal = tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
    sources = {"albedo": "Base Color", "roughness": "Roughness", "metallic": "Metallic"}
    for name, letters in PASSES.items():
        aov = tree.nodes.new("ShaderNodeOutputAOV")
        aov.aov_name = name
        target = aov.inputs["Value" if letters == "X" else "Color"]
        source = shader.inputs[sources[name]] if name in sources else None
        if source is None:
            tree.links.new(normal, target)
        elif source.links:
            tree.links.new(source.links[0].from_socket, target)
        else:
            target.default_value = source.default_value


def _read_passes(path: Path) -> dict[str, np.ndarray]:
    """The maps of a multi-layer EXR, passes divided by coverage."""
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise RuntimeError(f"{path}: Blender wrote no image")
    channels: dict[str, np.ndarray] = {}
    part = 0
    while source.seek_subimage(part, 0):
        names = source.spec().channelnames
        pixels = np.asarray(source.read_image(part, 0, 0, len(names), "float"), np.float32)
        channels |= {name.split(".", 1)[1]: pixels[..., i] for i, name in enumerate(names)}
        part += 1
    source.close()

    def layer(name: str, letters: str) -> np.ndarray:
        return np.stack([channels[f"{name}.{letter}"] for letter in letters], axis=-1)

    alpha = layer("Combined", "A")[..., 0]
    maps = {"radiance": layer("Combined", "RGB"), "alpha": np.clip(alpha, 0, 1)}
    covered = np.maximum(alpha, 1e-8)[..., None]
    for name, letters in PASSES.items():
        values = layer(name, letters) / covered
        maps[name] = values[..., 0] if letters == "X" else values
    lengths = np.linalg.norm(maps["smooth_normal"], axis=-1, keepdims=True)
    maps["smooth_normal"] = maps["smooth_normal"] / np.maximum(lengths, 1e-8)
    return maps
