"""The rays of training steps: the photos that they are drawn from, their masks' edges, and what they show there."""

from __future__ import annotations

import itertools
import math
import mmap
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.data.dataset import CLIPPED, Dataset
from splitnerf.data.lens import pixel_width
from splitnerf.data.pixels import ask_for, at_unit_exposure, averaged_codes, decoded
from splitnerf.errors import note
from splitnerf.memory import give_back
from splitnerf.ops.rays import EdgeRuns, PixelList, draw_rays, read_pixels
from splitnerf.render.rays import pixel_matrix
from splitnerf.render.renderer import ProbePoints
from splitnerf.render.stereo import visual_hull, widened

LEAST_EDGE = 8  # pixels along the shorter edge of an average


def training_photos(dataset: Dataset, config: Config) -> Dataset:
    """The photos themselves, or averages by the largest whole factor that `sampling.pixel_cells` allows. A pixel of an average is
    the mean of its block in linear light, as in a smaller photo, also along the masks' edges. Detail finer than the fields' cells
    is noise to them; the mean of a block has less of it than a pixel, at the same cost of a step."""
    factor = averaging_factor(dataset, config)
    if factor == 1:
        return dataset
    width = config.losses.edge_pixels
    edges = partial(average_with_edges, width=width) if dataset.whole and width > 0 else None
    return dataset.averaged(factor, config.data.max_memory, edges)


