"""An object and lights without any symmetry, written in the form of each published set, small."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import read_image, write_image
from splitnerf.render.path_traced import AssetRenderer
from splitnerf_tools.synth.orbits import orbit, spiral
from splitnerf_tools.synth.rendering import (
    CAMERA_ANGLE_X,
    CAMERA_DISTANCE,
    TEST_ELEVATION,
    TEST_SWING,
    TRAIN_ELEVATIONS,
    SynthSettings,
    normalised,
    synthesise,
    unit_sphere,
)

SIZE, TRAIN, TEST, SPP = 32, 4, 2, 192
FOCAL = 0.5 * SIZE / np.tan(0.5 * CAMERA_ANGLE_X)
RELIT = ("dusk", "noon")


def part(mesh: trimesh.Trimesh, colour: tuple, metallic: float, roughness: float, offset: tuple) -> trimesh.Trimesh:
    """A mesh with its material, moved, z up turned to glTF's y up."""
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[*colour, 1.0], metallicFactor=metallic, roughnessFactor=roughness
    )
    vertices = (mesh.vertices + offset)[:, [0, 2, 1]] * [1, 1, -1]
    normals = np.array(mesh.vertex_normals)[:, [0, 2, 1]] * [1, 1, -1]
    visual = trimesh.visual.TextureVisuals(material=material)
    return trimesh.Trimesh(vertices, mesh.faces, vertex_normals=normals, visual=visual, process=False)


def write_object(folder: Path) -> Path:
    """Three balls of different colours and sizes, in no plane of symmetry."""
    ball = trimesh.creation.icosphere
    parts = {
        "large": part(ball(subdivisions=4), (0.7, 0.6, 0.5), 0.0, 0.6, (0, 0, 0)),
        "red": part(ball(subdivisions=3, radius=0.5), (0.9, 0.1, 0.1), 0.0, 0.5, (1.1, 0.2, 0.5)),
        "metal": part(ball(subdivisions=3, radius=0.35), (0.9, 0.9, 0.9), 1.0, 0.3, (-0.3, 1.0, -0.5)),
    }
    path = folder / "balls.glb"
    path.write_bytes(trimesh.Scene(parts).export(file_type="glb", include_normals=True))
    return path


def patches(*lit: tuple[float, float, tuple]) -> np.ndarray:
    """A dim map [64, 128, 3] with patches of light: azimuth from +x towards +y and elevation in degrees, and colour."""
    rows, columns = np.indices((64, 128)) + 0.5
    azimuth, elevation = 180 - columns * 360 / 128, 90 - rows * 180 / 64
    radiance = np.full((64, 128, 3), 0.1, np.float32)
    for a, e, colour in lit:
        away = np.hypot((azimuth - a + 180) % 360 - 180, elevation - e)
        radiance[away < 25] += 0.4 * np.array(colour, np.float32)
    return radiance


@dataclass
class Written:
    """What was written: the folder to train on, the renderer of the truth, cameras [n, 4, 4] and lights by name."""

    root: Path
    renderer: AssetRenderer
    train: np.ndarray
    test: np.ndarray
    lights: dict[str, np.ndarray]

    def render(self, light: np.ndarray, pose: np.ndarray, spp: int = 384) -> dict[str, np.ndarray]:
        """The truth from a camera in a light."""
        lens = (FOCAL, FOCAL, SIZE / 2, SIZE / 2)
        return self.renderer.render(light, pose, lens, SIZE, SIZE, spp=spp, seed=1 << 30)


def write_set(folder: Path, layout: str) -> Written:
    """Renders the scene in the form of a set, `nerfactor` or `shiny`; the latter has no other lights."""
    folder.mkdir(exist_ok=True, parents=True)
    asset_path = write_object(folder)
    lights = {
        "studio": patches((40, 35, (8, 7, 5)), (200, -10, (0.3, 0.6, 1.5))),
        "dusk": patches((-70, 10, (9, 3, 1)), (100, 60, (0.2, 0.3, 1.0))),
        "noon": patches((150, 60, (7, 7, 7)), (-20, 0, (0.2, 1.5, 0.3))),
    }
    for name, light in lights.items():
        write_image(folder / f"{name}.exr", light)
    shiny = layout == "shiny"
    relit = [] if shiny else [folder / f"{light}.exr" for light in RELIT]
    settings = SynthSettings(SIZE, TRAIN, TEST, SPP, "blender" if shiny else layout)
    root = synthesise(asset_path, folder / "studio.exr", relit, folder / "data", settings)
    for path in (root / "test").glob("*_normal.exr") if shiny else ():
        pixels = read_image(path)
        normal, alpha = pixels[..., :3] / np.maximum(pixels[..., 3:], 1e-8), pixels[..., 3:]
        write_image(path.with_suffix(".png"), np.concatenate([0.5 * normal + 0.5, alpha], axis=-1))
        write_image(path.with_name(path.name.replace("normal.exr", "alpha.png")), alpha[..., 0])
        path.unlink()
    original = read_asset(asset_path)
    renderer = AssetRenderer(normalised(original, *unit_sphere(original)))
    train = spiral(TRAIN, CAMERA_DISTANCE, TRAIN_ELEVATIONS)
    return Written(root, renderer, train, orbit(TEST, CAMERA_DISTANCE, TEST_ELEVATION, TEST_SWING), lights)
