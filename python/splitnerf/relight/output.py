"""Files of relit pictures: PNG and EXR a frame, GIF and MP4 of all."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from PIL import Image

from splitnerf.data.frames import refuse_data
from splitnerf.data.images import is_written_here, linear_to_srgb, straight_srgb, to_uint8, write_image
from splitnerf.errors import InputError
from splitnerf.files import atomic_path

GIF, MP4 = "animation.gif", "animation.mp4"
FRAME = re.compile(r"\d{3,}\.exr")


def file_names(n_frames: int, *, gif: bool, mp4: bool) -> list[str]:
    """The names of the files that a call writes into a folder."""
    frames = [f"{index:03d}.{suffix}" for index in range(n_frames) for suffix in ("exr", "png")]
    return frames + [GIF] * gif + [MP4] * mp4


def own_files(folder: Path) -> set[str]:
    """The names of the files in a folder that an earlier call wrote: frames whose EXR says so, and their animations."""
    frames = [path for path in folder.glob("*.exr") if FRAME.fullmatch(path.name) and is_written_here(path)]
    pictures = {name for path in frames for name in (path.name, f"{path.stem}.png")}
    return {name for name in pictures | ({GIF, MP4} if frames else set()) if (folder / name).exists()}


def check_folder(folder: Path, names: list[str], *, overwrite: bool) -> set[str]:
    """The files of an earlier call in a folder, which files of these names would replace. Raises InputError where there
    are some and `overwrite` is false, or a file of one of the names is from another program."""
    refuse_data(folder)
    own = own_files(folder)
    if own and not overwrite:
        raise InputError(f"{folder}: holds frames already; replace them with --overwrite, or give another --out")
    foreign = [name for name in names if name not in own and (folder / name).exists()]
    if foreign:
        raise InputError(f"{folder / foreign[0]}: was not written by relight and would be lost; give another --out")
    return own


def write_frame(folder: Path, index: int, linear: np.ndarray, *, with_alpha: bool) -> None:
    """Writes NNN.exr (linear, half, alpha associated) and NNN.png (sRGB, alpha straight), each atomically, of a picture
    [h, w, 4] float32, linear, premultiplied; without alpha where it is not asked for."""
    channels = 4 if with_alpha else 3
    stored = np.minimum(linear[..., :channels], np.finfo(np.float16).max)
    write_image(folder / f"{index:03d}.exr", stored, half=True)
    straight = np.dstack([straight_srgb(linear[..., :3], linear[..., 3]), linear[..., 3]])
    write_image(folder / f"{index:03d}.png", straight[..., :channels])


def display_frame(linear: np.ndarray) -> np.ndarray:
    """[h, w, 3] uint8 sRGB for animations, which have no partial alpha: over white, in linear light."""
    over_white = linear[..., :3] + (1 - linear[..., 3:])
    return to_uint8(linear_to_srgb(np.clip(over_white, 0, 1)))


def write_gif(path: Path, frames: list[np.ndarray], fps: float) -> None:
    """Writes an endless GIF of frames [h, w, 3] uint8 atomically, each with its own 256 colours; the format counts
    hundredths of a second."""
    pictures = [Image.fromarray(frame).quantize(256, dither=Image.Dither.FLOYDSTEINBERG) for frame in frames]
    milliseconds = max(20, round(100 / fps) * 10)
    with atomic_path(path) as temporary:
        pictures[0].save(
            temporary, save_all=True, append_images=pictures[1:], duration=milliseconds, loop=0, disposal=1
        )


def require_ffmpeg() -> None:
    """Checks that MP4 can be written. Raises InputError where the optional package is missing."""
    try:
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise InputError("--mp4 needs the package imageio-ffmpeg; `pip install splitnerf[video]`") from None


def write_mp4(path: Path, frames: list[np.ndarray], fps: float) -> None:
    """Writes an H.264 video of frames [h, w, 3] uint8 atomically; an odd last row or column is dropped, the codec takes
    even sizes only. Raises OSError where ffmpeg cannot write it."""
    import imageio_ffmpeg

    height, width = (side - side % 2 for side in frames[0].shape[:2])
    with atomic_path(path) as temporary:
        writer = imageio_ffmpeg.write_frames(
            str(temporary),
            (width, height),
            fps=fps,
            codec="libx264",
            quality=8,
            macro_block_size=2,
            ffmpeg_log_level="error",
        )
        writer.send(None)
        for frame in frames:
            writer.send(np.ascontiguousarray(frame[:height, :width]))
        writer.close()  # raises nothing if the disk was full
        if imageio_ffmpeg.count_frames_and_secs(str(temporary))[0] != len(frames):
            raise OSError(f"{path}: ffmpeg cannot write it; the disk may be full")
