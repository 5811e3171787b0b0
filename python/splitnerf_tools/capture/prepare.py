"""From a folder of photographs to data for training: poses, pinhole images, masks, exposures and a page about them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from splitnerf.data.dataset import SURROUNDINGS
from splitnerf.data.frames import VIDEOS
from splitnerf.data.images import srgb_to_linear, write_image
from splitnerf.data.json_files import write_json
from splitnerf.errors import InputError, note
from splitnerf.files import LOCK, atomic_path, is_own, locked, own_folder, reason, remove_partial

from splitnerf_tools.capture.masks import find_masks, given_masks, mask_files
from splitnerf_tools.capture.page import write_page
from splitnerf_tools.capture.photographs import (
    Photograph,
    find_photographs,
    is_upright,
    read_upright,
    sharpness,
    write_frames,
    write_png,
)
from splitnerf_tools.capture.photometry import Exposures, find_exposures
from splitnerf_tools.capture.poses import MIN_PHOTOS, Lens, Reconstruction, file_name, reconstruct
from splitnerf_tools.capture.surroundings import Shot, surroundings
from splitnerf_tools.capture.turntable import light_turns, write_moving
from splitnerf_tools.capture.undistorted import pinhole_of, undistort, without_vignetting
from splitnerf_tools.capture.world import World, settle

FEW_LOST = 0.2  # share of the photos without a camera from which a note tells of them
BLURRED = 0.12  # share of the median sharpness below which a photo is left out
TRANSFORMS = "transforms.json"
DARK = 0.02  # sRGB value that 1 % of a photo's pixels must exceed


@dataclass(frozen=True)
class PrepareSettings:
    """How photos are prepared.

    Attributes:
        max_size: The longest edge of the written images in pixels; 0 keeps the photos'.
        masks: A folder with masks of the photos, or None to find them.
        frames: The number of frames that are taken of a video.
        seed: The seed of all random choices.
        turntable: Whether the object turned before a camera on a stand, and not the camera around the object.
    """

    max_size: int = 0
    masks: Path | None = None
    frames: int = 100
    seed: int = 0
    turntable: bool = False


def prepare(
    source: Path, out: Path, settings: PrepareSettings, report: Callable[[str, float], None]
) -> tuple[Reconstruction, dict[str, str]]:
    """Writes `images/`, `masks/`, `transforms.json`, `surroundings.exr` and `prepare.html`; returns the cameras and points, and why
    photos were left out, by name. What an interrupted call with the same photos has done in `out/work` is used again. Raises
    InputError where the photos cannot be read or do not fit together, or the folder holds other files."""
    work = out / "work"
    others = out.is_dir() and {path.name for path in out.iterdir()} - {LOCK}
    if others and not (is_own(work) or is_own(out / "frames")):
        raise InputError(f"{out}: holds other files; give a new folder")
    with locked(out):
        photos = _photographs(source, out, settings, report)
        masks = None if settings.masks is None else mask_files(photos, settings.masks)
        own_folder(work, fingerprint([photo.path for photo in photos], settings.seed, settings.turntable))
        kept, left_out = _sorted_out(photos, report)
        images = _upright_copies(kept, work)
        moving = work / "moving" if settings.turntable else None
        if moving is not None:
            write_moving(images, moving, lambda share: report("photos", share))
        found = reconstruct(kept, images, work, settings.seed, report, moving)
        left_out |= _without_camera(kept, found.names, source)
        world = settle(found, settings.seed)
        by_name = {photo.name: photo for photo in kept}
        exposures = exposures_of(world.scene, by_name, report)
        shares = write_data(world, exposures, by_name, masks, out, settings, report)
        write_page(out, world, exposures.gains, shares, left_out, source.resolve().name)
    return world.scene, left_out


def _photographs(
    source: Path, out: Path, settings: PrepareSettings, report: Callable[[str, float], None]
) -> list[Photograph]:
    """The photos of a folder, or the frames of a video, which are written into `out/frames`."""
    if source.suffix.lower() not in VIDEOS:
        return find_photographs(source)
    folder, done = out / "frames", out / "frames" / "all"
    own_folder(folder, fingerprint([source], settings.frames))
    if not done.exists():
        write_frames(source, folder, settings.frames, lambda share: report("frames", share))
        done.touch()
    return find_photographs(folder)


def fingerprint(files: Sequence[Path], *settings: object) -> str:
    """A hash of settings and of files by their paths, sizes and times. Raises InputError where a file cannot be read."""
    try:
        stats = [(str(path.resolve()), path.stat().st_size, path.stat().st_mtime_ns) for path in files]
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be read ({reason(error)})") from None
    return hashlib.sha256(json.dumps([stats, settings]).encode()).hexdigest()


def _sorted_out(
    photos: list[Photograph], report: Callable[[str, float], None]
) -> tuple[list[Photograph], dict[str, str]]:
    """The photos that are neither blurred nor dark, and why the others are left out."""
    sharp, bright = np.zeros(len(photos)), np.zeros(len(photos))
    for i, photo in enumerate(photos):
        pixels = read_upright(photo.path)
        sharp[i], bright[i] = sharpness(pixels), np.quantile(pixels[::4, ::4], 0.99) / np.iinfo(pixels.dtype).max
        report("photos", (i + 1) / len(photos))
    reasons = {}
    for photo, s, b in zip(photos, sharp, bright):
        if b < DARK:
            reasons[photo.name] = "too dark"
        elif s < BLURRED * np.median(sharp):
            reasons[photo.name] = f"blurred: {100 * s / np.median(sharp):.0f} % of the others' sharpness"
    if len(photos) < MIN_PHOTOS:
        few = f"holds {len(photos)} different photos, fewer than {MIN_PHOTOS}; take 30 or more"
        raise InputError(f"{photos[0].path.parent}: {few}")
    if len(reasons) == len(photos):
        raise InputError(f"{photos[0].path.parent}: all photos are too dark; expose them longer")
    return [photo for photo in photos if photo.name not in reasons], reasons


def _upright_copies(photos: list[Photograph], work: Path) -> Path:
    """The folder `work/photos` with a folder for each lens; files that COLMAP reads as they are, are linked."""
    folder = work / "photos"
    remove_partial(folder)  # COLMAP would read them as photos
    lenses = sorted({photo.lens for photo in photos})
    for photo in photos:
        group = folder / f"lens_{lenses.index(photo.lens) + 1}"
        group.mkdir(parents=True, exist_ok=True)
        suffix = photo.path.suffix.lower()
        as_is = suffix in (".jpg", ".jpeg", ".png") and is_upright(photo)
        target = group / f"{file_name(photo.name)}{suffix if as_is else '.png'}"
        if target.exists():
            continue
        if as_is:
            target.symlink_to(photo.path.resolve())
        else:
            with atomic_path(target) as temporary:
                pixels = read_upright(photo.path)
                pixels = pixels if pixels.dtype == np.uint8 else (pixels >> 8).astype(np.uint8)
                Image.fromarray(pixels).save(temporary, format="PNG", compress_level=1)
    return folder


def _without_camera(photos: list[Photograph], placed: list[str], source: Path) -> dict[str, str]:
    """Why photos are left out whose names are not among those with a camera; a note where they are many."""
    lost = sorted({photo.name for photo in photos} - set(placed))
    if len(lost) > FEW_LOST * len(photos):
        note(
            f"{source}: {len(lost)} of {len(photos)} photos do not fit together with the others; take more between them, and leave "
            "the object where it stands, or give --turntable where it turned before the camera"
        )
    return dict.fromkeys(lost, "its camera was not found: too little in common with the others")


def exposures_of(
    scene: Reconstruction, by_name: dict[str, Photograph], report: Callable[[str, float], None]
) -> Exposures:
    """The exposures by the photos' values at the points that they show."""
    values, radii = np.zeros(len(scene.photo_of)), np.zeros(len(scene.photo_of))
    for i, name in enumerate(scene.names):
        lens, here = scene.lenses[i], scene.photo_of == i
        pixels = read_upright(by_name[name].path)
        luminance = srgb_to_linear(pixels / np.float32(np.iinfo(pixels.dtype).max)) @ np.float32(
            [0.2126, 0.7152, 0.0722]
        )
        padded = np.pad(luminance, 1, mode="edge")
        smooth = sum(padded[a : a + lens.height, b : b + lens.width] for a in range(3) for b in range(3)) / 9
        x, y = scene.observed[here].astype(int).T
        values[here] = smooth[y.clip(0, lens.height - 1), x.clip(0, lens.width - 1)]
        half_diagonal = 0.5 * np.hypot(lens.width, lens.height)
        radii[here] = np.linalg.norm(scene.observed[here] - [lens.cx, lens.cy], axis=1) / half_diagonal
        report("exposures", (i + 1) / len(scene.names))
    by_file = np.array([by_name[name].exposure or np.nan for name in scene.names])
    return find_exposures(scene.photo_of, scene.point_of, values, radii, by_file)


