"""Backgrounds, and compositing renderings over them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from splitnerf.data.environment import sample_environment
from splitnerf.data.images import over_background, read_colours, read_header, read_radiance, srgb_to_linear
from splitnerf.data.pixels import decoded
from splitnerf.relight.cameras import View

TRANSPARENT, WHITE, ENVIRONMENT = "transparent", "white", "environment"
SUBPIXELS = 2


class Background:
    """One of "transparent", "white", "environment", or the path of an image that is scaled to fill and cropped. Raises
    InputError where the image cannot be read."""

    def __init__(self, text: str):
        self.transparent = text == TRANSPARENT
        self.environment = text == ENVIRONMENT
        self._plate: np.ndarray | None = None
        if text not in (TRANSPARENT, WHITE, ENVIRONMENT):
            self._plate = read_plate(Path(text))

    def behind(self, view: View, environment: np.ndarray, exposure: float) -> np.ndarray | None:
        """Linear radiance [height, width, 3] behind the object, None where it is transparent; the exposure is a factor
        on the light [h, w, 3] in this view, white and images stay as they are."""
        if self.transparent:
            return None
        if self.environment:
            return exposure * environment_behind(view, environment)
        if self._plate is not None:
            return fill(self._plate, view.width, view.height)
        return np.ones((view.height, view.width, 3), np.float32)


def read_plate(path: Path) -> np.ndarray:
    """Reads a background image as [h, w, 3] linear; files of 8 and 16 bits are decoded from sRGB and laid over white.
    Raises InputError where it cannot be read."""
    if read_header(path).bits == 32:
        return np.maximum(read_radiance(path), 0)
    pixels = decoded(read_colours(path))
    channels = pixels.shape[2]
    srgb = pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    return srgb_to_linear(over_background(srgb, pixels[..., -1]) if channels in (2, 4) else srgb)


def fill(plate: np.ndarray, width: int, height: int) -> np.ndarray:
    """Scales an image [h, w, 3] so that it covers width x height, and crops it about its centre."""
    bands = map(Image.fromarray, np.float32(plate).transpose(2, 0, 1))
    return np.stack([ImageOps.fit(band, (width, height), Image.Resampling.BILINEAR) for band in bands], axis=-1)


def environment_behind(view: View, environment: np.ndarray) -> np.ndarray:
    """The light as the camera sees it, [height, width, 3], the mean of four rays a pixel."""
    fx, fy, cx, cy = view.intrinsics
    total = np.zeros((view.height, view.width, 3), np.float32)
    offsets = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS
    for dx in offsets:
        for dy in offsets:
            x, y = np.meshgrid((np.arange(view.width) + dx - cx) / fx, (np.arange(view.height) + dy - cy) / fy)
            rays = np.stack([x, -y, -np.ones_like(x)], axis=-1) @ view.pose[:3, :3].T
            total += sample_environment(environment, rays)
    return total / SUBPIXELS**2


def compose(images: dict[str, np.ndarray], behind: np.ndarray | None, exposure: float) -> np.ndarray:
    """Puts a rendering over its background `behind` [h, w, 3]: [h, w, 4] float32, linear, premultiplied; the colour is exposure *
    radiance + (1 - alpha - shadow) * behind, the alpha 1. Without a background (None) the alpha is the sum of both opacities.
    `images` holds `radiance` [h, w, 3] premultiplied by `alpha` [h, w], and with a catcher `shadow` [h, w], the opacity of its
    black shadow, alpha + shadow <= 1; see `AssetRenderer.render`."""
    opacity = np.clip(images["alpha"] + images.get("shadow", 0.0), 0, 1)[..., None]
    color = exposure * images["radiance"]
    if behind is None:
        return np.concatenate([color, opacity], axis=2).astype(np.float32)
    return np.concatenate([color + (1 - opacity) * behind, np.ones_like(opacity)], axis=2).astype(np.float32)
