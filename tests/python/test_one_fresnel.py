"""Training's shading and the path tracer have one BSDF: a plane of any material, seen at any angle, under any light."""

import numpy as np
import pytest
import torch
from blender_data import directions_of_map
from op_checks import unit
from splitnerf.data.asset import Asset, Material
from splitnerf.ops import fibonacci_directions, split_sum_shade
from splitnerf.ops.shading import SHADED, monte_carlo_light, shade_sums, summed_light
from splitnerf.render.path_traced import AssetRenderer
from splitnerf_tools.bench.subjects import MapLight
from stability.cases import drawn_directions

COSINES, ROUGHNESS, METALLIC = (0.2, 0.5, 0.9), (0.1, 0.4, 0.8), (0.0, 0.5, 1.0)
ALBEDO = (0.02, 0.1, 0.6)  # black, where Fresnel's term is all that shows, to bright
SAMPLES = 1 << 15
HEIGHT = 64  # of the maps


def view_at(cosine: float) -> np.ndarray:
    return np.array([(1 - cosine**2) ** 0.5, 0.0, cosine])


def path_traced(environment: np.ndarray, cosine: float, roughness: float, metallic: float) -> torch.Tensor:
    """Radiance [3] that a plane z = 0 sends towards a far camera."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    material = Material(albedo=ALBEDO, roughness=roughness, metallic=metallic)
    up = np.tile(np.array([0, 0, 1], np.float32), (4, 1))
    asset = Asset("plane", corners, faces, up, np.zeros(2, np.int32), [material])
    back = view_at(cosine)
    right = np.array([0.0, 1.0, 0.0])
    pose = np.stack([right, np.cross(back, right), back, 50 * back], 1)
    renderer = AssetRenderer(asset)
    maps = renderer.render(environment, pose, (1e4, 1e4, 0.5, 0.5), 1, 1, spp=SAMPLES, bounces=0, pixel_filter="box")
    return torch.from_numpy(maps["radiance"][0, 0])


def point(cosine: float, roughness: float, metallic: float) -> tuple[torch.Tensor, ...]:
    """Normal, view, albedo, roughness and metallic of the same plane, one row."""
    column = lambda x: torch.tensor([[x]])
    view = torch.from_numpy(view_at(cosine)).float()[None]
    return torch.tensor([[0.0, 0.0, 1.0]]), view, torch.tensor([ALBEDO]), column(roughness), column(metallic)


def furnace(cosine: float) -> np.ndarray:
    return np.ones((HEIGHT, 2 * HEIGHT, 3), np.float32)


def lamp(cosine: float) -> np.ndarray:
    """A small lamp, ten degrees beside the mirrored view, over next to nothing."""
    x, _, z = view_at(cosine)
    towards = unit(torch.tensor([[-x, 0.17, z]]).double()).numpy()[0]
    light = 0.02 + 40 * np.exp(60 * (directions_of_map(HEIGHT) @ towards - 1))
    return np.repeat(light[..., None], 3, -1).astype(np.float32)


@pytest.mark.parametrize("light", [furnace, lamp])
@pytest.mark.parametrize("metallic", METALLIC)
@pytest.mark.parametrize("cosine", COSINES)
def test_sums_over_directions_are_what_the_path_tracer_renders(cosine, metallic, light):
    environment = light(cosine)
    for roughness in ROUGHNESS:
        given = point(cosine, roughness, metallic)
        normal, view, albedo, rho, metal = given
        directions, pdf = drawn_directions(normal, view, rho, 0.2 + 0.6 * metallic, SAMPLES)
        incoming = MapLight(environment)(directions[0])[None]
        sums = monte_carlo_light(normal, view, rho, directions, pdf, incoming)
        shaded = shade_sums(normal, view, albedo=albedo, roughness=rho, metallic=metal, sums=sums, compensate=True)[0]
        true = path_traced(environment, cosine, roughness, metallic)
        torch.testing.assert_close(shaded, true, rtol=0.012, atol=2e-4, msg=lambda m: f"roughness {roughness}: {m}")


@pytest.mark.parametrize("metallic", METALLIC)
@pytest.mark.parametrize("cosine", COSINES)
def test_the_split_sum_in_uniform_light_is_what_the_path_tracer_renders(cosine, metallic):
    one = torch.ones(1, 3)
    for roughness in ROUGHNESS:
        given = dict(zip(SHADED, point(cosine, roughness, metallic)))
        shaded = split_sum_shade(**given, specular=one, diffuse=one, compensate=True)[0]
        true = path_traced(furnace(cosine), cosine, roughness, metallic)
        torch.testing.assert_close(shaded, true, rtol=0.012, atol=5e-4, msg=lambda m: f"roughness {roughness}: {m}")


@pytest.mark.parametrize("metallic", METALLIC)
def test_shared_directions_sum_to_the_same(metallic):
    """A rough material, over a lattice as dense as no training has it."""
    environment, lattice = lamp(0.5), fibonacci_directions(1 << 14)
    given = point(0.5, 0.6, metallic)
    area = torch.full((len(lattice),), 4 * torch.pi / len(lattice))
    seen = torch.ones(1, len(lattice))
    sums = summed_light(*given[:2], given[3], lattice, area, MapLight(environment)(lattice), seen)
    shaded = shade_sums(**dict(zip(SHADED, given)), sums=sums, compensate=True)[0]
    torch.testing.assert_close(shaded, path_traced(environment, 0.5, 0.6, metallic), rtol=0.012, atol=2e-4)