def write_data(
    world: World,
    exposures: Exposures,
    by_name: dict[str, Photograph],
    mask_of: dict[str, Path] | None,
    out: Path,
    settings: PrepareSettings,
    report: Callable[[str, float], None],
) -> np.ndarray:
    """Writes what `prepare` names but the page, and of found masks `behind/` and `ground.json`; returns [n] each mask's share."""
    scene, pinholes = world.scene, [pinhole_of(lens, settings.max_size) for lens in world.scene.lenses]
    for folder in ("images", "masks"):
        (out / folder).mkdir(exist_ok=True)
    for i, (name, pinhole) in enumerate(zip(scene.names, pinholes)):
        photo = without_vignetting(read_upright(by_name[name].path), scene.lenses[i], exposures.vignetting)
        write_png(out / "images" / f"{name}.png", undistort(photo, scene.lenses[i], pinhole))
        report("images", (i + 1) / len(scene.names))
    if mask_of is None:
        _write_transforms(world, exposures, pinholes, out, [{}] * len(pinholes), turntable=settings.turntable)
    shares, files = [], []
    try:
        if mask_of is None:
            found = find_masks(out, world, settings.seed, settings.turntable, lambda share: report("masks", share))
        else:
            found = ((mask, None) for mask in given_masks(world, mask_of, settings.masks, settings.max_size))
        for name, pinhole, (mask, behind) in zip(scene.names, pinholes, found):
            small, size = Image.fromarray((255 * mask + 0.5).astype(np.uint8)), (pinhole.width, pinhole.height)
            write_png(out / "masks" / f"{name}.png", np.asarray(small.resize(size, Image.Resampling.BILINEAR)))
            files.append({"mask_path": f"masks/{name}.png"})
            if behind is not None:
                files[-1]["behind_path"] = f"behind/{name}.png"
                (out / "behind").mkdir(exist_ok=True)
                write_image(out / files[-1]["behind_path"], behind)
            shares.append(mask.mean())
    except BaseException:
        if mask_of is None:
            (out / TRANSFORMS).unlink()  # data without their masks are half of the data
        raise
    _write_transforms(world, exposures, pinholes, out, files, turntable=settings.turntable)
    if not settings.turntable:  # what is around the object stands elsewhere in each photo
        write_image(out / SURROUNDINGS, surroundings_of(world, exposures, out, settings))
    return np.array(shares)


