"""Fields, occupancy, rendering, meshing and losses: closed forms of a sphere and of constant light."""

from __future__ import annotations

import math

import pytest
import torch

from splitnerf.training import losses
from splitnerf.config import preset
from splitnerf.fields import LightMlp, OcclusionHead, SdfField
from splitnerf.fields.light import LightSamples
from splitnerf.fields.occlusion import OcclusionQuery
from splitnerf.ops import CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE, HashGridSpec
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import AveragedGrid, OccupancyGrid, make_grid, visual_hull
from splitnerf.render.rays import image_rays
from splitnerf.render.renderer import find_samples, render_rays, render_view

RADIUS = 0.7


def sphere(points: torch.Tensor) -> torch.Tensor:
    return points.norm(dim=1) - RADIUS


def perturbed_field() -> SdfField:
    torch.manual_seed(0)
    field = SdfField(HashGridSpec(n_levels=5, base_resolution=8, growth=1.5, log2_table_size=10), box=1.5)
    with torch.no_grad():
        field.grid.table.normal_(std=0.05)
        field.hidden_direction.add_(0.1 * torch.randn_like(field.hidden_direction))
    return field


class TestSdf:
    def test_closed_levels_do_not_count(self):
        field = perturbed_field()
        points = torch.rand(50, 3)
        field.grid.n_active = 2
        before = field.sdf(points)
        with torch.no_grad():
            first_closed = field.grid.spec.levels()[2][1]
            field.grid.table[first_closed:] += 1.0
        assert torch.equal(before, field.sdf(points))


LAMP_COSINE = math.cos(math.radians(3.0))


class TwoLevels:
    """1 everywhere, but 2 where rough: its integrals are exact and its error is not noise."""

    def __init__(self):
        self.loss_samples = LightSamples()

    def __call__(self, directions, roughness):
        return 1.0 + (roughness > 0).float().expand(-1, 3)


class Lamp(TwoLevels):
    """A lamp of 3 degrees, and where rough the diffuse light of it up to what the lattice makes of it."""

    def __call__(self, directions, roughness):
        cosine = directions[:, 2:]
        flux = 2.0 * 1e3 * (1.0 - LAMP_COSINE)  # over pi
        return torch.where(roughness > 0, flux * cosine.clamp(min=0), 1e3 * (cosine > LAMP_COSINE)).expand(-1, 3)


class TestLight:
    @pytest.mark.parametrize("activation", ["softplus", "exp"])
    def test_it_is_never_negative_and_starts_at_half(self, activation):
        torch.manual_seed(0)
        light = LightMlp(width=16, n_layers=2, activation=activation)
        panorama = light.panorama(16, 0.5)
        assert panorama.shape == (16, 32, 3) and panorama.min() > 0
        assert panorama.mean() == pytest.approx(0.5, abs=0.1)

    def test_the_loss_vanishes_for_constant_light(self):
        """g = L for every roughness is consistent: the integral of a constant is that constant."""
        light = LightMlp(width=16, n_layers=2)
        with torch.no_grad():
            light.out.weight.zero_()
        config = preset("cpu").replace({"light_samples": 512, "light_queries": 64})
        assert losses.light_loss(light, config, torch.Generator().manual_seed(0), 0).item() < 1e-10

    def test_the_loss_sees_light_that_forgets_the_roughness(self):
        """A light that is the same bright spot for all roughness is inconsistent, and the gradient reaches it."""
        torch.manual_seed(0)
        light = LightMlp(width=16, n_layers=2)
        with torch.no_grad():
            light.out.weight.normal_(std=1.0)
        config = preset("cpu").replace({"light_samples": 512, "light_queries": 64})
        loss = losses.light_loss(light, config, torch.Generator().manual_seed(0), 0)
        loss.backward()
        assert loss.item() > 1e-2 and light.out.weight.grad.abs().max() > 0

    def test_the_loss_takes_as_many_directions_as_its_error_needs(self):
        """Where integrals are exact the fewest, where noise is all that is left as many as are allowed."""
        generator = torch.Generator().manual_seed(0)
        config = preset("cpu").replace({"light_samples": 1024, "light_queries": 64, "light_noise": 0.1})
        for light, expected in ((TwoLevels(), 64), (Lamp(), 1024)):
            assert light.loss_samples.count(0.1, 1024) == 1024
            for step in range(30):
                losses.light_loss(light, config, generator, step)
            assert light.loss_samples.count(0.1, 1024) == expected

    def test_the_number_of_directions_is_that_of_the_share_of_noise(self):
        """Integrals over 200 directions with a variance of .1 beside an error of 1: 20 / .1 = 200 directions."""
        samples = LightSamples()
        samples.learn(0.1, 1.0, 200)
        assert samples.count(0.1, 2048) == 200
        for _ in range(500):
            samples.learn(0.3, 1.0, 200)
        assert samples.count(0.1, 2048) == pytest.approx(600, abs=1)


