"""The occupancy grid: a ray samples occupied cells, skips empty ones and ends in opaque ones."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

from splitnerf.config import Config
from splitnerf.devices import start_fetching
from splitnerf.ops.rays import CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE

DENSITY_CUTOFF = 7.0  # where |f| > cutoff / s, the NeuS density is below e^-7 of its peak
LIPSCHITZ = 1.25  # bound on |grad f|; the eikonal loss keeps it in practice
REFRESHED_SHARE = 0.1, 0.02  # share of the cells far from the surface that an update evaluates, and from SETTLED on
SETTLED = 1000  # steps, after which the surface moves little
NEAR_MARGIN = 1.1  # growth of the bound from one update to the next on a GPU, as the sharpness falls
DECAY, MIN_CELL_OPACITY, ALL_CELLS_UNTIL = 0.95, 1e-3, 256


class OccupancyGrid:
    """Cells of the box, classed by the signed distance at their centres.

    With |grad f| <= L, a cell of half diagonal h contains no point with |f| < cutoff/s if |f(centre)| > L h +
    cutoff/s. Outside the surface such a cell is empty, inside it is opaque (transmittance below e^-cutoff).

    Args:
        resolution: Cells along an edge, r.
        box: Half size of the cube, scene units.
        device: The device of the cells and of the points at which the field is evaluated.

    Attributes:
        values: [r^3] float32 signed distance at each cell's centre (a subclass may keep other values); stored in
            checkpoints.
        cells: [r, r, r] uint8 over [x, y, z]: CELL_EMPTY, CELL_OCCUPIED or CELL_OPAQUE.
    """

    def __init__(self, resolution: int, box: float, device: torch.device | str = "cpu"):
        self.resolution, self.box, self.device = resolution, box, device
        self.half_diagonal = math.sqrt(3.0) * box / resolution
        self.values = torch.zeros(resolution**3, device=device)
        self.cells = torch.full((resolution,) * 3, CELL_OCCUPIED, dtype=torch.uint8, device=device)
        # the capacity for cells near the surface, being fetched from a GPU
        self._n_near: tuple[Tensor, Callable[[], None]] | None = None

    def centres(self) -> Tensor:
        """[r^3, 3] cell centres, scene units."""
        axis = (torch.arange(self.resolution, device=self.device) + 0.5) * (2 * self.box / self.resolution) - self.box
        return torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), dim=-1).reshape(-1, 3)

    @torch.no_grad()
    def update(self, sdf: Callable[[Tensor], Tensor], s: float, *, first: bool = True, step: int = 0) -> None:
        """Evaluates the field again and classes all cells.

        Args:
            sdf: A function from points [n, 3] to signed distances [n], scene units.
            s: Sharpness of the NeuS density, positive.
            first: Whether to evaluate all cells; otherwise the cells near the surface and a random share of all cells.
        """
        bound = LIPSCHITZ * self.half_diagonal + DENSITY_CUTOFF / s
        if first:
            due = torch.arange(len(self.values), device=self.device)
        else:
            due = self._due(self.values.abs() < 2.0 * bound, REFRESHED_SHARE[step >= SETTLED])
        self.values[due] = evaluate(sdf, self.centres()[due])
        if self.values.device.type == "cuda":
            self._n_near = start_fetching((self.values.abs() < 2.0 * NEAR_MARGIN * bound).sum())
        cells = torch.full_like(self.values, CELL_OCCUPIED, dtype=torch.uint8)
        cells[self.values > bound] = CELL_EMPTY
        cells[self.values < -bound] = CELL_OPAQUE
        self.cells = cells.view((self.resolution,) * 3)

    def _due(self, near: Tensor, share: float) -> Tensor:
        """The cells of a mask, and a random share of all. On a GPU the host waits for no count: the last update has
        counted with a wider bound, and the first cell is the padding."""
        if self._n_near is None:
            return (near | (torch.rand_like(self.values) < share)).nonzero().squeeze(1)
        count, wait = self._n_near
        wait()
        anywhere = torch.randint(len(near), (int(share * len(near)),), device=near.device)
        return torch.cat([torch.nonzero_static(near, size=int(count))[:, 0].clamp(min=0), anywhere])


class AveragedGrid(OccupancyGrid):
    """The released code's grid: a cell is occupied while the decaying maximum of its opacity, that of one sample whose ray meets
    the surface head-on, exceeds min(mean, 0.001). It gives no guarantee: a cell may become empty when its random point misses a
    thin part. Source: Instant NGP (Mueller et al. 2022), as nerfacc, which SplitNeRF's released code uses, describes it."""

    def __init__(self, resolution: int, box: float, step: float, device: torch.device | str = "cpu"):
        super().__init__(resolution, box, device)
        self.step = step

    @torch.no_grad()
    def update(self, sdf: Callable[[Tensor], Tensor], s: float, *, first: bool = True, step: int = 0) -> None:
        """Evaluates all cells in the first 256 steps; later a random quarter of all, and as many of the occupied
        ones."""
        n = len(self.values)
        due = torch.arange(n, device=self.device)
        if not first and step >= ALL_CELLS_UNTIL:
            occupied = (self.cells.reshape(-1) == CELL_OCCUPIED).nonzero().squeeze(1)
            due = torch.randint(n, (n // 4,), device=self.device)
            if len(occupied):
                due = torch.cat([due, occupied[torch.randint(len(occupied), (n // 4,), device=self.device)]]).unique()
        cell = 2 * self.box / self.resolution
        points = self.centres()[due] + (torch.rand(len(due), 3, device=self.device) - 0.5) * cell
        f, half = evaluate(sdf, points), 0.5 * self.step
        opacity = -torch.expm1(logsigmoid(s * (f - half)) - logsigmoid(s * (f + half)))
        self.values[due] = torch.maximum(DECAY * self.values[due], opacity)
        threshold = min(float(self.values.mean()), MIN_CELL_OPACITY)
        cells = torch.where(self.values > threshold, CELL_OCCUPIED, CELL_EMPTY).to(torch.uint8)
        self.cells = cells.view((self.resolution,) * 3)


def make_grid(config: Config, device: torch.device | str = "cpu") -> OccupancyGrid:
    """The grid that the setting ``occupancy`` names."""
    resolution, c = config.sampling.grid_resolution, config.constants
    if config.sampling.occupancy == "average":
        return AveragedGrid(resolution, c.box, c.min_step, device)
    return OccupancyGrid(resolution, c.box, device)


def evaluate(sdf: Callable[[Tensor], Tensor], points: Tensor) -> Tensor:
    """The field's values [n] at points [n, 3], evaluated in chunks."""
    chunk = 1 << (16 if points.device.type == "cpu" else 20)
    return torch.cat([sdf(part) for part in points.split(chunk)]) if len(points) else points[:, 0]
