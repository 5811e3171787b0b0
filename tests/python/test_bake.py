"""Unwrapping, tangents and baking: texels, padding, normal maps and occlusion against closed forms."""

import dataclasses

import numpy as np
import pytest
import torch
import trimesh
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from splitnerf.data.asset import Asset, Material, vertex_tangents
from splitnerf.export import bake, surface, writers
from splitnerf.export.meshing import extract_mesh
from splitnerf.export.surface import Surface, to_level_set
from splitnerf.export.textured import PADDING, textured_asset, unwrap, vertex_normals

SIZE, SPACING = 256, 3.0 / 79


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
        normal = torch.nn.functional.normalize(gradient(x)[1], dim=1)
        return torch.from_numpy(albedo_at(x.numpy())), rough, metal, normal

    return Surface(field, gradient, materials)


@pytest.fixture(scope="module")
def baked():
    """What is baked, its texels, their interpolated normals and their points on the surface."""
    vertices, faces = extract_mesh(bumpy, 1.5, 80)
    sizes = {"n_faces": 600, "texture_size": SIZE, "spacing": SPACING, "occlusion_offset": 0.01}
    asset, *more = textured_asset("bumpy", vertices, faces, surface_of(bumpy), **sizes)
    texels = bake.rasterise(asset.uv, asset.triangles, SIZE)
    places, normal = (texels.interpolate(values, asset.triangles) for values in (asset.vertices, asset.normals))
    along = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return asset, *more, texels, normal, to_level_set(surface_of(bumpy), places, 2 * SPACING, along)


def angle(a, b):
    a, b = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (a, b))
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1, 1)))


def test_normal_map_restores_the_fine_normals(baked):
    """The map in 8 bit, decoded as glTF says, gives the field's normals where the coarse mesh's are off."""
    asset, *_, texels, normal, points = baked
    tangent = texels.interpolate(asset.tangents, asset.triangles)
    bitangent = np.cross(normal, tangent[:, :3]) * tangent[:, 3:]
    stored = np.rint(asset.materials[0].normal_texture * 127.5 + 127.5) / 127.5 - 1
    local = stored.reshape(-1, 3)[texels.index]
    world = local[:, :1] * tangent[:, :3] + local[:, 1:2] * bitangent + local[:, 2:] * normal
    truth = with_gradient(bumpy)(torch.from_numpy(points))[1].numpy()
    assert angle(normal, truth).mean() > 2.0
    assert angle(world, truth).mean() < 0.5
    assert np.quantile(angle(world, truth), 0.99) < 2.0


def test_albedo_and_materials_are_those_of_the_surface(baked):
    asset, *_, texels, _, points = baked
    material = asset.materials[0]
    assert bumpy(torch.from_numpy(points)).abs().max() < 1e-4
    assert np.abs(material.albedo_texture.reshape(-1, 3)[texels.index] - albedo_at(points)).max() < 1e-5
    roughness, metallic = material.roughness_metallic_texture.reshape(-1, 2)[texels.index].T
    assert np.abs(roughness - 0.5 - 0.3 * points[:, 0]).max() < 1e-5
    assert np.array_equal(metallic, points[:, 2] > 0)


def test_mesh_is_light_closed_and_on_the_surface(baked):
    asset, occlusion, watertight, *_ = baked
    assert watertight and len(asset.triangles) <= 600
    assert bumpy(torch.from_numpy(asset.vertices)).abs().max() < 1e-4
    welded = trimesh.Trimesh(asset.vertices, asset.triangles, process=False)
    welded.merge_vertices(merge_tex=True, merge_norm=True)
    assert welded.is_watertight and welded.volume > 0
    assert (occlusion > 0.8).all()  # next to convex
    material = asset.materials[0]  # a factor multiplies its texture
    assert material.roughness == material.metallic == 1.0 and tuple(material.albedo) == (1.0, 1.0, 1.0)


def charts_of(faces: np.ndarray) -> tuple[int, np.ndarray]:
    """The number of charts, and that of each vertex."""
    edges = np.ones(2 * len(faces)), (faces[:, :2].reshape(-1), faces[:, 1:].reshape(-1))
    return connected_components(coo_matrix(edges, shape=(faces.max() + 1,) * 2), directed=False)


