"""Unwrapping and baking: texels, padding, normal maps and occlusion against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import trimesh
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from splitnerf.data.asset import Asset, vertex_tangents
from splitnerf.export import surface
from splitnerf.export.bake import bake_occlusion, rasterise
from splitnerf.export.meshing import extract_mesh
from splitnerf.export.surface import Surface, to_level_set
from splitnerf.export.textured import PADDING, textured_asset, unwrap

SIZE = 256
SPACING = 3.0 / 79


def bumpy(x):
    """A sphere with waves, four times as long as the coarse mesh's edges are."""
    return x.norm(dim=1) - 0.8 - 0.012 * (12 * x).sin().sum(dim=1)


def with_gradient(field):
    def gradient(points):
        with torch.enable_grad():
            points = points.clone().requires_grad_()
            distance = field(points)
            (slope,) = torch.autograd.grad(distance.sum(), points)
        return distance.detach(), slope

    return gradient


def albedo_at(x):
    return 0.5 + 0.4 * np.sin(7 * x)


def surface_of(field):
    gradient = with_gradient(field)

    def materials(x):
        rough, metal = 0.5 + 0.3 * x[:, :1], (x[:, 2:] > 0).float()
        return (
            torch.from_numpy(albedo_at(x.numpy())),
            rough,
            metal,
            torch.nn.functional.normalize(gradient(x)[1], dim=1),
        )

    return Surface(field, gradient, materials)


@pytest.fixture(scope="module")
def baked():
    vertices, faces = extract_mesh(bumpy, 1.5, 80)
    return textured_asset(
        "bumpy",
        vertices,
        faces,
        surface_of(bumpy),
        n_faces=600,
        texture_size=SIZE,
        spacing=SPACING,
        occlusion_offset=0.01,
    )


def angle(a, b):
    a, b = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (a, b))
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1, 1)))


def test_normal_map_restores_the_fine_normals(baked):
    """The map in 8 bit, decoded as glTF says, gives the field's normals where the coarse mesh's are off."""
    asset = baked.asset
    texels = rasterise(asset.uv, asset.triangles, SIZE)
    normal, tangent = (texels.interpolate(values, asset.triangles) for values in (asset.normals, asset.tangents))
    bitangent = np.cross(normal, tangent[:, :3]) * tangent[:, 3:]
    stored = np.rint(asset.materials[0].normal_texture * 127.5 + 127.5) / 127.5 - 1
    local = stored.reshape(-1, 3)[texels.index]
    world = local[:, :1] * tangent[:, :3] + local[:, 1:2] * bitangent + local[:, 2:] * normal
    points = to_level_set(surface_of(bumpy), texels.interpolate(asset.vertices, asset.triangles), 2 * SPACING, normal)
    truth = with_gradient(bumpy)(torch.from_numpy(points))[1].numpy()
    assert angle(normal, truth).mean() > 2.0
    assert angle(world, truth).mean() < 0.5
    assert np.quantile(angle(world, truth), 0.99) < 2.0


def test_albedo_and_materials_are_those_of_the_surface(baked):
    asset = baked.asset
    material = asset.materials[0]
    texels = rasterise(asset.uv, asset.triangles, SIZE)
    normal = texels.interpolate(asset.normals, asset.triangles)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    points = to_level_set(surface_of(bumpy), texels.interpolate(asset.vertices, asset.triangles), 2 * SPACING, normal)
    assert bumpy(torch.from_numpy(points)).abs().max() < 1e-4
    assert np.abs(material.albedo_texture.reshape(-1, 3)[texels.index] - albedo_at(points)).max() < 1e-5
    roughness, metallic = material.roughness_metallic_texture.reshape(-1, 2)[texels.index].T
    assert np.abs(roughness - 0.5 - 0.3 * points[:, 0]).max() < 1e-5
    assert np.array_equal(metallic, points[:, 2] > 0)


def test_mesh_is_light_closed_and_on_the_surface(baked):
    asset = baked.asset
    assert baked.watertight and len(asset.triangles) <= 600
    assert bumpy(torch.from_numpy(asset.vertices)).abs().max() < 1e-4
    welded = trimesh.Trimesh(asset.vertices, asset.triangles, process=False)
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    assert welded.is_watertight and welded.volume > 0
    assert (baked.occlusion > 0.8).all()  # next to convex
    material = asset.materials[0]  # a factor multiplies its texture
    assert material.roughness == material.metallic == 1.0 and tuple(material.albedo) == (1.0, 1.0, 1.0)


