"""Files of relit pictures: PNG and EXR a frame, GIF and MP4 of all."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from PIL import Image

from splitnerf.data.images import atomic_path, linear_to_srgb, to_uint8, write_image
from splitnerf.errors import InputError

GIF, MP4 = "animation.gif", "animation.mp4"
FRAME = re.compile(r"\d{3,}\.(png|exr)")


def prepare_folder(folder: Path, *, overwrite: bool) -> None:
    """Removes the frames and animations of an earlier call, or refuses a folder that has some.

    Raises:
        InputError: It holds frames and `overwrite` is false, or is no folder.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; give --out a folder")
    if not folder.exists():
        return
    present = [path for path in folder.iterdir() if path.name in (GIF, MP4) or FRAME.fullmatch(path.name)]
    if present and not overwrite:
        raise InputError(f"{folder}: holds frames already; replace them with --overwrite, or give another --out")
    for path in present:
        path.unlink()


def write_frame(folder: Path, index: int, linear: np.ndarray, *, with_alpha: bool) -> None:
    """Writes NNN.exr (linear, half, alpha associated) and NNN.png (sRGB, alpha straight), each atomically.

    Args:
        folder: Made where it is missing.
        index: The frame's number.
        linear: [h, w, 4] float32, premultiplied.
        with_alpha: Whether alpha is written.
    """
    channels = 4 if with_alpha else 3
    stored = np.minimum(linear[..., :channels], np.finfo(np.float16).max)
    write_image(folder / f"{index:03d}.exr", stored, half=True)
    write_image(folder / f"{index:03d}.png", straight_srgb(linear)[..., :channels])


def straight_srgb(linear: np.ndarray) -> np.ndarray:
    """[..., 4] sRGB with straight alpha, colours clipped to [0, 1], from linear premultiplied ones; 0 where clear."""
    alpha = linear[..., 3:]
    straight = np.where(alpha > 0, linear[..., :3] / np.maximum(alpha, 1e-8), 0)
    return np.concatenate([linear_to_srgb(np.clip(straight, 0, 1)), alpha], axis=-1).astype(np.float32)


def display_frame(linear: np.ndarray) -> np.ndarray:
    """[h, w, 3] uint8 sRGB for animations, which know no partial alpha: over white, in linear light."""
    over_white = linear[..., :3] + (1 - linear[..., 3:])
    return to_uint8(linear_to_srgb(np.clip(over_white, 0, 1)))


def write_gif(path: Path, frames: list[np.ndarray], fps: float) -> None:
    """Writes an endless GIF atomically, each frame with its own 256 colours.

    Args:
        path: The file.
        frames: Each [h, w, 3] uint8.
        fps: Pictures a second; the format counts hundredths of a second.
    """
    pictures = [Image.fromarray(frame).quantize(256, dither=Image.Dither.FLOYDSTEINBERG) for frame in frames]
    milliseconds = max(20, round(100 / fps) * 10)
    with atomic_path(path) as temporary:
        pictures[0].save(
            temporary, save_all=True, append_images=pictures[1:], duration=milliseconds, loop=0, disposal=1
        )


def require_ffmpeg() -> None:
    """Checks that MP4 can be written.

    Raises:
        InputError: The optional package is missing.
    """
    try:
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        raise InputError("--mp4 needs the package imageio-ffmpeg; `pip install splitnerf[video]`") from None


def write_mp4(path: Path, frames: list[np.ndarray], fps: float) -> None:
    """Writes an H.264 video atomically; an odd last row or column is dropped, the codec takes even sizes only.

    Args:
        path: The file.
        frames: Each [h, w, 3] uint8, at least 2x2.
        fps: Pictures a second.

    Raises:
        OSError: ffmpeg cannot write it.
    """
    import imageio_ffmpeg

    height, width = (side - side % 2 for side in frames[0].shape[:2])
    with atomic_path(path) as temporary:
        writer = imageio_ffmpeg.write_frames(
            str(temporary), (width, height), fps=fps, codec="libx264", quality=8, macro_block_size=2,
            ffmpeg_log_level="error",
        )  # fmt: skip
        writer.send(None)
        for frame in frames:
            writer.send(np.ascontiguousarray(frame[:height, :width]))
        writer.close()
