"""The cells of the sky: whose light they hold, and where their shadows fall."""

import math

import pytest
import torch
import trimesh
from mesh_shapes import OFFSET, bits_of, grid_mesh, scene_of
from op_checks import generator, unit
from splitnerf.fields import LightPyramid, SkyCells
from splitnerf.fields.light import octahedral_texels


def lamp(axis: torch.Tensor, radiance: float = 1e4) -> LightPyramid:
    """A dark sky with one bright texel, that nearest to the axis."""
    light = LightPyramid(128)
    with torch.no_grad():
        light.texels.zero_()
        light.texels[-(128 * 128) :] = math.log(1e-4)
        at = (octahedral_texels(128, torch.device("cpu"))[0] @ axis).argmax()
        light.texels[at - 128 * 128] = math.log(radiance)
    return light


def test_texels_divide_the_sphere():
    """Their middles lie in their texels: a light that is linear in the direction is read there as it is."""
    directions, solid_angles = octahedral_texels(64, torch.device("cpu"))
    assert solid_angles.sum().item() == pytest.approx(4 * math.pi, rel=1e-5)
    second = (directions.T * solid_angles) @ directions
    torch.testing.assert_close(second, 4 * math.pi / 3 * torch.eye(3), rtol=0, atol=4e-3)
    light = LightPyramid(64)
    with torch.no_grad():
        light.texels.zero_()
        light.texels[-(64 * 64) :] = (2 + directions).log()
    found = light(directions, torch.zeros(64 * 64, 1))
    torch.testing.assert_close(found, 2 + directions, rtol=0, atol=1e-2)


def test_few_texels_are_divided():
    """A light of 16 x 16 texels has light for each of 1024 cells, and its power."""
    light = LightPyramid(16)
    with torch.no_grad():
        light.texels.normal_(generator=generator(2))
    sky = SkyCells(1024)
    cells = sky.light(light.evaluate())
    directions, solid_angles = octahedral_texels(16, torch.device("cpu"))
    assert cells.solid_angles.min() > 0.3 * 4 * math.pi / 1024 and cells.radiance.isfinite().all()
    power = (cells.radiance * cells.solid_angles[:, None]).sum(0)
    torch.testing.assert_close(power, (light.radiance() * solid_angles[:, None]).sum(0), rtol=2e-3, atol=0)
    assert torch.equal(cells.radiance, sky.light(light).radiance)
    near = (sky.centres @ directions.T).max(1)
    at_middle = near.values > math.cos(math.radians(1.0))
    torch.testing.assert_close(cells.radiance[at_middle], light.radiance()[near.indices[at_middle]], rtol=1e-4, atol=0)


def test_the_shadow_of_a_sphere_falls_where_the_sun_throws_it():
    """Suns anywhere in their cells; without aim the shadow is up to 0.07 away."""
    mesh = grid_mesh(3.0, 60) + trimesh.creation.icosphere(3, 0.25).apply_translation((0, 0, 0.7))
    scene = scene_of(mesh)
    axis = torch.linspace(-1.2, 1.2, 80)
    x = torch.cat([torch.cartesian_prod(axis, axis), torch.zeros(6400, 1)], 1)
    up = torch.tensor([[0.0, 0.0, 1.0]]).expand(6400, 3)
    sky, query = SkyCells(256), (x, up, up, torch.ones(6400, 1))

    def place(shade: torch.Tensor) -> torch.Tensor:
        return (x * shade[:, None]).sum(0) / shade.sum()

    apart = {True: [], False: []}
    for seed in range(6):
        sun = unit(up[:1] + 0.5 * torch.randn(1, 3, generator=generator(seed)).clamp(-1.2, 1.2))[0]
        sun = unit(sun[None] * torch.tensor([1.0, 1.0, 1.6]))[0]
        light = lamp(sun)
        true = octahedral_texels(128, torch.device("cpu"))[0]
        true = true[(true @ sun).argmax()]
        shadow = ~scene.is_open(x + OFFSET * up, true.expand(6400, 3))
        for aims in (True, False):
            lit = light.evaluate()
            towards = sky.aims(lit) if aims else sky.centres
            bits = bits_of(mesh, towards, n_channels=1, indirect=False)
            bits.light = sky.light(lit).radiance
            apart[aims].append((place(1 - bits(*query).diffuse[:, 0]) - place(shadow.float())).norm().item())
    assert max(apart[True]) < 0.01 and max(apart[False]) > 0.03
