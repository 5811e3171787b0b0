"""What the viewer shows: assets, lights, and the photos of a run."""

from __future__ import annotations

import functools
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np
from splitnerf.data.asset import Asset
from splitnerf.data.environment import resize_environment
from splitnerf.data.frames import read_frames
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import encode_image
from splitnerf.data.lens import lens_intrinsics
from splitnerf.data.photos import check_files, load_photo
from splitnerf.data.pixels import decoded
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError, note, plain
from splitnerf.files import reason
from splitnerf.relight.studio import STUDIO_LIGHTS, is_studio_light, light_named, studio_light

from splitnerf_tools.report.embedding import camera_of
from splitnerf_tools.report.sections import facts_of

MOST_ROWS = 1024  # of a light
LARGEST = 1600  # pixels of a photo's longer side in the page
MOST_DROPPED = 8  # lights that were dropped onto the page; an older one is forgotten


@dataclass(frozen=True)
class ViewedLight:
    """A light: its name, and [h, 2 h, 3] float32 linear radiance of at most 1024 rows, see `read_environment`."""

    name: str
    radiance: np.ndarray


@dataclass
class Source:
    """One asset.

    Attributes:
        name: Its name in the page.
        asset: The asset; the path tracer draws it.
        encode: Makes the bytes of its GLB.
        light: The number of the run's own light, or None.
        version: The number of updates of a training's asset; 0 while there is none to load.
    """

    name: str
    asset: Asset
    encode: Callable[[], bytes]
    light: int | None = None
    version: int = 1

    @functools.cached_property
    def content(self) -> bytes:
        """The bytes of its GLB."""
        return self.encode()


class ViewedAssets:
    """One or two assets and their lights. Lights that are dropped onto the page are added while it is shown. Raises InputError
    where an asset or the light cannot be read.

    Args:
        paths: Runs' folders or GLB files.
        light: An environment map, or the name of a studio light, that is shown first, or None.

    Attributes:
        sources: The assets.
        problems: One line for each file of an asset that cannot be read.
        frame: The part of space that the first camera shows; None for that of the first asset.
    """

    def __init__(self, paths: list[Path], light: Path | None = None):
        self.problems: list[str] = []
        self.frame: Asset | None = None
        self._lights: dict[int, ViewedLight] = {}
        self._next, self._lock = 0, threading.Lock()
        given = light is not None and not is_studio_light(light)
        self._first = self.add_light(light_of(light, light.name)) if given else None
        self.sources = [self.source_of(path) for path in paths]
        self._white = self.add_light(ViewedLight("white", np.ones((8, 16, 3), np.float32)))
        studio = {name: self.add_light(ViewedLight(name, studio_light(name))) for name in STUDIO_LIGHTS}
        if light is not None and not given:
            self._first = studio[str(light)]
        self.keep_lights()

    def light(self, number: int) -> ViewedLight | None:
        """A light by its number, or None."""
        with self._lock:
            return self._lights.get(number)

    def add_light(self, light: ViewedLight, number: int | None = None) -> int:
        """Adds a light, or replaces the one of this number; returns its number."""
        with self._lock:
            if number is None:
                number, self._next = self._next, self._next + 1
            self._lights[number] = light
            return number

    def keep_lights(self) -> None:
        """Keeps the lights so far for good."""
        self._kept = self._next

    def drop(self, name: str, content: bytes) -> int:
        """Adds a light from the bytes of an .exr or .hdr file; returns its number. Raises InputError, which names it, where the
        bytes are not such a file."""
        name = plain(PurePosixPath(name.replace("\\", "/")).name)[:100]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"light{Path(name).suffix.lower()}"
            path.write_bytes(content)
            try:
                number = self.add_light(light_of(path, name))
            except InputError as error:
                raise InputError(str(error).replace(str(path), name)) from None
        with self._lock:
            for old in [n for n in self._lights if n >= self._kept][:-MOST_DROPPED]:
                del self._lights[old]
        return number

    def description(self) -> dict:
        """The description of the scene for the page, for JSON. The camera is that of `splitnerf relight`; lengths are
        the data's, z is up."""
        sources = list(self.sources)
        framed = sources[0].asset if self.frame is None else self.frame
        with self._lock:
            lights = [{"number": number, "name": light.name} for number, light in self._lights.items()]
        return {
            "sources": [
                {"name": source.name, "light": source.light, "version": source.version}
                | {"facts": facts_of(source.asset) if source.version else ""}
                for source in sources
            ],
            "lights": lights,
            "first_light": self._first,
            "white": self._white,
            "problems": self.problems,
            "camera": camera_of(framed),
        }

    def source_of(self, path: Path, name: str | None = None, light: int | None = None) -> Source:
        """The asset of a run's folder or a GLB; the light in the folder of a `mesh.glb` belongs to it. Raises InputError where it
        cannot be read.

        Args:
            name: Its name in the page; None for that of the folder or file.
            light: The number for its light; None for a new one.
        """
        if not path.exists():
            raise InputError(f"{path}: no such run or .glb file")
        glb = path / "mesh.glb" if path.is_dir() else path
        if path.is_dir() and not glb.is_file():
            raise InputError(f"{path}: has no mesh.glb; finish its training, or give a .glb file")
        asset = read_asset(glb)
        content = glb.read_bytes()
        if not content.startswith(b"glTF"):
            raise InputError(f"{glb}: is a .gltf, whose parts the page cannot load; export it as GLB")
        name, own, environment = name or run_name(glb), None, glb.with_name("environment.exr")
        if glb.name == "mesh.glb" and environment.exists():
            try:
                own = self.add_light(light_of(environment, f"recovered light of {name}"), light)
            except InputError as error:  # it becomes a line
                self.problems.append(str(error))
                note(str(error))
        return Source(name, asset, lambda: content, own)