def test_charts_do_not_overlap_and_keep_their_distance():
    ball = trimesh.creation.icosphere(subdivisions=3)
    origins, faces, uv = unwrap(np.float32(ball.vertices), np.int32(ball.faces), SIZE)
    assert np.array_equal(origins[faces], ball.faces) and uv.min() >= 0 and uv.max() <= 1
    n_charts, chart = charts_of(faces)
    texels = bake.rasterise(uv, faces, SIZE)
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
    _, chart = charts_of(faces)
    assert np.bincount(chart[faces[:, 0]], ball.area_faces).max() < 2 * ball.area / 64
    assert len(bake.rasterise(uv, faces, 1024).index) > 0.38 * 1024**2


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
    for slope, end in ((0.3, 0.0), (0.15, 0.1)):  # along a line that rises by less than 0.2 they stay
        flat, along = dataclasses.replace(squares, sdf=lambda x, slope=slope: slope * x[:, 0]), np.float32([[1, 0, 0]])
        assert to_level_set(flat, 0.1 * along, 0.2, along)[0] == pytest.approx([end, 0, 0], abs=1e-5)
    across = np.float32(np.cross(directions, [0.0, 0.0, 1.0]))
    assert np.array_equal(to_level_set(squares, points, 0.2, across / np.linalg.norm(across, None, 1, True)), points)


def test_normals_of_a_map_are_in_the_frame_of_its_texel():
    """That of a mirrored chart too; what faces into the surface is raised to 0.02 above it."""
    world, up = np.float32([[0.6, 0, 0.8], [0.6, 0, 0.8], [2, 0, -1]]), np.float32([[0, 0, 1]] * 3)
    found = bake.to_tangent_space(world, up, np.float32([[1, 0, 0, 1], [0, 1, 0, -1], [0, -1, 0, 1]]))
    low = np.array([0, 2 / 5**0.5, 0.02])
    assert found == pytest.approx(np.array([[0.6, 0, 0.8], [0, 0.6, 0.8], low / np.linalg.norm(low)]), abs=1e-6)


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
    occlusion = bake.bake_occlusion(unwrapped(vertices, faces, normals, uv), 128, 1e-3)
    d = (np.arange(128) + 0.5) / 64
    expected = 1 - 0.5 * (1 - d / np.sqrt(d**2 + 1))
    assert occlusion.mean(axis=0)[8:-8] == pytest.approx(expected[8:-8], abs=0.02)


# ---- parts of the export one by one ----


def unwrapped(vertices, faces, normals, uv) -> Asset:
    """An asset to bake."""
    ids, tangents = np.zeros(len(faces), np.int32), vertex_tangents(vertices, faces, normals, uv)
    return Asset("a", vertices, faces, normals, ids, uv=uv, tangents=tangents)


def square() -> Asset:
    """The unit square, z up, over the whole texture: x to the right, y down."""
    vertices = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces, normals, uv = np.int32([[0, 1, 2], [0, 2, 3]]), np.float32([[0, 0, 1]] * 4), vertices[:, :2].copy()
    return unwrapped(vertices, faces, normals, uv)


def test_a_bake_in_bands_is_the_whole_one(monkeypatch):
    """A field that differs from texel to texel, charts with a gap between them, and bands without a texel."""
    uv = np.float32([[0.1, 0.1], [0.6, 0.15], [0.2, 0.4], [0.3, 0.7], [0.9, 0.75], [0.8, 0.95]])
    vertices = np.column_stack([uv, np.zeros(6)]).astype(np.float32)
    faces, normals = np.int32([[0, 1, 2], [3, 4, 5]]), np.float32([[0, 0, 1]] * 6)
    mesh = unwrapped(vertices, faces, normals, uv)

    def materials(x):
        return x.abs(), x[:, :1], x[:, 1:2], torch.nn.functional.normalize(torch.tensor([0.2, 0.1, 1.0]) + x, dim=1)

    floor = Surface(lambda x: x[:, 2], lambda x: (x[:, 2], torch.tensor([[0.0, 0.0, 1.0]]).expand_as(x)), materials)
    whole = bake.bake(mesh, floor, 64, reach=0.1, offset=0.01)
    assert whole[0].roughness_metallic_texture[-1, -1] == pytest.approx([0.8, 0.95], abs=0.06)  # of the nearest corner
    monkeypatch.setattr(bake, "BAND", 64 * 7)
    parts = bake.bake(mesh, floor, 64, reach=0.1, offset=0.01)
    for name in ("albedo_texture", "roughness_metallic_texture", "normal_texture"):
        assert np.array_equal(getattr(whole[0], name), getattr(parts[0], name)), name
    assert np.array_equal(whole[1], parts[1])


