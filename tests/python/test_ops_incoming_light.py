"""incoming_light: its directions, densities and the light that it finds, against closed forms and the path tracer."""

import math

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import grid_mesh, scene_of
from op_checks import generator, on_threads, unit
from splitnerf.data.asset import Asset, Material
from splitnerf.data.environment import sample_environment
from splitnerf.ops import MeshScene
from splitnerf.ops.shading import SHADED, monte_carlo_light, shade_sums
from splitnerf.ops.visibility import IncomingLight, TexturedSurface, incoming_light
from splitnerf.render.path_traced import AssetRenderer

SIGMAS = 4.5
WHITE = torch.ones(4, 8, 3)


# ---- scenes ----


def plain_surface(mesh: trimesh.Trimesh, roughness: float = 1.0, metallic: float = 0.0) -> TexturedSurface:
    """A white mesh whose normals are the triangles'."""
    n = len(mesh.vertices)
    of_vertices = (torch.zeros(n, k) for k in (3, 4, 2))
    gloss, up = torch.tensor([[[roughness, metallic]]]), torch.tensor([[[0.0, 0.0, 1.0]]])
    return TexturedSurface(scene_of(mesh), *of_vertices, torch.ones(1, 1, 3), gloss, up)


def under_a_roof() -> trimesh.Trimesh:
    """A floor of width 2 below a plate of width 1 at height 1/2."""
    return trimesh.util.concatenate([grid_mesh(2.0, 2), grid_mesh(1.0, 2, z=0.5)])


def flat_points(n: int, n_dot_v: float = 0.8) -> dict[str, torch.Tensor]:
    """n times the origin on a floor that faces up, white and rough."""
    up = torch.tensor([0.0, 0.0, 1.0]).repeat(n, 1)
    view = torch.tensor([math.sqrt(1 - n_dot_v**2), 0.0, n_dot_v]).repeat(n, 1)
    white = {"albedo": torch.ones(n, 3), "roughness": torch.ones(n, 1), "metallic": torch.zeros(n, 1)}
    return {"positions": 0 * up, "geometric_normals": up, "normals": up, "view_dirs": view} | white


def furnished_corner() -> Asset:
    """A floor, a wall and a ball: they block, light and mirror each other; every texture varies."""
    wall = grid_mesh(2.0, 3).apply_transform(trimesh.transformations.rotation_matrix(math.pi / 2, [0, 1, 0]))
    ball = trimesh.creation.icosphere(2, 0.4).apply_translation((0.0, 0.1, 0.45))
    parts = [grid_mesh(2.0, 3), wall.apply_translation((-1, 0, 1)), ball]
    mesh = trimesh.util.concatenate(parts)
    normals = np.concatenate([np.asarray(part.vertex_normals) for part in parts])
    random = np.random.default_rng(0)
    tangents = np.cross(normals, random.normal(size=normals.shape))
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    tilts = np.concatenate([random.uniform(-0.4, 0.4, (8, 8, 2)), np.ones((8, 8, 1))], axis=2)
    material = Material(
        metallic=1.0,
        albedo_texture=random.uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32),
        roughness_metallic_texture=random.uniform(0.15, 0.9, (8, 8, 2)).astype(np.float32),
        normal_texture=(tilts / np.linalg.norm(tilts, axis=2, keepdims=True)).astype(np.float32),
    )
    return Asset(
        "corner",
        np.asarray(mesh.vertices, np.float32),
        np.asarray(mesh.faces, np.int32),
        normals.astype(np.float32),
        np.zeros(len(mesh.faces), np.int32),
        [material],
        uv=random.uniform(0, 1, (len(normals), 2)).astype(np.float32),
        tangents=np.concatenate([tangents, np.ones((len(normals), 1))], axis=1).astype(np.float32),
    )


def textured(asset: Asset) -> TexturedSurface:
    m = asset.materials[0]
    values = asset.normals, asset.tangents, asset.uv, m.albedo_texture, m.roughness_metallic_texture, m.normal_texture
    return TexturedSurface(MeshScene(asset.vertices, asset.triangles), *map(torch.from_numpy, values))


def sky_with_a_lamp() -> np.ndarray:
    sky = np.random.default_rng(1).uniform(0.1, 0.5, (16, 32, 3)).astype(np.float32)
    sky[4, 20] = 150.0
    return sky


def arriving_radiance(light: IncomingLight, environment: np.ndarray) -> torch.Tensor:
    sky = torch.from_numpy(sample_environment(environment, light.directions.numpy()).astype(np.float32))
    return sky * light.visible[..., None] + light.sent


