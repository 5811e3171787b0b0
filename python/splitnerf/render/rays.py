"""Pinhole rays: through image points, of whole images, and drawn for training."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.dataset import Dataset
from splitnerf.data.pixels import PixelReader
from splitnerf.devices import tensor_cores
from splitnerf.memory import give_back
from splitnerf.ops import EdgeRuns, PixelList, draw_rays
from splitnerf.render.edges import EdgePixels, edge_of
from splitnerf.render.masks import pixel_list, reduced, runs_of, widened

HULL_EDGE = 400  # pixels, about, along the shorter edge of the masks that make the hull


def pixel_rays(pose: Tensor, intrinsics: Tensor, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
    """World rays through image points.

    Args:
        pose: [n, 4, 4] or [4, 4] camera-to-world, OpenGL axes (x right, y up, looking along -z).
        intrinsics: [n, 4] or [4], fx, fy, cx, cy in pixels.
        x, y: [n] pixels; the centre of pixel (column, row) is (column + 0.5, row + 0.5).

    Returns:
        origins and unit directions, [n, 3] each, in the world's units.
    """
    directions = through_pixels(pixel_matrix(pose, intrinsics), x, y)
    return pose[..., :3, 3].expand_as(directions).contiguous(), directions


def pixel_matrix(pose: Tensor, intrinsics: Tensor) -> Tensor:
    """[..., 3, 3] matrices that map an image point (x, y, 1) to its world direction, not normalised.

    Args:
        pose, intrinsics: See :func:`pixel_rays`.
    """
    fx, fy, cx, cy = intrinsics.unbind(-1)
    zero, one = torch.zeros_like(fx), torch.ones_like(fx)
    rows = [1 / fx, zero, -cx / fx, zero, -1 / fy, cy / fy, zero, zero, -one]
    with tensor_cores(False):
        return pose[..., :3, :3] @ torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def through_pixels(matrix: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """[n, 3] unit directions through image points x, y [n]; the matrices [n, 3, 3] or [3, 3] are
    :func:`pixel_matrix`'s."""
    points = torch.stack([x, y, torch.ones_like(x)], dim=-1)
    return F.normalize((matrix * points[..., None, :]).sum(-1), dim=-1)


def projected(points: Tensor, intrinsics: Tensor) -> Tensor:
    """[..., 2] image points of points [..., 3] in the camera's axes; those behind the camera have no meaning."""
    fx, fy, cx, cy = intrinsics.unbind()
    depth = (-points[..., 2]).clamp(min=1e-6)
    return torch.stack([cx + fx * points[..., 0] / depth, cy - fy * points[..., 1] / depth], -1)


def image_rays(pose: Tensor, intrinsics: Tensor, height: int, width: int) -> tuple[Tensor, Tensor]:
    """Rays through all pixel centres of an image, row by row, [H * W, 3] each."""
    rows, columns = (torch.arange(n, device=pose.device) + 0.5 for n in (height, width))
    y, x = torch.meshgrid(rows, columns, indexing="ij")
    return pixel_rays(pose, intrinsics, x.reshape(-1), y.reshape(-1))


class DrawnRays(NamedTuple):
    """Rays through pixels of photos.

    Attributes:
        rays_o, rays_d: [n, 3] origins and unit directions.
        pixels: [n, 4] sRGB of the photos as they are, in [0, 1], straight alpha.
        view: [n] int64, the photos' numbers.
        exposure: [n, 3] the factors of the photos' linear values.
        background: [n, 3] sRGB colours behind the pixels; at edges the photo's background, filled in.
        whole: [n] bool, the pixels along the masks' edges.
    """

    rays_o: Tensor
    rays_d: Tensor
    pixels: Tensor
    view: Tensor
    exposure: Tensor
    background: Tensor
    whole: Tensor