def test_maps_encoded_in_bands_are_the_whole_ones(monkeypatch):
    random = np.random.default_rng(0)
    gloss, open_share = random.random((30, 20, 2), np.float32), random.random((30, 20), np.float32)
    monkeypatch.setattr(writers, "BAND", 20 * 7)
    pixels = writers.encoded(lambda *bands: np.dstack(bands), open_share, gloss)
    assert np.array_equal(pixels, np.rint(np.dstack([open_share, gloss]) * 255).astype(np.uint8))


def test_occlusion_baked_small_stands_where_it_belongs(monkeypatch):
    """A share that is x at x: at each texel's centre, but for the outer ones, which repeat what is next to them."""

    def factors(scene, points, normals, *args, offset, **kwargs):
        # traced off the surface along its normal
        assert (normals == torch.tensor([0.0, 0.0, 1.0])).all() and offset == 0.037
        return points[:, :1], None

    monkeypatch.setattr(bake, "occlusion_factors", factors)
    found = bake.bake_occlusion(square(), 64, 0.037)
    x = (np.arange(64) + 0.5) / 64
    np.testing.assert_allclose(found[:, 2:-2], np.broadcast_to(x[2:-2], (64, 60)), atol=1e-3)


def test_charts_between_the_texels_are_refused():
    mesh = dataclasses.replace(square(), uv=square().uv * np.float32(0.01) + np.float32(0.02))
    assert (bake.bake_occlusion(mesh, 8, 0.01) == 1).all()
    with pytest.raises(RuntimeError, match="no texel of 8 x 8 lies in a chart; give a larger texture size"):
        bake.bake(mesh, ball(), 8, reach=0.1, offset=0.01)


def ball(radius: float = 0.8, sign: float = 1.0) -> Surface:
    """|x| - radius; its gradient with a sign, and tilted towards +x."""

    def field(x):
        return x.norm(dim=1) - radius

    def gradient(x):
        return field(x), sign * torch.nn.functional.normalize(x + torch.tensor([0.3, 0.0, 0.0]), dim=1)

    def materials(x):
        half = torch.full((len(x), 1), 0.5)
        return half.expand(-1, 3), half, half, torch.nn.functional.normalize(x, dim=1)

    return Surface(field, gradient, materials)


def test_normals_are_the_fields_where_they_agree_with_the_faces():
    """Tilted ones are taken, opposite ones are not: those of the faces stand."""
    mesh = trimesh.creation.icosphere(2, 0.8)
    vertices, faces = np.float32(mesh.vertices), np.int32(mesh.faces)
    tilted = vertices + np.float32([0.3, 0, 0])
    tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
    for slope in (1.0, 3.0):
        np.testing.assert_allclose(vertex_normals(ball(sign=slope), vertices, faces), tilted, atol=1e-5)
    np.testing.assert_allclose(vertex_normals(ball(sign=-1.0), vertices, faces), mesh.vertex_normals, atol=1e-5)
    for cosine, z in ((0.25, 0.25), (0.15, 1.0)):  # those that lean by up to acos(0.2) are taken
        slope = torch.tensor([[(1 - cosine**2) ** 0.5, 0.0, cosine]]).expand(4, 3)
        leans = dataclasses.replace(ball(), gradient=lambda x, slope=slope: (x[:, 0], slope))
        assert vertex_normals(leans, square().vertices, square().triangles)[:, 2] == pytest.approx(z)
    more, field = np.concatenate([vertices, np.float32([[0, 0.9, 0]])]), np.float32([0.3, 0.9, 0]) / 0.9**0.5
    assert vertex_normals(ball(), more, faces)[-1] == pytest.approx(field, abs=1e-5)  # of no face
    assert vertex_normals(ball(sign=0.0), more, faces)[-1].tolist() == [0, 0, 1]


