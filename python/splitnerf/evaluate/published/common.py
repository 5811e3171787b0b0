"""Shared by the protocols of published sets: the delivered asset, its renderings at a set's cameras, and the scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from splitnerf.data.asset import Asset, Material
from splitnerf.data.images import linear_to_srgb, read_header
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import lens_intrinsics
from splitnerf.errors import InputError
from splitnerf.evaluate.lpips import Distance
from splitnerf.evaluate.relight import FIRST_SEED
from splitnerf.evaluate.similarity import image_scores
from splitnerf.render.path_traced import MOST_SPP, MOST_VIEWS, AssetRenderer

Column = tuple[str, str, str]  # key, title, format


@dataclass(frozen=True)
class Options:
    """The options of an evaluation.

    Attributes:
        spp: Paths a pixel.
        maps: A folder of lights, for sets whose data do not hold them; or None.
        truth: The folder of the truth, for sets that keep it elsewhere; or None.
        views: Test views, evenly spread, for protocols that take all; None for all.
        distance: The LPIPS distance; None leaves LPIPS out.
    """

    spp: int = 128
    maps: Path | None = None
    truth: Path | None = None
    views: int | None = None
    distance: Distance | None = None

    def __post_init__(self) -> None:
        for name, value, most in (("spp", self.spp, MOST_SPP), ("views", self.views, MOST_VIEWS)):
            if value is not None and not 1 <= value <= most:
                raise InputError(f"--{name} must be at least 1 and at most {most}, got {value}")
        for name, folder in (("maps", self.maps), ("truth", self.truth)):
            if folder is not None and not folder.is_dir():
                raise InputError(f"{folder}: no such folder; give --{name} a folder")


@dataclass
class Scores:
    """The scores of a protocol.

    Attributes:
        means: The numbers of the table by key; None where the data hold no truth.
        images: The numbers of each image, with its name.
        notes: Restrictions of the scores, for the reader.
    """

    means: dict[str, float | None]
    images: list[dict] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


class Delivered:
    """An asset in the world of the data.

    Args:
        asset: The asset.
        environment: [h, w, 3] the light of the photos as it was recovered, or None.
        origin: [3] the point of the data's world that is the asset's origin.
        spp: Paths a pixel.
    """

    def __init__(self, asset: Asset, environment: np.ndarray | None, origin: np.ndarray, spp: int):
        self.asset, self.environment, self.origin, self.spp = asset, environment, origin, spp
        self.renderer = AssetRenderer(asset)
        self._seed = FIRST_SEED

    def render(self, frame: Frame, light: np.ndarray | None, factor: int = 1) -> dict[str, np.ndarray]:
        """The maps of `AssetRenderer.render` at a frame's camera.

        Args:
            frame: The frame; its photo's file has the size.
            light: [h, w, 3]; None: any, for maps that do not depend on it.
            factor: The integer by which the photo is larger.
        """
        header, pose = read_header(frame.image_path), frame.pose.copy()
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

    @property
    def vertices(self) -> np.ndarray:
        """[n, 3] float64 in the data's world."""
        return self.asset.vertices + self.origin


def _scaled(material: Material, scale: np.ndarray) -> Material:
    factor = np.asarray(material.albedo) * scale
    if material.albedo_texture is None:
        return replace(material, albedo=tuple(float(x) for x in factor.clip(0, 1)))
    texture = (material.albedo_texture * factor).clip(0, 1).astype(np.float32)
    return replace(material, albedo=(1.0, 1.0, 1.0), albedo_texture=texture)


def srgb_on_white(maps: dict[str, np.ndarray]) -> np.ndarray:
    """[H, W, 3] the image of a rendering, clipped, in sRGB over white, composited as image viewers do."""
    alpha = maps["alpha"][..., None]
    straight = linear_to_srgb(np.clip(maps["radiance"] / np.maximum(alpha, 1e-8), 0, 1))
    return straight * alpha + 1 - alpha


def compared(image: np.ndarray, truth: np.ndarray, options: Options, prefix: str = "") -> dict[str, float | None]:
    """PSNR, SSIM and LPIPS of sRGB images [H, W, 3] in [0, 1], by keys with a prefix."""
    return {f"{prefix}{key}": value for key, value in image_scores(image, truth, options.distance).items()}


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors [..., 3] of length 1; 0 stays 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-8)


def angles_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[...] the angles in degrees between unit vectors [..., 3], stable near 0 and 180."""
    return np.degrees(2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)))


def mean_of(images: Sequence[dict], key: str) -> float | None:
    """The mean of a number over the images that have it; None where none has."""
    values = [image[key] for image in images if image.get(key) is not None]
    return float(np.mean(values)) if values else None


def nearest(points: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """[n] the distance from each of points [n, 3] to the nearest of targets [m, 3].

    Raises:
        InputError: One of them is empty.
    """
    if not len(points) or not len(targets):
        raise InputError(
            "nothing is left to compare: the mesh and the truth do not show the same place; check the data"
        )
    return cKDTree(targets).query(points)[0]