def averaging_factor(dataset: Dataset, config: Config) -> int:
    """The integer factor by which photos are averaged down, 1 for none: by the median width of a pixel at the middle of
    the scene's box, or where the box ends for cameras within it."""
    box, most = config.constants.box, max(1, int(dataset.sizes.min()) // LEAST_EDGE)
    pixel = pixel_width(dataset.poses, dataset.intrinsics, np.zeros(3), nearest=box)
    cell = 2 * box / config.finest_cells
    return int(np.clip(config.sampling.pixel_cells * cell / pixel, 1, most))


def without_fine_levels(dataset: Dataset, config: Config) -> Config:
    """The settings with as many levels as have cells of at least ``surface.least_cell`` pixels at the middle of the scene's box,
    and those that are open from the start. A note says how many are left out."""
    surface, box = config.surface, config.constants.box
    pixel = pixel_width(dataset.poses, dataset.intrinsics, np.zeros(3), nearest=box)
    n_levels = surface.n_levels
    while n_levels > config.constants.start_levels and 2 * box / config.finest_cells < surface.least_cell * pixel:
        n_levels -= 1
        config = config.replace({"surface.n_levels": n_levels})
    if n_levels < surface.n_levels:
        note(
            f"{dataset.root}: cells finer than {surface.least_cell:g} pixels are left out: {n_levels} of {surface.n_levels} levels"
        )
    return config


PARTLY = 0.02, 0.98  # a pixel of a coverage in between lies on an edge


def edge_runs(
    photos: list[tuple[tuple[np.ndarray, np.ndarray], np.ndarray]], n_pixels: int, device: torch.device
) -> EdgeRuns:
    """The pixels within a band along the edges of the masks, of the results of :func:`edge_of` for photos with as many pixels, in
    24 bytes a run of neighbours and 3 a pixel. There a mask is not trusted to a pixel: colours are compared including the
    background."""
    if not photos:
        return EdgeRuns.none(device)
    starts, ends = joined([runs for runs, _ in photos], n_pixels)
    before = np.cumsum(ends - starts) - (ends - starts)
    behind = np.concatenate([behind for _, behind in photos])
    return EdgeRuns(*(torch.from_numpy(x).to(device) for x in (starts, ends, before - starts, behind)))


def edge_of(
    colours: np.ndarray, alpha: np.ndarray, known: np.ndarray | None, width: int, told: np.ndarray | None = None
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """The pixels of a photo within `width` pixels of its mask's edges as runs (see :func:`runs_of`), and the sRGB
    colours [k, 3] uint8 behind the object there: those of `told` (see :meth:`splitnerf.data.dataset.Dataset.behind`), elsewhere
    filled in from outside the band. Pixels before a clipped background are left out. `colours` [H, W, 3] are whole numbers or floats
    in [0, 1], `alpha` [H, W] is the mask, `known` [H, W] the valid pixels (None: all)."""
    near, behind = edge_mask(colours, alpha, known, width)
    if told is not None:
        codes = (255 * told[near] + 0.5).astype(np.uint8)
        behind = np.where(codes[:, 3:] > 0, codes[:, :3], behind)
    return runs_of(torch.from_numpy(near)), behind


def edge_mask(
    colours: np.ndarray, alpha: np.ndarray, known: np.ndarray | None, width: int
) -> tuple[np.ndarray, np.ndarray]:
    """The pixels [H, W] bool and the colours [k, 3] of :func:`edge_of`, with the same arguments."""
    near, outside = band(alpha, width)
    if known is not None:
        near, outside = near & known, outside & known
    place, behind = filled_in(colours, near, outside, width)
    scale = 255 if colours.dtype.kind == "f" else 255 / np.iinfo(colours.dtype).max
    behind = (behind * np.float32(scale) + np.float32(0.5)).astype(np.uint8)
    certain = behind.max(axis=1) < 255 * CLIPPED  # elsewhere the mask decides where the edge is
    near = np.zeros_like(near)
    near.reshape(-1)[place[certain]] = True
    return near, behind[certain]


def average_with_edges(photo: np.ndarray, factor: int, known: np.ndarray | None, width: int) -> np.ndarray:
    """A photo [H, W, 4] averaged down to [h, w, 4] uint16 as :func:`edge_runs` has it compared: within `width` pixels of the mask's
    edges and outside, means of object and background, else of the object alone. `known` [h, w] are the valid averages."""
    result, whole = (averaged_codes(photo, factor, object_alone=alone) for alone in (True, False))
    whole, alpha = whole[..., :3], decoded(result[..., 3])
    shown = edge_mask(whole, alpha, known, width)[0] | (alpha <= PARTLY[0])
    result[shown, :3] = whole[shown]
    return result


def band(alpha: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """[H, W] bool each: the pixels within `width` of the edge of a mask [H, W], and those more than twice as far
    outside it, which the object does not touch where the mask is wrong by no more than the band is wide."""
    inside, partly = torch.from_numpy(alpha > 0.5), torch.from_numpy((alpha > PARTLY[0]) & (alpha < PARTLY[1]))
    near = (widened(inside, width) & widened(~inside, width)) | partly
    return near.numpy(), (~widened(inside | partly, 2 * width) & ~near).numpy()


def filled_in(colours: np.ndarray, near: np.ndarray, outside: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The pixels [k] of a band `near` [H, W] that have some `outside` within reach, and their mean colour [k, 3],
    weighted by a Gaussian of deviation `size`, half the band's width, over every third pixel in both directions."""
    height, width = near.shape
    reach = 3 * (size + 1)
    step = np.arange(-reach, reach + 1, 3)
    weights = np.exp(-0.5 * (step[:, None] ** 2 + step**2) / size**2).astype(np.float32).ravel()
    place = np.flatnonzero(near)
    total, sums = np.zeros(len(place), np.float32), np.zeros((len(place), 3), np.float32)
    row, column = place // width, place % width
    for (dy, dx), weight in zip(itertools.product(step, step), weights):
        y, x = (row + dy).clip(0, height - 1), (column + dx).clip(0, width - 1)
        at = outside[y, x].nonzero()[0]
        total[at] += weight
        sums[at] += weight * colours[y[at], x[at]]
    seen = total > 0
    return place[seen], sums[seen] / total[seen, None]


def reduced(mask: Tensor, factor: int) -> Tensor:
    """[H // factor, W // factor] bool, the blocks with a pixel of `mask` [H, W] in them; incomplete blocks are
    cropped."""
    height, width = mask.shape[0] // factor, mask.shape[1] // factor
    blocks = mask[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return blocks.any(dim=3).any(dim=1)


def pixel_list(runs: list[tuple[np.ndarray, np.ndarray]], n_pixels: int, device: torch.device) -> PixelList:
    """The pixels in runs (see :func:`runs_of`) of photos with as many pixels: 16 bytes a run in place of 8 a pixel."""
    starts, ends = joined(runs, n_pixels)
    last = np.cumsum(ends - starts)
    of_runs = (torch.from_numpy(x).to(device) for x in (last, ends - last))
    return PixelList(*of_runs, int(last[-1]) if len(last) else 0)


def joined(runs: list[tuple[np.ndarray, np.ndarray]], n_pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """The runs of photos with as many pixels, their pixels counted through all photos."""
    starts, ends = (np.concatenate([run[k] + i * n_pixels for i, run in enumerate(runs)]) for k in (0, 1))
    return starts, ends


def runs_of(mask: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """The first pixels of the runs of ones in a mask [H, W] bool, row by row, and the pixels after their last."""
    flat = mask.cpu().numpy().reshape(-1)
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    changes = np.concatenate([[0] if flat[0] else [], changes, [len(flat)] if flat[-1] else []]).astype(np.int64)
    return changes[::2], changes[1::2]


HULL_EDGE = 400  # pixels, about, along the shorter edge of the masks that make the hull


class PixelSource:
    """Draws training rays: most of them near the objects' masks, the rest anywhere.

    Args:
        dataset: The train split; invalid pixels are never drawn.
        foreground_share: Share of the rays, in [0, 1], that are drawn within a few pixels of a mask.
        generator: The random generator of the pixels; images and cameras are kept on its device.
        edge_pixels: The width on each side of the masks' edges in pixels of `edges`; 0: none.

    Attributes:
        codes: [pixels, 4] the numbers of all photos' pixels, one photo after the other.
        edges: The pixels along the masks' edges; none where the photos have no colours outside.
        turns: [views, 3, 3] the rotations of the photos' light, see :class:`splitnerf.data.dataset.Dataset`, or None.
        foreground, known: The valid pixels near a mask, and all valid pixels.
        possible: [n, h, w] bool, where the photos may show the object: within the masks, and at invalid pixels. Those
            of large photos are smaller, a pixel being true where one within it is.
    """

    def __init__(self, dataset: Dataset, foreground_share: float, generator: torch.Generator, edge_pixels: int = 0):
        self.device = generator.device
        self.poses, self.intrinsics = (torch.from_numpy(x).to(self.device) for x in (dataset.poses, dataset.intrinsics))
        codes, self._file = dataset.images.codes, dataset.images.file if self.device.type == "cpu" else None
        codes = codes.view(np.int16) if codes.dtype == np.uint16 else codes  # of which torch has more operations
        self.codes = torch.from_numpy(codes).to(self.device).view(-1, 4)
        self.turns = None if dataset.light_turns is None else torch.from_numpy(dataset.light_turns).to(self.device)
        self.matrices, self.origins = pixel_matrix(self.poses, self.intrinsics), self.poses[:, :3, 3].contiguous()
        self.height, self.width = dataset.height, dataset.width
        self.share, self.generator = foreground_share, generator
        near, known, possible, edges = [], [], [], []
        self._factor = max(1, min(self.height, self.width) // HULL_EDGE)
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
                edges.append(
                    edge_of(dataset.images.codes[i, ..., :3], alpha, known_here, edge_pixels, dataset.behind(i))
                )
            near.append(runs_of(wide))
            possible.append(reduced(seen, self._factor))
            del alpha, mask, wide, seen, known_here
            # else a photo's arrays, large ones, leave gaps between the runs that stay: 13 MB at 12 megapixels
            give_back()
        self.possible = torch.stack(possible).to(self.device)
        n_pixels = self.height * self.width
        self.foreground = pixel_list(near, n_pixels, self.device)
        n_all = n_pixels * len(dataset)
        self.known = pixel_list(known, n_pixels, self.device) if known else PixelList.all(n_all, self.device)
        self.edges = edge_runs(edges, n_pixels, self.device)

    def hull(self, config: Config) -> Tensor:
        """[r, r, r] bool, the cells of the occupancy grid within the masks' visual hull."""
        lenses = self.intrinsics / self._factor
        return visual_hull(config.sampling.grid_resolution, config.constants.box, self.possible, self.poses, lenses)

    def draw(
        self, n: int, random: Tensor | None = None, backgrounds: Tensor | None = None, exposures: Tensor | None = None
    ) -> tuple[Tensor, ...]:
        """Draws n rays, see :func:`splitnerf.ops.rays.draw_rays`: the first seven of :class:`Batch`, the photos as they are.

        Args:
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
        pixels, *beside = self.read(index, view, exposures, backgrounds)
        return rays_o, rays_d, pixels, view, *beside

    def read(
        self, index: Tensor, view: Tensor, exposures: Tensor, backgrounds: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """What the photos show at pixels, as they are; see :func:`splitnerf.ops.rays.read_pixels`."""
        if self._file is not None:
            size = 4 * self.codes.element_size()
            for page in np.unique(index.numpy() * size // mmap.PAGESIZE).tolist():
                ask_for(self._file, page * mmap.PAGESIZE, size)
        return read_pixels(self.codes, index, view, exposures, backgrounds, self.edges)


class Batch(NamedTuple):
    """The rays of one step, and the photos' values at their pixels.

    Attributes:
        rays_o, rays_d: [n, 3] origins (scene units) and unit directions.
        target: [n, 4] sRGB values of the photos as they are, straight alpha; at an exposure of 1 where samples are added as sRGB.
        view: [n] int64, the photos' numbers.
        exposure: [n, 3] the factors of the photos' linear values.
        background: [n, 3] random sRGB colours in [0, 1), behind the photo and the rendering alike; of whole pixels what the
            photo would show without the object.
        whole: [n] bool, the pixels along the masks' edges, whose colours are compared whole.
        jitter: [n] offsets of each ray's samples in [0, 1), as shares of a sample's length.
        phase: [n] in [0, 1), where the choice of each ray's shaded samples begins.
        probes: Other points that the losses evaluate.
    """

    rays_o: Tensor
    rays_d: Tensor
    target: Tensor
    view: Tensor
    exposure: Tensor
    background: Tensor
    whole: Tensor
    jitter: Tensor
    phase: Tensor
    probes: ProbePoints


def draw_batch(source: PixelSource, n_rays: int, config: Config, exposures: Tensor) -> Batch:
    """Rays through ``n_rays`` random pixels, drawn by the source's generator; `exposures` [views, 3] are the photos'. Where samples
    are added as sRGB, colours at another exposure are not known: the photos are brought to an exposure of 1."""
    pixels, jitter, phase, backgrounds, chosen, probes = draw_numbers(
        source.generator, [n_rays, n_rays, n_rays, 3 * n_rays, *probe_counts(config)]
    )
    drawn = source.draw(n_rays, pixels, backgrounds.view(n_rays, 3), exposures)
    batch = Batch(*drawn, jitter, phase, make_probes(config, chosen, probes))
    if config.shading.compositing == "linear":
        return batch
    target, background, exposure = batch.target, batch.background, batch.exposure
    return batch._replace(
        target=torch.cat([at_unit_exposure(target[:, :3], exposure), target[:, 3:]], dim=1),
        background=torch.where(batch.whole[:, None], at_unit_exposure(background, exposure), background),
        exposure=torch.ones_like(exposure),
    )


def draw_numbers(generator: torch.Generator, counts: list[int]) -> list[Tensor]:
    """Vectors of so many numbers in [0, 1), drawn together. Each begins at a multiple of 16 bytes, so that no operator copies it."""
    lengths = [-(-n // 4) * 4 for n in counts]
    parts = torch.rand(sum(lengths), generator=generator, device=generator.device).split(lengths)
    return [part[:n] for part, n in zip(parts, counts)]


def probe_counts(config: Config) -> tuple[int, int]:
    """How many numbers :func:`make_probes` takes as `chosen` and as `random`."""
    n_beside = config.constants.smoothness_points if config.losses.smoothness_weight else 0
    return n_beside, 3 * config.constants.eikonal_points + 4 * n_beside


def make_probes(config: Config, chosen: Tensor, random: Tensor) -> ProbePoints:
    """Points for the eikonal and the smoothness loss beside the rays' samples; as many numbers as :func:`probe_counts`
    says."""
    c = config
    first, u = random.split([3 * c.constants.eikonal_points, 4 * len(chosen)])
    radius, angle = torch.sqrt(-2 * torch.log1p(-u[::2])), 2 * math.pi * u[1::2]  # Box and Muller 1958
    even, odd = (radius * torch.cos(angle)).view(-1, 2), (radius * torch.sin(angle)).view(-1, 2)
    shifts = c.constants.smoothness_radius * torch.cat([even[:, :1], odd[:, :1], even[:, 1:]], dim=1)
    return ProbePoints(c.constants.box * (2 * first.view(-1, 3) - 1), chosen, shifts)
