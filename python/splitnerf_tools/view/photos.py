"""The photos of a run for the viewer: cameras, and pixels without lens distortion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from splitnerf.data.frames import read_frames
from splitnerf.data.images import encode_image
from splitnerf.data.lens import lens_intrinsics
from splitnerf.data.photos import check_files, load_photo
from splitnerf.data.pixels import decoded
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.files import reason

LARGEST = 1600  # pixels of a photo's longer side in the page


class ViewedPhotos:
    """All photos of a data set, in its order.

    Args:
        root: The data's folder.

    Raises:
        InputError: The data cannot be used, or an image is missing.
    """

    def __init__(self, root: Path):
        if not root.is_dir():
            raise InputError(f"{root}: no such folder; give the folder of the data that the run was trained on")
        frames, _ = read_frames(root, "train", Reading(eval_mode="all"))
        self._frames = [replace(frame, mask_path=None, dynamic_mask_path=None) for frame in frames]
        (self.height, self.width), _ = check_files(self._frames, 1)

    def __len__(self) -> int:
        return len(self._frames)

    def cameras(self) -> list[dict]:
        """For each photo, for JSON: `name`, `pose` (camera-to-world, row by row, OpenGL axes), `intrinsics` (fx, fy,
        cx, cy in pixels of the file), `width`, `height`, and `exposure`, the factor of its linear values that the data
        state."""
        size = (self.height, self.width)
        return [
            {
                "name": frame.name, "pose": frame.pose.ravel().tolist(), "intrinsics": lens_intrinsics(frame.lens, size).tolist(),
                "width": self.width, "height": self.height, "exposure": frame.exposure,
            }
            for frame in self._frames
        ]  # fmt: skip

    def png(self, number: int) -> bytes:
        """A photo without its lens's distortion, averaged down to at most 1600 pixels; transparent at invalid pixels.

        Raises:
            InputError: It cannot be read, or is gone.
        """
        frame, factor = self._frames[number], -(-max(self.height, self.width) // LARGEST)
        try:
            photo = load_photo(frame, factor, "object")
        except OSError as error:
            raise InputError(f"{frame.image_path}: cannot be read ({reason(error)}); is the data's folder still there?") from None
        rgba = decoded(photo.rgba)
        if photo.known is not None:
            rgba[..., 3] *= photo.known
        return encode_image(np.ascontiguousarray(rgba), ".png", frame.name)