class TestOcclusionHead:
    def test_the_papers_head_ignores_the_reflection(self):
        torch.manual_seed(0)
        features, directions, roughness = torch.randn(6, 13), torch.randn(6, 3), torch.rand(6, 1)
        for directional in (False, True):
            head = OcclusionHead(13, 16, 2, 1, directional)
            head.use(None)
            with torch.no_grad():
                head.net[-1].weight.normal_()
            query = OcclusionQuery([features], directions, directions, directions, roughness)
            a, b = head(query).specular, head(query._replace(lobe_dirs=-directions)).specular
            assert torch.equal(a, b) != directional
            assert ((a >= 0) & (a <= 1)).all()


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

    def test_partial_updates_follow_a_moving_surface(self):
        grid = OccupancyGrid(24, 1.5)
        grid.update(sphere, 100.0)
        for i in range(1, 21):
            grid.update(lambda x, i=i: x.norm(dim=1) - RADIUS - 0.01 * i, 100.0, first=False)
        whole = OccupancyGrid(24, 1.5)
        whole.update(lambda x: x.norm(dim=1) - RADIUS - 0.2, 100.0)
        needed = whole.cells == CELL_OCCUPIED
        assert (grid.cells[needed] == CELL_OCCUPIED).all()

    def test_a_thin_wire_survives(self):
        """A wire of a twentieth of a cell: its cells stay, though their centres are outside it."""

        def wire(x):
            return x[:, :2].norm(dim=1) - 0.006

        grid = OccupancyGrid(24, 1.5)
        grid.update(wire, 1000.0)
        z = torch.linspace(-1.4, 1.4, 200)
        cell = ((torch.stack([torch.full_like(z, 0.003), torch.zeros_like(z), z], 1) + 1.5) / (3.0 / 24)).long()
        assert (grid.cells[cell[:, 0], cell[:, 1], cell[:, 2]] == CELL_OCCUPIED).all()


