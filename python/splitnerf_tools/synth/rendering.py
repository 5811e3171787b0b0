"""From an asset and environment maps to a dataset with truth: its cameras, its photos, and the asset in its world."""

from __future__ import annotations

import itertools
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from splitnerf.data.asset import Asset
from splitnerf.data.environment import read_environment, resize_environment, turn_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.gltf.geometry import scene_roots
from splitnerf.data.truth import PREFIX
from splitnerf.errors import InputError, note
from splitnerf.files import LOCK, atomic_path, locked
from splitnerf.relight.cameras import bounding_sphere, look_at
from splitnerf.render.path_traced import LARGEST_PICTURE, MOST_SPP, MOST_VIEWS, AssetRenderer
from tqdm import tqdm

from splitnerf_tools.synth.writer import LAYOUTS, SceneWriter

CAMERA_ANGLE_X = 0.6911112070083618  # radians, as in the NeRF Blender scenes
CAMERA_DISTANCE = 3.0233467  # three quarters of theirs: it frames the unit sphere
TRAIN_ELEVATIONS, TEST_ELEVATION, TEST_SWING = (-20.0, 78.0), 30.0, 20.0
MAP_SIZE = (256, 512)


@dataclass(frozen=True)
class SynthSettings:
    """How much to render, and how to store it.

    Attributes:
        size: Width and height of the images in pixels.
        train: Number of train views.
        test: Number of test views.
        spp: Paths a pixel.
        layout: One of :data:`splitnerf_tools.synth.writer.LAYOUTS`.
        seed: The seed of the renderings and of the first camera's azimuth.
        turntable: Whether the object turns before a camera that goes up and down alone, and the light with the camera.
    """

    size: int = 200
    train: int = 100
    test: int = 20
    spp: int = 256
    layout: str = "blender"
    seed: int = 0
    turntable: bool = False

    def check(self) -> None:
        """Raises InputError where a setting has no meaning."""
        for name, most in (("size", LARGEST_PICTURE), ("train", MOST_VIEWS), ("test", MOST_VIEWS), ("spp", MOST_SPP)):
            if not 1 <= getattr(self, name) <= most:
                raise InputError(f"--{name} must be at least 1 and at most {most}, got {getattr(self, name)}")
        if self.seed < 0:
            raise InputError(f"--seed must not be negative, got {self.seed}")
        if self.turntable and self.layout != "blender":
            raise InputError(
                f"--turntable: the layout {self.layout} has no word for the light's rotation; leave it out"
            )
        if self.layout not in LAYOUTS:
            raise InputError(f"--layout must be one of {', '.join(LAYOUTS)}, got {self.layout}")


def synthesise(asset: Path, light: Path, relight: Sequence[Path], out: Path, settings: SynthSettings) -> Path:
    """Renders a dataset with truth; returns `out`, the folder to train on. Raises InputError where the asset, a map, the folder or
    a setting cannot be used, and OSError where a file cannot be written.

    The asset is moved and scaled so that its bounding box is centred at the origin and its farthest vertex lies on the
    unit sphere; its emission is left out, so that the environment is the only light. A GLB file is copied to
    `asset.glb` with the same placement.

    Args:
        asset: A glTF file.
        light: The environment map of the photos.
        relight: The maps of the relit test views.
        out: The dataset's folder, absent or empty.
    """
    settings.check()
    if out.exists() and (not out.is_dir() or any(path.name != LOCK for path in out.iterdir())):
        raise InputError(f"{out}: exists and is not an empty folder; give another --out")
    names = [path.stem.removeprefix(PREFIX) for path in relight]
    if len(set(names)) < len(names):
        raise InputError(f"--relight: two maps are called {max(names, key=names.count)}; rename one")
    writer = SceneWriter(out, CAMERA_ANGLE_X, settings.layout)
    maps = [resized(read_environment(path)) for path in (light, *relight)]
    original = read_asset(asset)
    if any(any(material.emission) for material in original.materials):
        note(f"{asset}: emits light; left out, the environment is the only light")
    centre, radius = bounding_sphere(original)
    scale = 1 / radius
    renderer = AssetRenderer(normalised(original, centre, scale))
    with locked(out):
        write_placed_glb(asset, out / "asset.glb", centre, scale)
        writer.mesh((original.vertices - centre) * scale, original.triangles)
        stored = writer.light(maps[0])
        stored_relight = {name: writer.light(environment, name) for name, environment in zip(names, maps[1:])}
        render_views(renderer, writer, stored, stored_relight, settings)
        writer.close()
    return writer.root


