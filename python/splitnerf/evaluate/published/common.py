"""Shared by the protocols of published sets: options, lights, the delivered asset at a set's cameras, and the scores."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset, Material
from splitnerf.data.environment import MAP_ROWS, read_environment, resize_environment
from splitnerf.data.images import read_header
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import check_shape, lens_intrinsics
from splitnerf.errors import InputError
from splitnerf.evaluate.lpips import Distance
from splitnerf.evaluate.protocol import image_scores
from splitnerf.evaluate.scoring import FIRST_SEED
from splitnerf.render.path_traced import MOST_SPP, MOST_VIEWS, AssetRenderer


@dataclass(frozen=True)
class Options:
    """The options of an evaluation.

    Attributes:
        spp: Paths a pixel.
        maps: A folder of lights, for sets whose data do not hold them; or None.
        views: Test views, evenly spread, for protocols that take all; None for all.
        distance: The LPIPS distance; None leaves LPIPS out.
    """

    spp: int = 128
    maps: Path | None = None
    views: int | None = None
    distance: Distance | None = None

    def __post_init__(self) -> None:
        for name, value, most in (("spp", self.spp, MOST_SPP), ("views", self.views, MOST_VIEWS)):
            if value is not None and not 1 <= value <= most:
                raise InputError(f"--{name} must be at least 1 and at most {most}, got {value}")
        if self.maps is not None and not self.maps.is_dir():
            raise InputError(f"{self.maps}: no such folder; give --maps a folder")


@dataclass
class Scores:
    """The numbers of each image by key, with its name; and restrictions, for the reader."""

    images: list[dict]
    notes: list[str]


@dataclass(frozen=True)
class LitView:
    """A photo, its light's name, and what reads the light: [h, w, 3] linear radiance, equirectangular, in the data's
    world as :func:`splitnerf.data.environment.read_environment` has it."""

    frame: Frame
    light: str
    radiance: Callable[[], np.ndarray]


def light_of(path: Path) -> Callable[[], np.ndarray]:
    """Reads a map, at most 512 rows of it, when it is called."""

    def read() -> np.ndarray:
        radiance = read_environment(path)
        if radiance.shape[0] > MAP_ROWS:
            radiance = resize_environment(radiance, MAP_ROWS, 2 * MAP_ROWS)
        return radiance

    return read


class Delivered:
    """An asset in the world of the data, with the light [h, w, 3] of the photos as it was recovered (or None), the
    point [3] of the data's world that is its origin, and paths a pixel."""

    def __init__(self, asset: Asset, environment: np.ndarray | None, origin: np.ndarray, spp: int):
        self.asset, self.environment, self.origin, self.spp = asset, environment, origin, spp
        self.renderer = AssetRenderer(asset)
        self._seed = FIRST_SEED

    def render(self, frame: Frame, light: np.ndarray | None, factor: int = 1) -> dict[str, np.ndarray]:
        """The maps of `AssetRenderer.render` at a frame's camera, smaller than its photo by an integer factor, under a
        light [h, w, 3]; None: any, for maps that do not depend on it."""
        header, pose = read_header(frame.image_path), frame.pose.copy()
        check_shape(frame.lens, (header.height, header.width), frame.image_path)
        height, width = header.height // factor, header.width // factor
        pose[:3, 3] -= self.origin
        lens = lens_intrinsics(frame.lens, (header.height, header.width)) / factor
        self._seed += 1
        light = np.ones((2, 4, 3), np.float32) if light is None else light
        return self.renderer.render(light, pose, tuple(lens), width, height, spp=self.spp, seed=self._seed)

    def with_albedo(self, scale: np.ndarray) -> Delivered:
        """The same with albedo times a factor per channel, clipped to 1."""
        if self.asset.colors is not None:  # vertex colours and factors are multiplied, and no factor is above 1
            asset = replace(self.asset, colors=(self.asset.colors * scale).clip(0, 1).astype(np.float32))
        else:
            asset = replace(self.asset, materials=[_scaled(material, scale) for material in self.asset.materials])
        return Delivered(asset, self.environment, self.origin, self.spp)


def _scaled(material: Material, scale: np.ndarray) -> Material:
    factor = np.asarray(material.albedo) * scale
    if material.albedo_texture is None:
        return replace(material, albedo=tuple(float(x) for x in factor.clip(0, 1)))
    texture = (material.albedo_texture * factor).clip(0, 1).astype(np.float32)
    return replace(material, albedo=(1.0, 1.0, 1.0), albedo_texture=texture)


def compared(image: np.ndarray, truth: np.ndarray, options: Options, prefix: str = "") -> dict[str, float | None]:
    """PSNR, SSIM and LPIPS of sRGB images [H, W, 3] in [0, 1], by keys with a prefix."""
    return {f"{prefix}{key}": value for key, value in image_scores(image, truth, options.distance).items()}