class TestAveragedGrid:
    """The paper's grid: decaying maxima of the opacity."""

    def test_cells_of_the_surface_are_occupied_and_far_ones_dropped(self):
        grid = AveragedGrid(24, 1.5, 0.01)
        for step in range(0, 256, 16):  # a point of each cell at a time
            grid.update(sphere, 200.0, first=step == 0, step=step)
        radius = grid.centres().norm(dim=1).view(24, 24, 24)
        assert (grid.cells[(radius - RADIUS).abs() < 0.02] == CELL_OCCUPIED).all()
        assert (grid.cells[radius > RADIUS + 0.3] != CELL_OCCUPIED).all()

    def test_a_surface_that_left_is_forgotten(self):
        """.95^n of an opaque cell falls below .001 after 135 refreshes, while another is seen."""
        grid = AveragedGrid(12, 1.5, 0.01)
        grid.update(sphere, 200.0)
        old = (grid.cells == CELL_OCCUPIED) & (grid.centres().norm(dim=1).view(12, 12, 12) > 0.6)
        for n in range(140):
            grid.update(lambda x: x.norm(dim=1) - 0.2, 200.0, first=False, step=n)
            if n == 40:
                assert old.any() and (grid.cells[old] == CELL_OCCUPIED).any()
        assert not (grid.cells[old] == CELL_OCCUPIED).any() and (grid.cells == CELL_OCCUPIED).any()

    @pytest.mark.parametrize(("left", "right"), [(0.0, 5.46), (9.4, 10.1), (5.46, 9.4)])
    def test_a_cell_stays_while_its_opacity_exceeds_the_mean_or_a_thousandth(self, left, right):
        """Opacities of a sample across the surface's distance f: 1 - Phi(f - h) / Phi(f + h), of one half of the cells and the
        other; .63 and .01 both stay, of two below a thousandth the one above the mean."""
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
        assert now.sum() == len(cell) and now[occupied].float().mean() > 0.8 and 0.15 < now[~occupied].float().mean() < 0.3
        place = inside - cell
        assert place.min() >= 0 and place.mean().item() == pytest.approx(0.5, abs=0.02) and place.std().item() == pytest.approx(12**-0.5, abs=0.02)
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


def orbit(n: int, distance: float = 4.0) -> torch.Tensor:
    """Cameras around the z axis that look at the origin."""
    poses = []
    for k in range(n):
        angle = 2 * math.pi * k / n
        back = torch.tensor([math.cos(angle), math.sin(angle), 0.0])
        right = torch.tensor([-math.sin(angle), math.cos(angle), 0.0])
        pose = torch.eye(4)
        pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, torch.tensor([0.0, 0.0, 1.0]), back, distance * back
        poses.append(pose)
    return torch.stack(poses)


class TestHull:
    def test_one_mask_of_many_that_is_cut_short_does_not_cut_the_hull(self):
        size, focal, distance = 80, 50.0, 4.0
        y, x = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="ij")
        disc = ((x - 40) ** 2 + (y - 40) ** 2) < (focal * RADIUS / math.sqrt(distance**2 - RADIUS**2)) ** 2
        lenses = torch.tensor([[focal, focal, 40.0, 40.0]] * 40)
        inside = (OccupancyGrid(32, 1.5).centres().norm(dim=1) < RADIUS).view(32, 32, 32)
        for n_cut, whole in ((1, True), (4, False)):
            masks = disc.float().expand(40, -1, -1).clone()
            masks[:n_cut] *= y < 40
            assert bool(visual_hull(32, 1.5, masks, orbit(40), lenses)[inside].all()) == whole

    def test_each_view_carves_by_its_own_mask_place_and_lens(self):
        """Faint masks: the sphere from +x, and its upper half from +y by a lens of its own."""
        size, distance = 160, 4.0
        lenses = torch.tensor([[100.0, 100.0, 80.0, 80.0], [70.0, 90.0, 50.0, 100.0]])
        y, x = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="ij")
        masks = torch.stack(
            [((x - cx) / fx) ** 2 + ((y - cy) / fy) ** 2 < RADIUS**2 / (distance**2 - RADIUS**2) for fx, fy, cx, cy in lenses]
        )
        masks[1] &= y < lenses[1, 3]
        hull = visual_hull(32, 1.5, 0.2 * masks.float(), orbit(4)[:2], lenses).reshape(-1)
        centres = OccupancyGrid(32, 1.5).centres()
        assert hull[(centres.norm(dim=1) < RADIUS) & (centres[:, 2] > 0)].all()
        for beside in (centres[:, 1:].norm(dim=1) - 0.4, centres[:, ::2].norm(dim=1) - 0.4, RADIUS - centres[:, 2] - 0.3):
            assert not hull[beside > RADIUS].any()