def render_views(
    renderer: AssetRenderer,
    writer: SceneWriter,
    light: np.ndarray,
    relight: dict[str, np.ndarray],
    settings: SynthSettings,
) -> None:
    """Hands all views to the writer, under the light of the photos and, for the test views, those of relight, [h, w, 3] each."""
    size = settings.size
    focal = 0.5 * size / np.tan(0.5 * CAMERA_ANGLE_X)
    turn = np.random.default_rng(settings.seed).uniform(0, 360) if settings.seed else 0.0
    cameras = {
        "train": spiral(settings.train, CAMERA_DISTANCE, TRAIN_ELEVATIONS, turn),
        "test": orbit(settings.test, CAMERA_DISTANCE, TEST_ELEVATION, TEST_SWING),
    }
    total = settings.train + settings.test * (1 + len(relight))
    seeds = itertools.count(settings.seed * total)  # every image has its own
    with tqdm(total=total, desc="rendering", unit="view", leave=False, disable=None) as progress:

        def shot(environment: np.ndarray, pose: np.ndarray) -> dict[str, np.ndarray]:
            seed = next(seeds) % (1 << 31)
            lens = (focal, focal, size / 2, size / 2)
            progress.update()
            return renderer.render(environment, pose, lens, size, size, spp=settings.spp, seed=seed)

        for split, poses in cameras.items():
            for i, pose in enumerate(poses):
                here = turn_to(pose, cameras["train"][0]) if settings.turntable else None
                lit = light if here is None else turn_environment(light, here)
                writer.view(split, i, pose, shot(lit, pose), light_turn=here)
        for name, environment in relight.items():
            for i, pose in enumerate(cameras["test"]):
                writer.relit(i, name, shot(environment, pose))


def turn_to(pose: np.ndarray, first: np.ndarray) -> np.ndarray:
    """[3, 3] the rotation about z that carries the azimuth of a camera to that of another one."""
    angle = np.arctan2(first[1, 3], first[0, 3]) - np.arctan2(pose[1, 3], pose[0, 3])
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def normalised(asset: Asset, centre: np.ndarray, scale: float) -> Asset:
    """The asset in the dataset's world, (x - centre) scale, without emission."""
    return replace(
        asset,
        vertices=((asset.vertices - centre) * scale).astype(np.float32),
        materials=[replace(m, emission=(0.0, 0.0, 0.0), emission_texture=None) for m in asset.materials],
    )


def resized(environment: np.ndarray) -> np.ndarray:
    """The map at no more than 512 x 256 pixels."""
    height, width = (min(a, b) for a, b in zip(environment.shape, MAP_SIZE))
    return resize_environment(environment, height, width)


# ---- the asset in the world of the data ----

HEADER = 20  # of the file and of its first chunk, which is the JSON


def write_placed_glb(source: Path, target: Path, centre: np.ndarray, scale: float) -> bool:
    """Writes a GLB below a node that applies (x - centre) scale, `centre` [3] in the source's world, z up, and without emission;
    False, and no file, of a .gltf and of a GLB with data in other files. Raises OSError where the file cannot be written."""
    data = source.read_bytes()
    if data[:4] != b"glTF":
        return False
    length = struct.unpack_from("<I", data, 12)[0]
    document, rest = json.loads(data[HEADER : HEADER + length]), data[HEADER + length :]
    stored = [item for kind in ("buffers", "images") for item in document.get(kind, [])]
    if any(not item.get("uri", "data:").startswith("data:") for item in stored):
        return False
    x, y, z = (float(-value * scale) for value in centre)
    root = {"name": "unit sphere", "children": scene_roots(document), "scale": [scale] * 3, "translation": [x, z, -y]}
    document["scenes"], document["scene"] = [{"nodes": [len(document["nodes"])]}], 0
    document["nodes"].append(root)
    for material in document.get("materials", []):
        material.pop("emissiveFactor", None)
        material.pop("emissiveTexture", None)
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with atomic_path(target) as temporary, open(temporary, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, HEADER + len(text) + len(rest)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text + rest)
    return True


# ---- cameras on a sphere around the origin, which they look at ----


def spiral(n: int, distance: float, elevations: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    """[n, 4, 4] float64 camera-to-world, OpenGL axes: cameras spread evenly over a band of the sphere, on a golden spiral.

    Args:
        distance: From the origin.
        elevations: Lowest and highest, in degrees from the horizon.
        turn: Azimuth of the first, in degrees.
    """
    golden_turn = 360 / ((1 + np.sqrt(5)) / 2)
    heights = np.linspace(*np.sin(np.radians(elevations)), n)
    return _poses(turn + np.arange(n) * golden_turn, np.degrees(np.arcsin(heights)), distance)


def orbit(n: int, distance: float, elevation: float, swing: float = 0.0, start: float = 0.5) -> np.ndarray:
    """[n, 4, 4] float64 camera-to-world, OpenGL axes: cameras on one turn about the vertical.

    Args:
        distance: From the origin.
        elevation: Mean elevation in degrees.
        swing: Amplitude in degrees with which the elevation goes up and down, twice a turn.
        start: Azimuth of the first, in steps of 360 / n degrees.
    """
    share = np.arange(n) / n
    return _poses(360 * (share + start / n), elevation + swing * np.sin(4 * np.pi * share), distance)


def _poses(azimuths: np.ndarray, elevations: np.ndarray, distance: float) -> np.ndarray:
    angles = np.radians([azimuths, elevations]).T
    return np.array([look_at(np.zeros(3), *pair, distance) for pair in angles]).reshape(-1, 4, 4)
