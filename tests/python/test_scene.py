"""Which cells of the grid are occupied, and the hull of the masks: closed forms of a sphere."""

import math

import pytest
import torch
from splitnerf.config import preset
from splitnerf.ops.rays import CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE
from splitnerf.render.occupancy import AveragedGrid, OccupancyGrid, make_grid, visual_hull
from splitnerf_tools.synth.orbits import orbit

RADIUS = 0.7


def sphere(points: torch.Tensor) -> torch.Tensor:
    return points.norm(dim=1) - RADIUS


class TestOccupancy:
    @pytest.mark.parametrize("s", [20.0, 200.0, 2000.0])
    def test_no_cell_near_the_surface_is_skipped(self, s):
        grid = OccupancyGrid(24, 1.5)
        grid.update(sphere, s)
        points = torch.nn.functional.normalize(torch.randn(4000, 3), dim=1) * (RADIUS + torch.randn(4000, 1) * 2.0 / s)
        cell = ((points + 1.5) / (3.0 / 24)).long().clamp(0, 23)
        assert (grid.cells[cell[:, 0], cell[:, 1], cell[:, 2]] == CELL_OCCUPIED).all()

    def test_inside_is_opaque_and_outside_empty(self):
        grid = OccupancyGrid(24, 1.5)
        grid.update(sphere, 1000.0)
        assert grid.cells[12, 12, 12] == CELL_OPAQUE and grid.cells[0, 0, 0] == CELL_EMPTY


class TestAveragedGrid:
    """The paper's grid: decaying maxima of the opacity."""

    @pytest.mark.parametrize(("left", "right"), [(0.0, 5.46), (9.4, 10.1), (5.46, 9.4)])
    def test_a_cell_stays_while_its_opacity_exceeds_the_mean_or_a_thousandth(self, left, right):
        """Opacities of a sample across the surface's distance f: 1 - Phi(f - h) / Phi(f + h), of one half of the cells and the
        other; 0.63 and 0.01 both stay, of two below a thousandth the one above the mean."""
        s, step = 200.0, 0.01
        f = torch.tensor([left, right], dtype=torch.float64) / s
        opacity = 1 - torch.sigmoid(s * (f - step / 2)) / torch.sigmoid(s * (f + step / 2))
        grid = AveragedGrid(8, 1.5, step)
        grid.update(lambda x: torch.where(x[:, 0] < 0, *f.float()), s)
        values = grid.values.view(2, -1)
        torch.testing.assert_close(values, opacity.float()[:, None].expand_as(values), rtol=1e-3, atol=0)
        stays = opacity > min(opacity.mean(), 1e-3)
        cells = grid.cells.view(2, -1) == CELL_OCCUPIED
        assert torch.equal(cells, stays[:, None].expand_as(cells))

    def test_later_what_is_asked_decays_and_most_of_what_is_occupied_is_asked(self):
        """At a point anywhere in its cell; the other cells keep what they have."""
        asked = []

        def nothing(x):
            asked.append(x)
            return torch.full_like(x[:, 0], 9.0)

        torch.manual_seed(0)
        grid = AveragedGrid(16, 1.5, 0.01)
        grid.update(lambda x: x[:, 0] + 1.2, 200.0)
        before, occupied = grid.values.clone(), (grid.cells == CELL_OCCUPIED).reshape(-1)
        assert 100 < occupied.sum() < 1000
        grid.update(nothing, 200.0, first=False, step=256)
        inside = (asked[0] + 1.5) / (3.0 / 16)
        cell = inside.long()
        now = torch.zeros(4096, dtype=torch.bool).index_fill(0, (cell[:, 0] * 16 + cell[:, 1]) * 16 + cell[:, 2], True)
        assert now.sum() == len(cell) and now[occupied].float().mean() > 0.8
        assert 0.15 < now[~occupied].float().mean() < 0.3
        place = inside - cell
        assert place.min() >= 0 and place.mean().item() == pytest.approx(0.5, abs=0.02)
        assert place.std().item() == pytest.approx(12**-0.5, abs=0.02)
        torch.testing.assert_close(grid.values, torch.where(now, 0.95 * before, before))
        grid.update(nothing, 200.0, first=True, step=300)
        grid.update(nothing, 200.0, first=False, step=255)
        assert len(asked[1]) == len(asked[2]) == 4096

    def test_the_setting_chooses(self):
        assert type(make_grid(preset("paper"))) is AveragedGrid and type(make_grid(preset("cpu"))) is OccupancyGrid
        config = preset("paper").replace({"min_step": 0.013, "grid_resolution": 12})
        assert make_grid(config).step == 0.013
        for grid in (make_grid(config), make_grid(config.replace({"occupancy": "distance"}))):  # before the first look
            assert grid.cells.shape == (12, 12, 12) and (grid.cells == CELL_OCCUPIED).all()


class TestHull:
    def test_one_mask_of_many_that_is_cut_short_does_not_cut_the_hull(self):
        size, focal, distance = 80, 50.0, 4.0
        y, x = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="ij")
        disc = ((x - 40) ** 2 + (y - 40) ** 2) < (focal * RADIUS / math.sqrt(distance**2 - RADIUS**2)) ** 2
        lenses = torch.tensor([[focal, focal, 40.0, 40.0]] * 40)
        poses = torch.from_numpy(orbit(40, distance, elevation=0.0)).float()
        inside = (OccupancyGrid(32, 1.5).centres().norm(dim=1) < RADIUS).view(32, 32, 32)
        for n_cut, whole in ((1, True), (4, False)):
            masks = disc.float().expand(40, -1, -1).clone()
            masks[:n_cut] *= y < 40
            assert bool(visual_hull(32, 1.5, masks, poses, lenses)[inside].all()) == whole