def reflected(light: IncomingLight, radiance: torch.Tensor, points: dict[str, torch.Tensor]) -> torch.Tensor:
    """[n, 3] estimates of the reflected radiance, in float64."""
    p = {name: x.double() for name, x in points.items()}
    lobe = p["normals"], p["view_dirs"], p["roughness"]
    sums = monte_carlo_light(*lobe, light.directions.double(), light.pdf.double(), radiance.double())
    given = {name: p[name] for name in SHADED[:5]}
    return shade_sums(**given, sums=sums, compensate=True)


def mean_and_error(samples: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean of independent rows and its standard error."""
    return samples.mean(0), samples.std(0) / math.sqrt(len(samples))


# ---- the light that is found ----


def seen_from_close(asset: Asset, environment: np.ndarray, bounces: int, n_points: int = 12) -> list[tuple]:
    """[(point, radiance [3], standard error [3])]: points of an asset, each as one pixel of the path tracer sees it."""
    random, renderer = np.random.default_rng(5), AssetRenderer(asset)
    lens, found = (1e3, 1e3, 0.5, 0.5), []
    for face in random.choice(len(asset.triangles), n_points, replace=False):
        corners = asset.vertices[asset.triangles[face]].astype(np.float64)
        position = random.dirichlet([2.0, 2.0, 2.0]) @ corners
        geometric = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        geometric /= np.linalg.norm(geometric)
        view = geometric + 0.9 * unit(torch.from_numpy(random.normal(size=3))).numpy()
        view /= np.linalg.norm(view)
        across = np.cross(view, random.normal(size=3))
        across /= np.linalg.norm(across)
        pose = np.stack([across, np.cross(view, across), view, position + 0.02 * view], axis=1)
        options = {"spp": 16384, "bounces": bounces, "clamp_indirect": 0.0, "pixel_filter": "box"}
        views = [renderer.render(environment, pose, lens, 1, 1, seed=seed, **options) for seed in range(8)]
        maps = {name: torch.tensor(x[0, 0]).reshape(1, -1) for name, x in views[0].items()}
        assert maps["alpha"] == 1 and abs(maps["depth"] - 0.02) < 1e-4
        point = {
            "positions": torch.tensor(position)[None],
            "geometric_normals": torch.tensor(geometric)[None],
            "normals": unit(maps["normal"]),
            "view_dirs": torch.tensor(view)[None],
            "albedo": maps["albedo"],
            "roughness": maps["roughness"],
            "metallic": maps["metallic"],
        }
        radiance = torch.tensor(np.stack([v["radiance"][0, 0] for v in views]), dtype=torch.float64)
        found.append(({name: x.float() for name, x in point.items()}, *mean_and_error(radiance)))
    return found


@pytest.mark.parametrize("bounces", [0, 3])
def test_reflected_light_is_the_path_tracer_s(bounces):
    asset, sky, n = furnished_corner(), sky_with_a_lamp(), 4000
    surface, darkened, lit = textured(asset), 0, 0
    for point, expected, tracer_error in seen_from_close(asset, sky, bounces):
        points = {name: x.repeat(n, 1) for name, x in point.items()}
        light = incoming_light(surface, torch.from_numpy(sky), **points, n_directions=32, max_bounces=bounces, seed=1)
        mean, error = mean_and_error(reflected(light, arriving_radiance(light, sky), points))
        noise = torch.hypot(error, tracer_error)
        assert (noise < 0.015 * expected).all()
        assert ((mean - expected).abs() < SIGMAS * noise + 1e-3 * expected).all(), (mean, expected, noise)
        darkened += int((light.visible[light.pdf > 0] == 0).any())
        lit += int((light.sent > 0).any())
    assert darkened >= 10 and lit >= (10 if bounces else 0)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_in_a_white_furnace_what_blocks_sends_as_much_light(metallic):
    """Nothing is absorbed between a white floor and a white roof: after all bounces each direction brings light 1."""
    surface = plain_surface(under_a_roof(), roughness=0.7, metallic=metallic)
    light = incoming_light(surface, WHITE, **flat_points(1500), n_directions=32, max_bounces=64)
    blocked = (light.pdf > 0) & (light.visible == 0)
    mean, error = mean_and_error(light.sent[blocked].double())
    assert blocked.sum() > 10000 and (error < 0.01).all()
    assert ((mean - 1).abs() < SIGMAS * error + 5e-3).all(), (mean, error)


def test_no_light_is_sent_without_bounces_and_it_is_bounded_where_asked():
    asset, sky = furnished_corner(), torch.from_numpy(40 * sky_with_a_lamp())
    points = flat_points(30) | {"positions": torch.tensor([[-0.9, 0.3, 0.0]]).repeat(30, 1)}

    def sent(**options) -> torch.Tensor:
        return incoming_light(textured(asset), sky, **points, n_directions=32, **options).sent

    assert (sent(max_bounces=0) == 0).all()
    one, all_, bounded = (sent(**x) for x in ({"max_bounces": 1}, {}, {"max_bounces": 1, "clamp_indirect": 2.0}))
    assert 0 < one.sum() < all_.sum()
    assert one.amax() > 8.0 and 0 < bounded.amax() <= 4.0  # two contributions, by the light and by the material


# ---- what blocks ----


def test_the_environment_is_seen_past_the_roof_alone():
    light = incoming_light(plain_surface(under_a_roof()), WHITE, **flat_points(100), n_directions=64)
    on_roof = 0.5 * light.directions / light.directions[..., 2:].clamp(min=1e-9)
    reach = on_roof[..., :2].abs().amax(-1)
    counts = light.pdf > 0
    assert torch.equal(counts, light.directions[..., 2] > 0)
    assert (light.visible[counts & (reach > 0.501)] == 1).all() and (light.visible[counts & (reach < 0.499)] == 0).all()
    assert (light.visible[~counts] == 0).all() and (light.sent[~counts] == 0).all()
    assert (light.sent[light.visible > 0] == 0).all()
    assert (light.sent[counts & (reach < 0.499)].amax(-1) > 0).float().mean() > 0.9
    assert 0.2 < light.visible[counts].mean() < 0.8


# ---- densities ----


@pytest.mark.parametrize("lamp", [False, True])
@pytest.mark.parametrize("roughness, metallic", [(0.05, 1.0), (0.5, 0.3), (1.0, 0.0)])
def test_densities_add_up_to_the_hemisphere(roughness, metallic, lamp):
    gloss = {"roughness": torch.full((2000, 1), roughness), "metallic": torch.full((2000, 1), metallic)}
    points = flat_points(2000, 0.4) | gloss
    sky = torch.from_numpy(sky_with_a_lamp()) if lamp else WHITE
    light = incoming_light(plain_surface(grid_mesh(2.0, 1)), sky, **points, n_directions=16, seed=2)
    torch.testing.assert_close(light.directions.norm(dim=-1), torch.ones(2000, 16), rtol=0, atol=1e-6)
    inverse = torch.where(light.pdf > 0, 1 / light.pdf.double(), 0.0)
    mean, error = mean_and_error(inverse.mean(1))
    assert error < 0.2 and abs(mean - 2 * math.pi) < SIGMAS * error, (mean, error)


def test_a_black_environment_leaves_the_material_s_directions():
    points = flat_points(500)
    light = incoming_light(plain_surface(grid_mesh(2.0, 1)), 0 * WHITE, **points, n_directions=32)
    assert (light.sent == 0).all() and light.visible.mean() > 0.9
    cosine = light.directions[..., 2] / math.pi
    mean, error = mean_and_error(torch.where(light.pdf > 0, cosine / light.pdf, 0.0).double().mean(1))
    assert error < 0.01 and abs(mean - 1) < SIGMAS * error
    mean, error = mean_and_error(reflected(light, light.visible[..., None].expand(-1, -1, 3), points))
    assert ((mean - 1).abs() < SIGMAS * error + 3e-3).all()


def test_equal_seeds_give_equal_bits_whatever_the_threads():
    surface, sky = textured(furnished_corner()), torch.from_numpy(sky_with_a_lamp())
    floor = torch.cat([torch.rand(40, 2, generator=generator()) * 1.8 - 0.9, torch.zeros(40, 1)], 1)
    points = flat_points(40) | {"positions": floor}
    drawn = lambda seed: incoming_light(surface, sky, **points, n_directions=32, seed=seed)
    one, two, other = (on_threads(n, lambda: drawn(seed)) for n, seed in ((1, 7), (2, 7), (2, 8)))
    assert all(torch.equal(a, b) for a, b in zip(one, two))
    assert all(not torch.equal(a, b) for a, b in zip(one, other))
    assert not torch.equal(one.directions[0], one.directions[1])
