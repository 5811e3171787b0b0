"""The Monte Carlo shading of the last part of a training, against the split sum where both are exact."""

from __future__ import annotations

import pytest
import torch
import trimesh
from op_checks import generator, unit

from splitnerf import losses
from splitnerf.config import Config
from splitnerf.errors import InputError
from splitnerf.fields.light import lobe_roughness
from splitnerf.ops import MeshScene, split_sum_shade
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.renderer import find_samples, render_rays
from splitnerf.render.monte_carlo import monte_carlo_radiance

RADIUS = 0.5


class ConstantLight(torch.nn.Module):
    """Radiance 1, 2, 3 from everywhere."""

    def forward(self, directions, roughness):
        return torch.tensor([1.0, 2.0, 3.0]).expand(len(directions), 3)


@pytest.fixture(scope="module")
def model() -> SceneModel:
    config = Config().replace({"finetune_samples": 2048, "n_levels": 2, "log2_table_size": 8})
    scene = SceneModel(config)
    scene.light = ConstantLight()
    return scene


def points(n: int = 64) -> dict[str, torch.Tensor]:
    g = generator(3)
    normals = unit(torch.randn(n, 3, generator=g))
    view_dirs = unit(normals + 0.8 * unit(torch.randn(n, 3, generator=g)))
    return {
        "positions": RADIUS * normals, "normals": normals, "view_dirs": view_dirs, "albedo": torch.rand(n, 3, generator=g),
        "roughness": 0.1 + 0.9 * torch.rand(n, 1, generator=g), "metallic": torch.rand(n, 1, generator=g),
    }  # fmt: skip


def sphere(radius: float) -> MeshScene:
    mesh = trimesh.creation.icosphere(4, radius)
    return MeshScene(mesh.vertices, mesh.faces)


def test_under_constant_light_it_is_the_split_sum(model):
    """Nothing blocks a lone sphere, and a constant light makes the split exact."""
    p = points()
    got = monte_carlo_radiance(model, sphere(RADIUS), **p, seed=1)
    light, one = torch.tensor([1.0, 2.0, 3.0]).expand(64, 3), torch.ones(64, 3)
    expected = split_sum_shade(
        p["normals"], p["view_dirs"], p["albedo"], p["roughness"], p["metallic"], light, light, one, one, "exact", True
    )
    torch.testing.assert_close(got, expected, rtol=0.03, atol=0.01)
    assert (got / expected).mean().item() == pytest.approx(1.0, abs=0.003)


def test_nothing_reaches_a_point_inside_a_shell(model):
    got = monte_carlo_radiance(model, sphere(3 * RADIUS), **points(), seed=1)
    assert torch.equal(got, torch.zeros_like(got))


def test_materials_and_light_get_gradients(model):
    p = points(8)
    for key in ("albedo", "roughness", "metallic"):
        p[key].requires_grad_()
    monte_carlo_radiance(model, sphere(RADIUS), **p, seed=1).sum().backward()
    for key in ("albedo", "roughness", "metallic"):
        assert torch.isfinite(p[key].grad).all() and (p[key].grad != 0).any(), key


def test_the_filter_covers_the_solid_angle():
    """A lobe of ggx_alpha a has a peak density of 1 / (4 pi a^2): its solid angle is 4 pi a^2, a = roughness^2."""
    roughness = torch.tensor([0.1, 0.5, 1.0])
    torch.testing.assert_close(lobe_roughness(4 * torch.pi * roughness**4), roughness)
    assert lobe_roughness(torch.tensor(100.0)).item() == 1.0


def test_the_loss_of_two_estimates_has_no_noise_in_it():
    """Its mean is the squared error of the mean, whatever the variance of each estimate."""
    n, g = 200_000, generator()
    target = torch.tensor([0.5, 0.5, 0.5, 1.0]).expand(n, 4)
    noisy = [0.6 + 0.2 * torch.randn(n, 3, generator=g) for _ in range(2)]
    ray = type("Ray", (), {"opacity": torch.ones(n)})
    loss = losses.monte_carlo_colour_loss((noisy[0], noisy[1]), ray, target, torch.ones(n, 3))
    assert loss.item() == pytest.approx(0.1**2, abs=5e-4)


def test_settings_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="finetune_from below 1 needs compositing"):
        Config().replace({"finetune_from": 0.8, "compositing": "srgb", "shading": "split"})
    for setting in (
        {"occlusion": "mlp"},
        {"compositing": "srgb"},
        {"fresnel_mode": "paper"},
        {"occlusion_directions": 128},
    ):
        with pytest.raises(InputError, match="shading = summed needs"):
            Config().replace(setting)
    with pytest.raises(InputError, match="finetune_samples"):
        Config().replace({"finetune_samples": 0})


def test_with_fixed_materials_the_colours_move_the_surface_alone():
    scene = SceneModel(Config().replace({"n_levels": 2, "log2_table_size": 8}))
    p = points(16)
    field = scene.surface(p["positions"])
    normals = field.gradient / field.gradient.norm(dim=1, keepdim=True)
    shaded = scene.shade(p["positions"], field.outputs, field.features, normals, p["view_dirs"], fixed_materials=True)
    parameters = list(scene.material.parameters())
    found = torch.autograd.grad(
        shaded.radiance.sum(), [*parameters, scene.sdf_field.hidden_direction], retain_graph=True, allow_unused=True
    )
    assert all(g is None for g in found[:-1]) and (found[-1] != 0).any()
    assert all((g != 0).any() for g in torch.autograd.grad(shaded.albedo.sum(), parameters[-1:]))


def test_with_fixed_materials_a_rendered_ray_gives_them_no_gradient():
    """Nor through what the sum over directions adds to the split sum."""
    torch.manual_seed(0)
    scene = SceneModel(Config().replace({"n_levels": 2, "log2_table_size": 8, "initial_roughness": 0.8}))
    mesh = trimesh.creation.icosphere(3, 0.7)
    scene.use_mesh(MeshScene(mesh.vertices, mesh.faces), torch.tensor(mesh.vertices).float(), torch.tensor(mesh.faces))
    grid = OccupancyGrid(32, 1.5)
    grid.update(scene.sdf_field.sdf, scene.s_value)
    rays_o, rays_d = (
        torch.tensor([[3.0, 0.0, 0.2]]).expand(8, 3),
        unit(torch.randn(8, 3) * 0.1 + torch.tensor([-3.0, 0, 0])),
    )
    weights = [p for p in scene.material.parameters()]
    rays = rays_o, rays_d, torch.full((8,), 0.5)
    for fixed in (False, True):
        ray = render_rays(scene, find_samples(scene, grid.cells, *rays), fixed_materials=fixed)
        found = torch.autograd.grad(ray.colour.sum(), [*weights, scene.light.texels], allow_unused=True)
        assert scene.sums_light and (found[-1] != 0).any() and all(g is None for g in found[:-1]) == fixed