class PixelSource:
    """Draws training rays: most of them near the objects' masks, the rest anywhere.

    Args:
        dataset: The train split; invalid pixels are never drawn.
        foreground_share: Share of the rays, in [0, 1], that are drawn within a few pixels of a mask.
        generator: The random generator of the pixels; images and cameras are kept on its device.
        edge_pixels: The width on each side of the masks' edges in pixels of `edges`; 0: none.

    Attributes:
        edges: The pixels along the masks' edges; None where there are none, or the photos have no colours outside.
        turns: [views, 3, 3] the rotations of the photos' light, see :class:`splitnerf.data.dataset.Dataset`, or None.
        foreground, known: The valid pixels near a mask, and all valid pixels.
        possible: [n, h, w] bool, where the photos may show the object: within the masks, and at invalid pixels. Those
            of large photos are smaller by `hull_factor`, a pixel being true where one within it is.
    """

    def __init__(self, dataset: Dataset, foreground_share: float, generator: torch.Generator, edge_pixels: int = 0):
        self.device = generator.device
        self.poses, self.intrinsics = (torch.from_numpy(x).to(self.device) for x in (dataset.poses, dataset.intrinsics))
        self.pixels = PixelReader(dataset.images, self.device)
        self.turns = None if dataset.light_turns is None else torch.from_numpy(dataset.light_turns).to(self.device)
        self.matrices, self.origins = pixel_matrix(self.poses, self.intrinsics), self.poses[:, :3, 3].contiguous()
        self.height, self.width = dataset.height, dataset.width
        self.share, self.generator = foreground_share, generator
        near, known, possible, edges = [], [], [], []
        self.hull_factor = max(1, min(self.height, self.width) // HULL_EDGE)
        for i in range(len(dataset)):
            alpha, known_here = dataset.images[i, ..., 3], None
            mask = torch.from_numpy(alpha > 0)
            wide, seen = widened(mask, max(2, self.width // 50)), mask
            if dataset.known is not None:
                known_here = torch.from_numpy(np.array(dataset.known[i]))
                wide, seen = wide & known_here, mask | ~known_here
                known.append(runs_of(known_here))
            if edge_pixels and dataset.whole:
                known_here = None if known_here is None else known_here.numpy()
                edges.append(edge_of(dataset.images.codes[i, ..., :3], alpha, known_here, edge_pixels))
            near.append(runs_of(wide))
            possible.append(reduced(seen, self.hull_factor))
            del alpha, mask, wide, seen, known_here
            # else a photo's arrays, large ones, leave gaps between the runs that stay: 13 MB at 12 megapixels
            give_back()
        self.possible = torch.stack(possible).to(self.device)
        n_pixels = self.height * self.width
        self.foreground = pixel_list(near, n_pixels, self.device)
        n_all = n_pixels * len(dataset)
        self.known = pixel_list(known, n_pixels, self.device) if known else PixelList.all(n_all, self.device)
        has_edges = any(len(behind) for _, behind in edges)
        self.edges = EdgePixels(edges, n_pixels, self.device) if has_edges else None
        self._no_edges = EdgeRuns.none(self.device)

    def draw(
        self, n: int, random: Tensor | None = None, backgrounds: Tensor | None = None, exposures: Tensor | None = None
    ) -> DrawnRays:
        """Draws n rays; see :func:`splitnerf.ops.draw_rays`.

        Args:
            n: The number of rays.
            random: [n] in [0, 1); None: drawn by the generator.
            backgrounds: [n, 3] sRGB colours behind the pixels that are not at edges; None: black.
            exposures: [views, 3] the photos' factors; None: 1.
        """
        n_near = int(n * self.share) if self.foreground.count else 0
        if random is None:
            random = torch.rand(n, generator=self.generator, device=self.device)
        backgrounds = random.new_zeros(n, 3) if backgrounds is None else backgrounds
        exposures = torch.ones_like(self.origins) if exposures is None else exposures
        rays_o, rays_d, view, index = draw_rays(
            random, n_near, self.foreground, self.known, self.matrices, self.origins, self.height, self.width
        )
        edges = self._no_edges if self.edges is None else self.edges.runs
        pixels, *beside = self.pixels.read(index, view, exposures, backgrounds, edges)
        return DrawnRays(rays_o, rays_d, pixels, view, *beside)