def run_name(glb: Path) -> str:
    """What a GLB is called: a run's by the name of its folder."""
    return glb.resolve().parent.name if glb.name == "mesh.glb" else glb.name


def light_of(path: Path, name: str) -> ViewedLight:
    """The light of an .exr or .hdr file, with at most MOST_ROWS rows. Raises InputError where it cannot be read."""
    radiance = light_named(path)
    height = min(radiance.shape[0], MOST_ROWS)
    return ViewedLight(name, resize_environment(radiance, height, 2 * height))


class ViewedPhotos:
    """All photos of a data set, in its order. Raises InputError where the data cannot be used, or an image is missing."""

    def __init__(self, root: Path):
        if not root.is_dir():
            raise InputError(f"{root}: no such folder; give the folder of the data that the run was trained on")
        frames, _ = read_frames(root, "train", Reading(eval_mode="all"))
        self._frames = [replace(frame, mask_path=None, dynamic_mask_path=None) for frame in frames]
        self._sizes = check_files(self._frames, 1)[0].tolist()

    def __len__(self) -> int:
        return len(self._frames)

    def cameras(self) -> list[dict]:
        """For each photo, for JSON: `name`, `pose` (camera-to-world, row by row, OpenGL axes), `intrinsics` (fx, fy,
        cx, cy in pixels of the file), `width`, `height`, and `exposure`, the factor of its linear values that the data
        state."""
        return [
            {
                "name": frame.name,
                "pose": frame.pose.ravel().tolist(),
                "intrinsics": lens_intrinsics(frame.lens, size).tolist(),
                "width": size[1],
                "height": size[0],
                "exposure": frame.exposure,
            }
            for frame, size in zip(self._frames, self._sizes)
        ]

    def png(self, number: int) -> bytes:
        """A photo without its lens's distortion, averaged down to at most 1600 pixels; transparent at invalid pixels. Raises
        InputError where it cannot be read, or is gone."""
        frame, factor = self._frames[number], -(-max(self._sizes[number]) // LARGEST)
        try:
            photo = load_photo(frame, factor, "object")
        except OSError as error:
            raise InputError(
                f"{frame.image_path}: cannot be read ({reason(error)}); is the data's folder still there?"
            ) from None
        rgba = decoded(photo.rgba)
        if photo.known is not None:
            rgba[..., 3] *= photo.known
        return encode_image(np.ascontiguousarray(rgba), ".png", frame.name)
