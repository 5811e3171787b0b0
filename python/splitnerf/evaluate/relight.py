"""Relighting: an asset path traced from the test cameras under other lights, against the data's images."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.images import linear_to_srgb, srgb_to_linear, to_uint8
from splitnerf.data.relit import read_relit
from splitnerf.evaluate.lpips import Distance
from splitnerf.evaluate.similarity import ScaledView, scaled_scores
from splitnerf.render.path_traced import AssetRenderer

FIRST_SEED = 1 << 31  # data are rendered with smaller ones, so that prediction and truth never share their noise


@dataclass
class RelitViews:
    """The rendered relit views.

    Attributes:
        images: The images [H, W, 4] uint8, sRGB with straight alpha, by map and by view of `dataset`.
        dataset: The views.
        spp: Paths a pixel.
    """

    images: dict[str, list[np.ndarray]]
    dataset: Dataset
    spp: int

    def views(self) -> Iterator[ScaledView]:
        """Each image with its truth, grouped by map; a truth image is read when its turn comes."""
        for name, images in self.images.items():
            for i in range(len(images)):
                yield self.view(name, i)

    def view(self, name: str, index: int) -> ScaledView:
        """One image with its truth."""
        prediction = self.images[name][index].astype(np.float32) / 255
        truth = read_relit(self.dataset, index, name)
        return ScaledView(
            name, srgb_to_linear(prediction[..., :3]), prediction[..., 3], srgb_to_linear(truth[..., :3]), truth[..., 3]
        )


def straight_srgb(maps: dict[str, np.ndarray]) -> np.ndarray:
    """[H, W, 3] straight sRGB colours in [0, 1] from a rendering's premultiplied `radiance` and `alpha`."""
    straight = maps["radiance"] / np.maximum(maps["alpha"], 1e-8)[..., None]
    return np.clip(linear_to_srgb(straight), 0, 1)


def render_view(
    renderer: AssetRenderer, dataset: Dataset, index: int, environment: np.ndarray, spp: int
) -> dict[str, np.ndarray]:
    """The asset's maps of one view in the data's world frame, see `AssetRenderer.render`."""
    pose, lens = dataset.world_poses[index], dataset.intrinsics[index]
    return renderer.render(
        environment, pose, tuple(lens), dataset.width, dataset.height, spp=spp, seed=FIRST_SEED + index
    )


def relight(renderer: AssetRenderer, dataset: Dataset, maps: dict[str, Path], spp: int) -> RelitViews:
    """Renders all views under all maps.

    Args:
        renderer: The asset, in the data's world frame.
        dataset: The views; the truth of each must exist under each map.
        maps: Environment maps by name.
        spp: Paths a pixel.

    Raises:
        InputError: A map cannot be used, or the truth of a view is missing or unreadable.
    """
    for name in maps:
        for index in range(len(dataset)):
            read_relit(dataset, index, name)
    images = {}
    with tqdm(total=len(maps) * len(dataset), desc="relighting", unit="view", leave=False, disable=None) as progress:
        for name, path in maps.items():
            environment = read_environment(path)
            images[name] = []
            for index in range(len(dataset)):
                rendered = render_view(renderer, dataset, index, environment, spp)
                image = np.concatenate([straight_srgb(rendered), rendered["alpha"][..., None]], axis=-1)
                images[name].append(to_uint8(image))
                progress.update()
    return RelitViews(images, dataset, spp)


def relight_scores(relit: RelitViews, distance: Distance | None = None) -> dict:
    """Scores relit views with one factor per channel for all images of all maps.

    Predictions are 8-bit clipped sRGB images before the factor, as if read from files.

    Returns:
        The scores of :func:`splitnerf.evaluate.similarity.scaled_scores`, `maps` (the headline's scores per map),
        `views` (their number) and `spp`.
    """
    scores, per_map = scaled_scores(relit.views, distance)
    return scores | {"maps": per_map, "views": len(relit.dataset), "spp": relit.spp}