def test_charts_do_not_overlap_and_keep_their_distance():
    ball = trimesh.creation.icosphere(subdivisions=3)
    origins, faces, uv = unwrap(np.float32(ball.vertices), np.int32(ball.faces), SIZE)
    assert np.array_equal(origins[faces], ball.faces) and uv.min() >= 0 and uv.max() <= 1
    n = len(uv)
    graph = coo_matrix((np.ones(2 * len(faces)), (faces[:, :2].reshape(-1), faces[:, 1:].reshape(-1))), shape=(n, n))
    n_charts, chart = connected_components(graph, directed=False)
    texels = rasterise(uv, faces, SIZE)
    owner = np.full(SIZE * SIZE, -1)
    owner[texels.index] = chart[faces[texels.triangle, 0]]
    owner = owner.reshape(SIZE, SIZE)
    for c in range(n_charts):
        others = (owner >= 0) & (owner != c)
        assert distance_transform_edt(~others)[owner == c].min() > PADDING / 2
    edges = uv[faces[:, 1:]] - uv[faces[:, :1]]
    area = 0.5 * np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]).sum()
    assert len(texels.index) == pytest.approx(area * SIZE**2, rel=0.01)  # each texel counted once


def test_a_chart_keeps_its_shape():
    """A strip, eight times as long as wide, whatever the shape of the packed area."""
    vertices, faces = np.float32([[0, 0, 0], [8, 0, 0], [8, 1, 0], [0, 1, 0]]), np.int32([[0, 1, 2], [0, 2, 3]])
    origins, new_faces, uv = unwrap(vertices, faces, SIZE)
    points = vertices[origins]
    scales = [
        np.linalg.norm(uv[new_faces[:, i]] - uv[new_faces[:, i - 1]], axis=1)
        / np.linalg.norm(points[new_faces[:, i]] - points[new_faces[:, i - 1]], axis=1)
        for i in range(3)
    ]
    assert np.ptp(scales) < 0.02 * np.mean(scales)


def test_charts_are_small_and_fill_a_large_texture():
    """None holds much more than 1 / 64 of the surface; between them lie texels of the texture as it is asked for."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    _, faces, uv = unwrap(np.float32(ball.vertices), np.int32(ball.faces), 1024)
    graph = coo_matrix(
        (np.ones(2 * len(faces)), (faces[:, :2].reshape(-1), faces[:, 1:].reshape(-1))), shape=(len(uv),) * 2
    )
    _, chart = connected_components(graph, directed=False)
    assert np.bincount(chart[faces[:, 0]], ball.area_faces).max() < 2 * ball.area / 64
    assert len(rasterise(uv, faces, 1024).index) > 0.38 * 1024**2


def test_points_move_onto_the_level_set_and_never_away():
    """f = |x|^2 - 1 is no distance: Newton and the secant still land; what is out of reach stays inside it."""

    def field(x):
        return x.square().sum(dim=1) - 1

    squares = surface_of(field)
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(1000, 3))
    directions = np.float32(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    points = np.float32(directions * rng.uniform(0.9, 1.1, (1000, 1)))
    for along in (None, directions):
        moved = to_level_set(squares, points, 0.2, along)
        assert np.abs(np.linalg.norm(moved, axis=1) - 1).max() < 1e-5
    moved = to_level_set(squares, points, 0.02)
    assert np.linalg.norm(moved - points, axis=1).max() < 0.0201
    assert (np.abs(np.linalg.norm(moved, axis=1) - 1) <= np.abs(np.linalg.norm(points, axis=1) - 1) + 1e-6).all()
    across = np.float32(np.cross(directions, [0.0, 0.0, 1.0]))
    assert np.array_equal(
        to_level_set(squares, points, 0.2, across / np.linalg.norm(across, axis=1, keepdims=True)), points
    )


def test_materials_that_are_not_finite_are_refused():
    ball = surface_of(bumpy)
    broken = Surface(ball.sdf, ball.gradient, lambda x: tuple(m / (x[:, :1] > 0) for m in ball.materials(x)))
    with pytest.raises(RuntimeError, match="the materials are not finite"):
        surface.surface_materials(broken, np.float32([[1, 0, 0], [-1, 0, 0]]))


def test_occlusion_beside_a_wall():
    """A floor at distance d from a long wall of height 1 sees 1 - (1 - d / sqrt(d^2 + 1)) / 2 of its hemisphere."""
    floor = np.float32([[0, -1, 0], [2, -1, 0], [2, 1, 0], [0, 1, 0]])
    wall = np.float32([[0, -60, 0], [0, 60, 0], [0, 60, 1], [0, -60, 1]])
    vertices = np.concatenate([floor, wall])
    faces = np.int32([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    normals = np.float32([[0, 0, 1]] * 4 + [[1, 0, 0]] * 4)
    uv = np.float32([[0, 1], [1, 1], [1, 0], [0, 0]] + [[2, 2], [3, 2], [3, 3], [2, 3]])  # the wall off the texture
    tangents, ids = vertex_tangents(vertices, faces, normals, uv), np.zeros(len(faces), np.int32)
    mesh = Asset("a", vertices, faces, normals, ids, uv=uv, tangents=tangents)
    occlusion = bake_occlusion(mesh, 128, 1e-3)
    d = (np.arange(128) + 0.5) / 64
    expected = 1 - 0.5 * (1 - d / np.sqrt(d**2 + 1))
    assert occlusion.mean(axis=0)[8:-8] == pytest.approx(expected[8:-8], abs=0.02)