@pytest.fixture
def sphere_model() -> tuple[SceneModel, OccupancyGrid]:
    """The untouched model with an exact sphere, sharp, under constant white light."""
    torch.manual_seed(0)
    model = SceneModel(
        preset("cpu").replace({"n_levels": 4, "start_levels": 4, "log2_table_size": 10, "constants.surface_width": 512})
    )
    field = model.sdf_field
    with torch.no_grad():
        model.variance.fill_(0.55)
        model.light.texels.zero_()  # exp(0) = 1
        # |x| as the mean of |w.x| over many directions: exact up to the spread of the random rows.
        lattice = torch.nn.functional.normalize(torch.randn(512, 3), dim=1)
        field.hidden_direction.zero_()
        field.hidden_direction[:, :3] = torch.cat([lattice[:256], -lattice[:256]])
        field.hidden_length.fill_(1.0)
        field.out_direction[0].fill_(1.0)
        field.out_length[0] = 4.0 / math.sqrt(512)
        field.out_bias[0] = -RADIUS
    grid = OccupancyGrid(64, 1.5)
    grid.update(field.sdf, model.s_value)
    return model, grid


class TestRendering:
    def test_a_sphere_covers_its_disc(self, sphere_model):
        model, grid = sphere_model
        maps = render_view(model, grid.cells, orbit(1)[0], torch.tensor([100.0, 100.0, 32.0, 32.0]), 64, 64)
        covered = (maps["alpha"] > 0.5).float().sum().item()
        radius = 100.0 * RADIUS / math.sqrt(16.0 - RADIUS**2)
        assert covered == pytest.approx(math.pi * radius**2, rel=0.06)
        assert maps["alpha"][0, 0] == 0.0 and maps["alpha"][32, 32] > 0.99

    def test_normals_face_the_camera_and_the_light_is_the_albedo(self, sphere_model):
        model, grid = sphere_model
        maps = render_view(model, grid.cells, orbit(1)[0], torch.tensor([100.0, 100.0, 32.0, 32.0]), 64, 64)
        centre = maps["normal"][31:33, 31:33].mean((0, 1))
        assert centre[0] > 0.98
        # Under constant light L = 1 a dielectric of albedo a returns (1 - E) a + E with E small, m ~ .12.
        rgb, albedo = maps["rgb"][32, 32], maps["albedo"][32, 32]
        linear = torch.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
        assert (linear > 0.8 * albedo).all() and (linear < albedo + 0.15).all()

    def test_the_lobe_of_a_head_on_ray_points_back_at_the_camera(self, sphere_model):
        model, grid = sphere_model
        rays_o, rays_d = torch.tensor([[4.0, 0.0, 0.0]]), torch.tensor([[-1.0, 0.0, 0.0]])
        rays = rays_o, rays_d, torch.tensor([0.5])
        ray = render_rays(model, model.evaluate_light(), find_samples(model, grid.cells, *rays))
        heaviest = ray.weights[ray.shaded].argmax()
        assert ray.points.lobe_dirs[heaviest, 0] > 0.95

    def test_skipping_faint_samples_changes_little(self, sphere_model):
        model, grid = sphere_model
        rays_o, rays_d = image_rays(orbit(1)[0], torch.tensor([50.0, 50.0, 16.0, 16.0]), 32, 32)
        rays = rays_o, rays_d, torch.full((len(rays_o),), 0.5)
        colours = []
        for threshold, shades in ((0.0, 0), (1e-3, 0), (1e-3, 4)):
            model.config = model.config.replace({"sampling.min_weight": threshold})
            ray = render_rays(
                model, model.evaluate_light(), find_samples(model, grid.cells, *rays), shades_per_ray=shades
            )
            colours.append((ray.colour * ray.opacity[:, None]).detach())
        assert (colours[0] - colours[1]).abs().max() < 0.02
        assert (colours[1] - colours[2]).abs().max() < 0.02
