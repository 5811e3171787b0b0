"""The sharpest frames of a video."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2

from splitnerf.errors import InputError
from splitnerf_tools.capture.photographs import sharpness, write_png

SUFFIXES = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")


def write_frames(video: Path, folder: Path, n: int, report: Callable[[float], None]) -> None:
    """Cuts a video into n windows of equal length and writes the sharpest frame of each as `frame_NNNNN.png`.

    Args:
        video: The file.
        folder: The folder for the frames; frames that are there already are kept.
        n: The number of frames, at least 1.
        report: Called with the share done.

    Raises:
        InputError: The file is no video that can be read.
    """
    reader = cv2.VideoCapture(str(video))
    total = int(reader.get(cv2.CAP_PROP_FRAME_COUNT))
    if not reader.isOpened() or total < 1:
        raise InputError(f"{video}: is no video that can be read; convert it to mp4, or give a folder of photos")
    folder.mkdir(parents=True, exist_ok=True)
    best, most, window = None, -1.0, 0
    for number in range(total + 1):
        read, frame = reader.read() if number < total else (False, None)
        if best is not None and (not read or number * n // total > window):
            write_png(folder / f"frame_{window + 1:05d}.png", best[..., ::-1])
            best, most = None, -1.0
        if not read:
            break
        window = number * n // total
        sharp = sharpness(frame)
        if sharp > most:
            best, most = frame, sharp
        report((number + 1) / total)
    reader.release()
