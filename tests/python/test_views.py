"""What views are made of: lengths of samples, maps channel by channel, the hull of masks, and what a model asks its occlusion."""

import math
from types import SimpleNamespace

import pytest
import torch
from op_checks import generator, unit
from splitnerf.config import preset
from splitnerf.fields import Occlusion
from splitnerf.ops import HashGridSpec, light_queries
from splitnerf.ops.rays import CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import AveragedGrid, OccupancyGrid, make_grid
from splitnerf.render.renderer import ProbePoints, find_samples, render_rays, render_view, sample_step
from splitnerf.render.stereo import visual_hull
from splitnerf_tools.synth.rendering import orbit
from tiny_runs import tiny

RADIUS, SIZE, OF_SPHERE = 0.6, 24, 0.7
POSE = torch.tensor([[0.0, 0, 1, 4], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from +x towards the origin, z up
LENS = torch.tensor([40.0, 40.0, 12.0, 12.0])


class Given(torch.nn.Module):
    """Answers each point alike, and remembers what it was asked."""

    def __init__(self, answer):
        super().__init__()
        self.answer, self.asked = answer, ()

    def forward(self, *inputs):
        self.asked = inputs
        return self.answer(*inputs)


def ball(**settings: object) -> tuple[SceneModel, torch.Tensor]:
    """A model whose field is a ball, nearly, under constant light of 1, and its cells."""
    torch.manual_seed(0)
    round_ = {"start_levels": 4, "constants.surface_width": 512, "sphere_radius": RADIUS, "shading.method": "split"}
    model = SceneModel(tiny(**round_, **settings))
    with torch.no_grad():
        model.variance.fill_(0.5)
        model.light.texels.zero_()
    grid = make_grid(model.config)
    grid.update(model.sdf_field.sdf, model.s_value)
    return model, grid.cells


@pytest.mark.parametrize(("s", "length"), [(1.0, 0.05), (50.0, 0.04), (80.0, 0.025), (400.0, 0.01)])
def test_samples_are_as_long_as_the_density_is_wide_within_bounds(s, length):
    config = tiny(step_scale=2.0, min_step=0.01, max_step=0.05)
    assert sample_step(config, s) == pytest.approx(length)


def test_each_map_of_a_view_shows_what_it_is_called():
    model, cells = ball(occlusion_channels=3)
    colour = torch.tensor([0.2, 0.4, 0.7])
    model.material = Given(
        lambda x, *_: (colour.expand(len(x), 3), torch.full((len(x), 1), 0.3), torch.full((len(x), 1), 0.6))
    )
    share = torch.tensor([0.7, 0.8, 0.9])
    model.occlusion_at = lambda _, x, *__: Occlusion(share.expand(len(x), 3), 0.5 * share.expand(len(x), 3))
    maps = render_view(model, cells, POSE, LENS, SIZE, SIZE)
    inside = maps["alpha"] > 0.01
    assert 0.1 < inside.float().mean() < 0.9
    for name, value in (("roughness", 0.3), ("metallic", 0.6), ("occlusion_d", 0.8), ("occlusion_s", 0.4)):
        torch.testing.assert_close(maps[name][inside], torch.full_like(maps[name][inside], value), rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(maps["albedo"][inside], colour.expand(int(inside.sum()), 3), rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(maps["normal"][inside].norm(dim=1), torch.ones(int(inside.sum())))
    # x to the viewer, y to the right, z up
    row, column = 12, 12
    assert maps["normal"][row, column, 0] > 0.9 and maps["normal"][row, column + 4, 1] > 0.2
    assert maps["normal"][row - 4, column, 2] > 0.2
    assert (maps["rgb"] >= 0).all() and (maps["rgb"] <= 1).all()


def test_colours_of_a_view_do_not_fade_with_its_coverage_and_end_at_white():
    """A white ball under constant light sends out that light, at its edge as well: straight alpha."""
    for light in (0.5, 4.0):
        model, cells = ball()
        model.material = Given(lambda x, *_: (torch.ones(len(x), 3), torch.ones(len(x), 1), torch.zeros(len(x), 1)))
        with torch.no_grad():
            model.light.texels[:16] = math.log(light)
        maps = render_view(model, cells, POSE, LENS, SIZE, SIZE)
        edge = (maps["alpha"] > 0.02) & (maps["alpha"] < 0.9)
        expected = min(1.0, 1.055 * light ** (1 / 2.4) - 0.055)
        assert edge.any() and maps["rgb"].max() <= 1.0
        torch.testing.assert_close(maps["rgb"][edge], torch.full((int(edge.sum()), 3), expected), rtol=0, atol=0.01)


def test_maps_are_means_by_what_their_samples_weigh():
    """Roughness that rises along the ray: the mean over the samples by their shares of the colour."""
    model, cells = ball(shades_per_ray=0)
    model.head_inputs = lambda positions, outputs, features: [positions]
    model.material = Given(
        lambda x, *_: (torch.full((len(x), 3), 0.5), torch.sigmoid(20 * (x[:, :1] - RADIUS)), torch.zeros(len(x), 1))
    )
    maps = render_view(model, cells, POSE, LENS, SIZE, SIZE)
    rays = torch.tensor([[4.0, 0, 0]]), unit(torch.tensor([[-40.0, 0.5, -0.5]])), torch.tensor([0.5])
    ray = render_rays(model, model.evaluate_light(), find_samples(model, cells, *rays))
    expected = (ray.shares @ ray.points.roughness[:, 0] / ray.shares.sum()).item()
    assert len(ray.shares) > 5 and ray.points.roughness.std() > 0.02 and not ray.shares.requires_grad
    assert abs(ray.points.roughness.mean().item() - expected) > 0.01
    assert maps["roughness"][12, 12].item() == pytest.approx(expected, abs=1e-3)


def test_in_srgb_no_sample_is_brighter_than_white():
    """Of what is composited each sample is clipped by itself, as in the released code."""
    model, cells = ball(compositing="srgb")
    model.material = Given(lambda x, *_: (torch.ones(len(x), 3), torch.ones(len(x), 1), torch.zeros(len(x), 1)))
    with torch.no_grad():
        model.light.texels[:16] = math.log(5.0)
    rays = torch.tensor([[4.0, 0, 0]]), torch.tensor([[-1.0, 0, 0]]), torch.tensor([0.5])
    ray = render_rays(model, model.evaluate_light(), find_samples(model, cells, *rays))
    assert not ray.linear
    torch.testing.assert_close(ray.mean, torch.ones(1, 3), rtol=0, atol=1e-3)
    torch.testing.assert_close(ray.colour, ray.mean)


@pytest.mark.parametrize("min_weight", [0.0, 1e-3])
def test_samples_stand_in_their_middles_and_probes_behind_them(min_weight):
    """The k points from anywhere come first, then each chosen sample with its shift."""
    model, cells = ball(**{"sampling.min_weight": min_weight})
    rays = torch.tensor([[4.0, 0, 0], [4.0, 0.1, 0]]), torch.tensor([[-1.0, 0, 0]] * 2), torch.tensor([0.2, 0.9])
    anywhere, shifts = torch.rand(3, 3), 0.1 * torch.randn(2, 3)
    found = find_samples(model, cells, *rays, probes=ProbePoints(anywhere, torch.tensor([0.0, 0.99]), shifts))
    n = len(found.directions)
    distance = 4.0 - found.positions[:n, 0]
    torch.testing.assert_close(distance, found.packed.middles)
    torch.testing.assert_close(found.positions[n : n + 3], anywhere)
    assert found.beside.tolist() == [0, int(0.99 * n)]
    torch.testing.assert_close(found.positions[n + 3 :], found.positions[found.beside] + shifts)
    counts = found.packed.offsets.diff()
    assert (found.evaluated >= counts).all() and (min_weight > 0 or torch.equal(found.evaluated, counts))


# ---- what the model asks ----


def asked_by_shade(**settings) -> tuple:
    model = SceneModel(tiny(**{"shading.method": "split"}, **settings))
    occlusion = Given(lambda *_: Occlusion(torch.full((40, 1), 0.5), torch.full((40, 1), 0.25)))
    model.occlusion_at = occlusion.forward
    g = generator(1)
    normals, views = (unit(torch.randn(40, 3, generator=g)) for _ in range(2))
    positions, outputs = torch.randn(40, 3, generator=g), torch.randn(40, 13, generator=g)
    features = torch.randn(40, model.sdf_field.grid.spec.n_outputs, generator=g)
    segments = SimpleNamespace(representatives=torch.tensor([0]), segment=torch.zeros(40, dtype=torch.int64))
    light = model.light.evaluate()
    points = model.shade(light, positions, outputs, features, normals, views, segments)
    return points, occlusion.asked, segments, normals, views, positions, outputs, features


def test_occlusion_is_asked_on_the_surface_on_the_viewers_side():
    """At x - n f(x), whichever way the normal looks, about the viewer's side of it and the lobe's axis, once a segment."""
    points, (_, x, n, lobe_dirs, roughness, given), segments, normals, views, positions, outputs, _ = asked_by_shade()
    torch.testing.assert_close(x, positions - normals * outputs[:, :1])
    side = (normals * views).sum(1, keepdim=True).sign()
    assert (side < 0).any() and given is segments
    for facing in (n, points.facing):
        torch.testing.assert_close(facing, side * normals)
    assert torch.equal(lobe_dirs, light_queries(normals, views, roughness)[0][:40]) and torch.equal(
        roughness, points.roughness
    )
    assert (points.occlusion_d == 0.5).all() and (points.occlusion_s == 0.25).all()


def test_heads_read_what_is_set():
    for inputs in ("outputs", "grid"):
        _, (read, *_), *_, positions, outputs, features = asked_by_shade(**{"materials.inputs": inputs})
        expected = outputs if inputs == "outputs" else torch.cat([outputs, positions, features], 1)
        assert torch.equal(torch.cat(read, 1), expected)


@pytest.mark.parametrize("name", ["reflection", "mean"])
def test_the_lobe_is_asked_about_where_it_is_set(name):
    """The mirror direction of the view, or the mean direction of the lobe, which leans to the normal."""
    _, (_, _, _, lobe_dirs, *_), _, normals, views, *_ = asked_by_shade(query=name, initial_roughness=0.95)
    mirror = 2 * (normals * views).sum(1, keepdim=True) * normals - views
    off = (lobe_dirs - mirror).norm(dim=1)
    assert off.max() < 1e-5 if name == "reflection" else off.mean() > 0.05


def test_a_model_begins_as_it_is_set():
    """Roughness, its least value, sharpness, radius."""
    models = []
    for radius, roughness in ((0.4, 0.7), (0.6, 0.3)):
        torch.manual_seed(0)
        config = tiny(sphere_radius=radius, initial_roughness=roughness, min_roughness=0.2, initial_variance=0.45)
        models.append(SceneModel(config))
        inputs = torch.zeros(1, models[-1].material.net[0].in_features)
        found = models[-1].material(inputs)[1]
        assert found.item() == pytest.approx(roughness, abs=1e-5)
        with torch.no_grad():
            models[-1].material.net[-1].bias.fill_(-50.0)
        assert models[-1].material(inputs)[1].item() == pytest.approx(0.2)
        assert models[-1].s_value == pytest.approx(math.exp(4.5), rel=1e-5)
    points = torch.rand(20, 3)
    torch.testing.assert_close(models[0].sdf_field.sdf(points) - models[1].sdf_field.sdf(points), torch.full([20], 0.2))
    torch.manual_seed(0)
    assert SceneModel(tiny(table_dtype="float16")).sdf_field.grid.stored().dtype == torch.float16


def matrices(net: torch.nn.Module) -> list[tuple[int, ...]]:
    """The shapes of a network's matrices."""
    return [tuple(p.shape) for p in net.parameters() if p.dim() == 2]


def test_parts_are_as_large_as_they_are_set():
    field = {"n_levels": 3, "base_resolution": 5, "growth": 1.7, "log2_table_size": 9, "surface_width": 24, "box": 1.3}
    light = {"kind": "mlp", "width": 12, "layers": 4, "activation": "exp"}
    settings = field | {f"light_{key}": value for key, value in light.items()}
    settings |= {"materials_width": 20, "direction_frequencies": 5, "roughness_frequencies": 2}
    settings |= {"shading.method": "split", "occlusion.kind": "mlp", "occlusion_width": 18, "occlusion.channels": 3}
    for inputs, n_inputs in (("outputs", 13), ("grid", 13 + 3 + 6)):
        model = SceneModel(tiny(**settings | {"materials.inputs": inputs}))
        assert model.sdf_field.grid.spec == HashGridSpec(3, 2, 5, 1.7, 9) and model.sdf_field.box == 1.3
        assert model.sdf_field.hidden_direction.shape == (24, 9) and model.sdf_field.out_direction.shape == (13, 24)
        assert matrices(model.material.net) == [(20, n_inputs), (20, 20), (5, 20)]
        assert matrices(model.light.hidden) == [(12, 34)] + [(12, 12)] * 3
        assert len(model.light.roughness_scales) == 2 and model.light.activation == "exp"
        assert matrices(model.occlusion.net) == [(18, n_inputs), (18, 18), (6, 18)]
        assert model.variance.requires_grad
    assert SceneModel(tiny(light_resolution=32)).light.resolution == 32
    nothing = SceneModel(tiny(**{"shading.method": "split", "occlusion.kind": "off"}))
    assert nothing.occlusion is nothing.cells is nothing.aims() is None


# ---- the hull of masks ----


def test_the_hull_is_what_every_mask_that_sees_it_allows():
    """One camera off its axis and a mask in one corner: cells in the mask stay, those two cells beside it go, and what is
    not in the image, or behind the camera, stays."""
    height, width, resolution, box = 60, 80, 20, 1.5
    mask = torch.zeros(1, height, width)
    mask[:, 4:22, 40:70] = 1.0
    pose = torch.eye(4)
    pose[:3, :3] = torch.linalg.qr(torch.randn(3, 3, generator=generator(2)))[0]
    pose[:3, :3] *= pose[:3, :3].det().sign()
    pose[:3, 3] = pose[:3, 2] * 1.2  # within the box: some cells are behind
    fx, fy, cx, cy = 45.0, 60.0, 50.0, 24.0
    hull = visual_hull(resolution, box, mask, pose[None], torch.tensor([[fx, fy, cx, cy]])).reshape(-1)
    centres = OccupancyGrid(resolution, box).centres()
    right, up, back = ((centres - pose[:3, 3]) @ pose[:3, i] for i in range(3))
    x, y = cx - fx * right / back, cy + fy * up / back
    seen = (back < 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    assert seen.any() and (~seen).any() and (back > 0).any() and hull[~seen].all()
    inside = seen & (x > 41) & (x < 69) & (y > 5) & (y < 21)
    beside = torch.stack([40 - x, x - 70, 4 - y, y - 22]).amax(0)
    pixels = 2 * 1.5 / resolution * fx / (-back[seen]).median()  # a cell's, about
    assert inside.sum() > 20 and hull[inside].all()
    assert (seen & (beside > 2 * pixels)).sum() > 20 and not hull[seen & (beside > 2 * pixels)].any()
    near = seen & (beside > 0) & (beside < 0.8 * pixels)
    assert near.any() and hull[near].all()


def test_cells_far_from_the_surface_are_asked_now_and_then_and_near_ones_always():
    asked = []

    def field(x):
        asked.append(x)
        return x[:, 2]

    grid = OccupancyGrid(24, 1.5)
    grid.update(field, 200.0)
    bound = 2 * (1.25 * math.sqrt(3) * 1.5 / 24 + 7 / 200)
    n_near = (grid.centres()[:, 2].abs() < bound).sum().item()
    for step, share in ((0, 0.1), (1000, 0.02)):
        grid.update(field, 200.0, first=False, step=step)
        z, expected = asked[-1][:, 2].abs(), share * (24**3 - n_near)
        assert (z < bound).sum() == n_near and len(z) - n_near == pytest.approx(expected, abs=5 * expected**0.5)
    rows = grid.centres().view(24, 24, 24, 3)
    assert torch.equal(rows[5, 6, 7], torch.tensor([5.5, 6.5, 7.5]) * 0.125 - 1.5)


# ---- which cells of the grid are occupied: closed forms of a sphere ----


def sphere(points: torch.Tensor) -> torch.Tensor:
    return points.norm(dim=1) - OF_SPHERE


class TestOccupancy:
    @pytest.mark.parametrize("s", [20.0, 200.0, 2000.0])
    def test_inside_is_opaque_and_outside_empty(self, s):
        grid = OccupancyGrid(24, 1.5)
        grid.update(sphere, s)
        f, bound = sphere(grid.centres()), 1.25 * math.sqrt(3) * 1.5 / 24 + 7 / s
        expected = torch.where(f > bound, CELL_EMPTY, torch.where(f < -bound, CELL_OPAQUE, CELL_OCCUPIED))
        assert torch.equal(grid.cells.view(-1), expected.to(torch.uint8)) and grid.cells[12, 12, 12] == CELL_OPAQUE


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


def test_one_mask_of_many_that_is_cut_short_does_not_cut_the_hull():
    size, focal, distance = 80, 50.0, 4.0
    y, x = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="ij")
    disc = ((x - 40) ** 2 + (y - 40) ** 2) < (focal * OF_SPHERE / math.sqrt(distance**2 - OF_SPHERE**2)) ** 2
    lenses = torch.tensor([[focal, focal, 40.0, 40.0]] * 40)
    poses = torch.from_numpy(orbit(40, distance, elevation=0.0)).float()
    inside = (OccupancyGrid(32, 1.5).centres().norm(dim=1) < OF_SPHERE).view(32, 32, 32)
    for n_cut, whole in ((1, True), (2, False)):
        masks = disc.float().expand(40, -1, -1).clone()
        masks[:n_cut] *= y < 40
        assert bool(visual_hull(32, 1.5, masks, poses, lenses)[inside].all()) == whole