def test_without_occlusion_all_is_open_and_what_is_not_finite_is_refused():
    material = Material("paint", roughness_metallic_texture=np.full((4, 4, 2), 0.25, np.float32))
    asset = dataclasses.replace(square(), materials=[material])
    assert (writers.encode_maps("a", asset, None)[1][..., 0] == 255).all()
    assert (writers.encode_maps("a", asset, np.zeros((4, 4)))[1][..., 0] == 0).all()
    asset.materials[0].roughness_metallic_texture[0, 0, 0] = np.nan
    with pytest.raises(RuntimeError, match="finite"):
        writers.encode_maps("a", asset, None)


# ---- tangents ----


QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UP = np.tile([0.0, 0.0, 1.0], (4, 1))


@pytest.mark.parametrize(
    ("uv", "tangent", "sign"),
    [
        ([[0, 1], [1, 1], [1, 0], [0, 0]], [1, 0, 0], 1),  # v counts downward, so up is +y = cross(z, x)
        ([[0, 0], [1, 0], [1, 1], [0, 1]], [1, 0, 0], -1),  # v grows along +y: up is -y = -cross(z, x)
        ([[1, 1], [0, 1], [0, 0], [1, 0]], [-1, 0, 0], -1),  # u mirrored, up is +y = -cross(z, -x)
        ([[1, 1], [1, 0], [0, 0], [0, 1]], [0, -1, 0], 1),  # u along -y, up +x = cross(z, -y)
    ],
)
def test_mirrored_and_turned_textures(uv, tangent, sign):
    tangents = vertex_tangents(QUAD, FACES, UP, np.array(uv, float))
    assert tangents.dtype == np.float32
    assert tangents == pytest.approx(np.tile([*tangent, sign], (4, 1)), abs=1e-6)


def test_sphere_has_its_circles_of_latitude():
    """u the longitude, v the colatitude: the tangent is d position / d longitude, the bitangent points north."""
    rows, columns = 41, 80
    theta, phi = np.meshgrid(np.linspace(0.3, np.pi - 0.3, rows), np.linspace(0, 6, columns), indexing="ij")
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    faces = np.concatenate([np.stack([a, a + columns, a + columns + 1], 1), np.stack([a, a + columns + 1, a + 1], 1)])
    tangents = vertex_tangents(points, faces, points, np.stack([phi / 6, theta / np.pi], -1).reshape(-1, 2))
    expected = np.stack([-np.sin(phi), np.cos(phi), 0 * phi], -1).reshape(-1, 3)
    inner = ((theta > 0.35) & (theta < 2.8) & (phi > 0.1) & (phi < 5.9)).reshape(-1)
    assert np.abs(tangents[inner, :3] - expected[inner]).max() < 0.01
    assert (tangents[:, 3] == 1).all()
    assert np.abs((tangents[:, :3] * points).sum(axis=1)).max() < 1e-6
    assert np.linalg.norm(tangents[:, :3], axis=1) == pytest.approx(1, abs=1e-6)


def test_corners_weigh_by_their_angle():
    """Two triangles about vertex 0 in one plane, 90 and 30 degrees, whose u run along +x and +y."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-s, c, 0]])
    uv = np.array([[0, 0], [1, 0], [0, -1], [-1, -1]], float)
    tangents = vertex_tangents(vertices, np.array([[0, 1, 2], [0, 2, 3]]), UP, uv)
    # d position / d u of the second: p = a e1 + b e2 with uv = a (0, -1) + b (-1, -1), so u = -b and v = -a - b
    second = np.array([0, 1, 0]) - np.array([-s, c, 0])
    expected = np.pi / 2 * np.array([1, 0, 0]) + np.pi / 6 * second / np.linalg.norm(second)
    assert tangents[0, :3] == pytest.approx(expected / np.linalg.norm(expected), abs=1e-6)


def test_no_texture_area_still_gives_a_frame():
    tangents = vertex_tangents(QUAD, FACES, UP, np.zeros((4, 2)))
    assert np.isfinite(tangents).all()
    assert (tangents[:, 2] == 0).all() and np.linalg.norm(tangents[:, :3], axis=1) == pytest.approx(1)
