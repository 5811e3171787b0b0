"""The loop over lights and frames; each picture is written at once."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset
from splitnerf.data.environment import rotate_environment
from splitnerf.data.gltf import read_asset
from splitnerf.errors import InputError
from splitnerf.files import locked
from splitnerf.progress import tracked
from splitnerf.relight.background import Background, compose
from splitnerf.relight.cameras import View, bounding_sphere
from splitnerf.relight.output import (
    GIF,
    MP4,
    check_folder,
    display_frame,
    file_names,
    require_ffmpeg,
    write_frame,
    write_gif,
    write_mp4,
)
from splitnerf.relight.studio import light_named
from splitnerf.render.path_traced import AssetRenderer


@dataclass(frozen=True)
class Settings:
    """How the pictures are rendered and written.

    Attributes:
        spp: The number of paths per pixel.
        bounces: The number of scattering events after the first.
        seed: The seed of the first frame; each frame has its own seed.
        rotate_env: The rotation of every map about z in degrees, counter-clockwise seen from above.
        exposure: The exposure in stops: the light is multiplied by 2^exposure.
        background: The background, see `Background`.
        shadow_catcher: Whether an invisible ground at the object's lowest point shows its shadow.
        gif, mp4: Whether to write a GIF and an MP4.
        fps: The frames per second of GIF and MP4.
    """

    spp: int = 128
    bounces: int = 4
    seed: int = 0
    rotate_env: float = 0.0
    exposure: float = 0.0
    background: str = "transparent"
    shadow_catcher: bool = False
    gif: bool = False
    mp4: bool = False
    fps: float = 12.0


def asset_of(path: Path) -> Asset:
    """The asset of a run's folder or of a glTF file. Raises InputError where there is none, or it cannot be read."""
    if path.is_dir():
        if not (path / "mesh.glb").is_file():
            raise InputError(f"{path}: has no mesh.glb; finish its training, or give a .glb file")
        return read_asset(path / "mesh.glb")
    return read_asset(path)


def relight(
    source: Path,
    maps: list[Path],
    views_of: Callable[[Asset], list[View]],
    out: Path,
    settings: Settings,
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Renders a run's asset or a glTF file under environment maps into NNN.png and NNN.exr and, if requested, GIF or MP4; with
    several maps, each has a folder with its name below `out`. Returns the folder of each map. Raises InputError where an argument
    cannot be used; then nothing was written or removed. Raises OSError where a file cannot be written."""
    folders = [out] if len(maps) == 1 else [out / folder_name(path) for path in maps]
    if len(set(folders)) < len(folders):
        raise InputError(f"{out}: two maps have the same name and would share a folder; rename one")
    if settings.mp4:
        require_ffmpeg()
    background = Background(settings.background)
    lights = [rotate_environment(light_named(path), settings.rotate_env) for path in maps]
    asset = asset_of(source)
    views = views_of(asset)
    sizes = {(view.width, view.height) for view in views}
    if (settings.gif or settings.mp4) and len(sizes) > 1:
        raise InputError("--gif and --mp4: the frames differ in size; give --size")
    if settings.mp4 and min(min(size) for size in sizes) < 2:
        raise InputError("--mp4 needs frames of at least 2x2 pixels; give a larger --size")
    names = file_names(len(views), gif=settings.gif, mp4=settings.mp4)
    with ExitStack() as stack:
        for folder in folders:
            stack.enter_context(locked(folder))
        earlier = [check_folder(folder, names, overwrite=overwrite) for folder in folders]
        render_frames(asset, lights, views, folders, background, settings)
        for folder, own in zip(folders, earlier):
            for name in own.difference(names):
                (folder / name).unlink()
    return folders


def folder_name(path: Path) -> str:
    """The name of a map's folder. Raises InputError where the folder would not be below --out."""
    if not path.stem.strip("."):
        raise InputError(f"{path}: has no name that a folder could have; rename the map")
    return path.stem


def render_frames(
    asset: Asset,
    lights: list[np.ndarray],
    views: list[View],
    folders: list[Path],
    background: Background,
    settings: Settings,
) -> None:
    """Renders all views under each light into its folder."""
    renderer = AssetRenderer(asset)
    ground = lowest(asset) if settings.shadow_catcher else None
    exposure = 2.0**settings.exposure
    for light, folder in zip(lights, folders):
        frames = []
        for index, view in enumerate(tracked(views, "relighting, frame")):
            turned = rotate_environment(light, view.light_degrees)
            images = renderer.render(
                turned,
                view.pose,
                view.intrinsics,
                view.width,
                view.height,
                spp=settings.spp,
                bounces=settings.bounces,
                seed=settings.seed + index,
                catcher_height=ground,
            )
            linear = compose(images, background.behind(view, turned, exposure), exposure)
            write_frame(folder, index, linear, with_alpha=background.transparent)
            if settings.gif or settings.mp4:
                frames.append(display_frame(linear))
        if settings.gif:
            write_gif(folder / GIF, frames, settings.fps)
        if settings.mp4:
            write_mp4(folder / MP4, frames, settings.fps)


def lowest(asset: Asset) -> float:
    """z of the lowest point, lowered by a millionth of the size so that the ground does not cut into a flat bottom."""
    return float(asset.vertices[asset.triangles][..., 2].min()) - 1e-6 * bounding_sphere(asset)[1]