def surroundings_of(world: World, exposures: Exposures, out: Path, settings: PrepareSettings) -> np.ndarray:
    """What the written images show around the object, see :func:`splitnerf_tools.capture.surroundings.surroundings`."""
    scene = world.scene
    points = scene.points[world.object_points]
    centre = np.median(points, axis=0) if len(points) else np.zeros(3)

    def shots() -> Iterator[Shot]:
        for i, name in enumerate(scene.names):
            files = (str(out / folder / f"{name}.png") for folder in ("images", "masks"))
            image, mask = (cv2.imread(file, cv2.IMREAD_UNCHANGED) for file in files)
            lens = pinhole_of(scene.lenses[i], settings.max_size)
            yield Shot(image[..., ::-1], mask > 127, scene.poses[i], lens, float(exposures.gains[i]))

    return surroundings(shots(), centre, world.table_radius)


def _write_transforms(
    world: World, exposures: Exposures, pinholes: list[Lens], out: Path, files: list[dict], *, turntable: bool
) -> None:
    """`transforms.json`, with the files that each frame has beside its image, and the light's rotations on a turntable."""
    frames, turns = [], light_turns(world.scene.poses)
    for i, (name, pinhole) in enumerate(zip(world.scene.names, pinholes)):
        frames.append(
            {
                "file_path": f"images/{name}.png",
                **files[i],
                "w": pinhole.width,
                "h": pinhole.height,
                "fl_x": pinhole.fx,
                "fl_y": pinhole.fy,
                "cx": pinhole.cx,
                "cy": pinhole.cy,
                "exposure": float(exposures.gains[i]),
                "transform_matrix": world.scene.poses[i].tolist(),
                **({"light_rotation": turns[i].tolist()} if turntable else {}),
            }
        )
    content = {"camera_model": "PINHOLE", "mask_kind": "object", "frames": frames}
    write_json(out / TRANSFORMS, content)
