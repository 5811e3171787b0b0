"""Meshing by closed forms, what photos show of a mesh, and the cap over what they do not show."""

import dataclasses
import math

import numpy as np
import pytest
import torch
import trimesh
from splitnerf.export import simplify
from splitnerf.export.meshing import EmptyMesh, extract_mesh
from splitnerf.export.simplify import capped, decimate, drop_floaters_and_cavities, drop_unseen, is_closed
from splitnerf.export.textured import textured_asset
from splitnerf.ops import MeshScene
from splitnerf.render.seen import Cameras, in_view, majority, seen_vertices
from test_bake import ball

RADIUS, DISTANCE = 0.7, 3.0  # of the sphere; of a camera above it
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def sphere(x, radius=RADIUS):
    return x.norm(dim=1) - radius


def torus(x):
    return torch.hypot(torch.hypot(x[:, 0], x[:, 1]) - 0.8, x[:, 2]) - 0.25


def gyroid(x):
    """Far from a distance: its slope varies, and it reaches the border everywhere."""
    a, b = (5.0 * x).sin(), (5.0 * x).cos()
    return 0.15 * (a[:, 0] * b[:, 1] + a[:, 1] * b[:, 2] + a[:, 2] * b[:, 0])


def test_sphere_converges_in_area_and_volume():
    """Second order: halving the cell quarters the errors."""
    errors = []
    for n in (17, 33, 65):
        mesh = trimesh.Trimesh(*extract_mesh(sphere, 1.5, n), process=False)
        assert mesh.is_watertight
        assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - RADIUS).max() < 0.3 * (3 / (n - 1)) ** 2
        errors.append([4 / 3 * math.pi * RADIUS**3 - mesh.volume, 4 * math.pi * RADIUS**2 - mesh.area])
    errors = np.array(errors)
    assert (errors > 0).all()  # chords lie inside
    assert errors[:-1] / errors[1:] == pytest.approx(4, rel=0.25)


def steep(x):
    """Three times steeper than a distance, which hides much of its surface from the test by the centre: the front follows it."""
    return 3.0 * torus(x)


@pytest.mark.parametrize("field", [sphere, torus, gyroid, steep])
@pytest.mark.parametrize("resolution", [31, 48])
def test_narrow_band_gives_the_dense_grid(field, resolution):
    evaluated = 0

    def counting(x):
        nonlocal evaluated
        evaluated += len(x)
        return field(x)

    vertices, faces = extract_mesh(counting, 1.5, resolution)
    in_band, evaluated = evaluated, 0
    dense_vertices, dense_faces = extract_mesh(counting, 1.5, resolution, dense=True)
    assert vertices.dtype == np.float32 and faces.dtype == np.int32 and np.array_equal(faces, dense_faces)
    assert np.abs(vertices - dense_vertices).max() < 1e-5
    assert is_closed(faces)
    assert evaluated == resolution**3
    if field is sphere and resolution == 48:
        assert in_band < 0.3 * evaluated


def test_what_reaches_the_border_is_closed():
    half = trimesh.Trimesh(*extract_mesh(lambda x: x[:, 2], 1.5, 24), process=False)
    assert half.is_watertight and 3**2 * 1.5 < half.volume < 3.3**2 * 1.65  # at most a cell beyond the box
    full = trimesh.Trimesh(*extract_mesh(lambda x: torch.full((len(x),), -9.0), 1.5, 24), process=False)
    assert full.is_watertight and full.euler_number == 2


def test_zeros_at_the_nodes_leave_no_face_without_area():
    vertices, faces = extract_mesh(lambda x: x.abs().amax(dim=1) - 0.75, 1.5, 25)  # nodes every 0.125
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight and mesh.area_faces.min() > 0
    assert mesh.volume == pytest.approx(1.5**3, rel=0.05)  # its edges are cut


def test_no_surface_raises():
    with pytest.raises(EmptyMesh):
        extract_mesh(lambda x: torch.ones(len(x)), 1.5, 16)
    with pytest.raises(RuntimeError, match="not finite"):
        extract_mesh(lambda x: torch.full((len(x),), float("nan")), 1.5, 16)


def test_small_components_go_and_are_counted():
    def three(x):
        far, near = torch.tensor([1.3, 1.3, 1.3]), torch.tensor([-1.2, 0.0, 0.0])
        return torch.minimum(sphere(x), torch.minimum(sphere(x - far, 0.05), sphere(x - near, 0.2)))

    vertices, faces = extract_mesh(three, 1.5, 96)
    # of no face: no component, and gone as well
    vertices = np.concatenate([vertices, np.full((3, 3), 9.0, np.float32)])
    vertices, faces, n_dropped = drop_floaters_and_cavities(vertices, faces)
    assert n_dropped == 1  # the middle one has more than a hundredth of the faces
    assert vertices.max() == pytest.approx(RADIUS, abs=0.01) and vertices[:, 0].min() == pytest.approx(-1.4, abs=0.01)
    assert faces.max() == len(vertices) - 1


def test_a_cavity_goes_and_a_part_beside_stays():
    def hollow(x):
        wall = torch.maximum(sphere(x), -sphere(x, 0.5))
        return torch.minimum(wall, sphere(x - torch.tensor([-1.2, 0.0, 0.0]), 0.2))

    vertices, faces, n_dropped = drop_floaters_and_cavities(*extract_mesh(hollow, 1.5, 96))
    assert n_dropped == 1 and is_closed(faces)
    assert np.linalg.norm(vertices, axis=1).min() == pytest.approx(RADIUS, abs=0.01)
    assert vertices[:, 0].min() == pytest.approx(-1.4, abs=0.01)


def test_faces_that_share_any_vertex_are_one_component():
    """150 that meet in their last corner; two beside them stay, as they are more than a hundredth, and one goes."""
    pairs = np.arange(300).reshape(-1, 2)
    others = [[301, 302, 303], [304, 305, 306], [306, 307, 308]]
    faces = np.concatenate([np.column_stack([pairs, np.full(150, 300)]), others])
    vertices, kept, n_dropped = drop_floaters_and_cavities(np.zeros((309, 3), np.float32), faces)
    assert n_dropped == 1 and len(kept) == 152 and len(vertices) == 306


def test_decimation_keeps_a_thin_shape_closed():
    def handle(x):
        return torch.hypot(torch.hypot(x[:, 0], x[:, 1]) - 0.9, x[:, 2]) - 0.045

    vertices, faces = extract_mesh(handle, 1.5, 128)
    light_vertices, light_faces = decimate(vertices, faces, 1500)
    assert is_closed(faces) and is_closed(light_faces)
    assert 1400 <= len(light_faces) <= 1500
    assert trimesh.Trimesh(light_vertices, light_faces, process=False).euler_number == 0
    for n_faces in (0, len(faces), 10**7):
        assert len(decimate(vertices, faces, n_faces)[1]) == len(faces)


def test_closed_means_each_edge_once_in_each_direction():
    faces = TETRAHEDRON
    assert is_closed(faces) and not is_closed(faces[:3])
    assert not is_closed(np.concatenate([faces[:3], faces[3:, ::-1]]))
    assert not is_closed(np.concatenate([faces, faces]))


@pytest.mark.parametrize("n_shared", [1, 2])
def test_parts_that_touch_are_split(n_shared):
    """Two tetrahedra that share a vertex or an edge become two closed ones, though a face is turned over; what is sound stays."""
    vertices = np.random.default_rng(0).normal(size=(8 - n_shared, 3)).astype(np.float32)
    other = np.where(TETRAHEDRON < n_shared, TETRAHEDRON, TETRAHEDRON + 4 - n_shared)
    for turned in (None, 0, 3, 5) if n_shared == 1 else (None,):
        faces = np.stack([TETRAHEDRON, other], axis=1).reshape(-1, 3)  # in turn, so that no order tells them apart
        if turned is not None:
            faces[turned] = faces[turned, ::-1]
        split_vertices, split_faces = simplify.split_pinches(vertices, faces)
        assert len(split_vertices) == 8 and is_closed(split_faces) == (turned is None)
        np.testing.assert_array_equal(split_vertices[split_faces], vertices[faces])
        assert len(simplify.split_pinches(split_vertices, split_faces)[0]) == 8


def test_decimation_parts_what_touches_and_drops_sheets_without_volume(monkeypatch):
    """Two tetrahedra that share an edge, and a pair of faces with the same three vertices: closed, at once, without the pair."""
    other = np.where(TETRAHEDRON < 2, TETRAHEDRON, TETRAHEDRON + 2)
    vertices = np.random.default_rng(0).normal(size=(12, 3)).astype(np.float32)
    simplified = vertices, np.concatenate([TETRAHEDRON, other, [[0, 7, 8], [8, 7, 0]]])
    monkeypatch.setattr(simplify.fast_simplification, "simplify", lambda *_, **__: simplified)
    points, faces = decimate(vertices, np.concatenate([TETRAHEDRON] * 50), 100)
    assert len(points) == 8 and len(faces) == 8 and is_closed(faces)
    np.testing.assert_array_equal(points[faces], vertices[np.concatenate([TETRAHEDRON, other])])


@pytest.mark.parametrize("left", [[60, 30], [60, 60]])
def test_decimation_tries_again_where_many_faces_are_left_and_says_so(left, monkeypatch, capsys):
    """Tetrahedra apart, of which 30 are asked for."""
    faces = (4 * np.arange(60)[:, None, None] + TETRAHEDRON).reshape(-1, 3)
    vertices = np.random.default_rng(0).normal(size=(240, 3)).astype(np.float32)
    counts = iter(left + [60] * 7)
    monkeypatch.setattr(
        simplify.fast_simplification, "simplify", lambda *_, **__: (vertices, faces[: 4 * next(counts)])
    )
    assert len(decimate(vertices, np.concatenate([faces, faces]), 120)[1]) == 4 * min(left)
    assert ("keeps 240 faces where 120 were asked for" in capsys.readouterr().err) == (min(left) == 60)


# ---- what photos show ----


def from_above(focal: float = 100.0, centre: tuple[float, float] = (50.0, 50.0), size: tuple[int, int] = (100, 100)):
    """A camera on the z axis that looks down."""
    pose = torch.eye(4)
    pose[2, 3] = DISTANCE
    return Cameras(pose[None], torch.tensor([[focal, focal, *centre]]), torch.tensor([size]))


def round_body(radius: float, height: float = 0.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(4, radius).apply_translation([0, 0, height])


def seen(mesh: trimesh.Trimesh, cameras: Cameras) -> np.ndarray:
    return seen_vertices(np.float32(mesh.vertices), np.int32(mesh.faces), cameras, 1e-3)


def test_a_camera_sees_the_cap_of_a_sphere():
    """Those whose normal is within acos(0.05) of the line to the camera; the mesh's own faces are left a margin."""
    mesh = round_body(1.0)
    to_camera = np.array([0, 0, DISTANCE]) - mesh.vertices
    cosine = (to_camera * mesh.vertices).sum(1) / np.linalg.norm(to_camera, axis=1)
    found = seen(mesh, from_above())
    assert found[cosine > 0.08].all() and not found[cosine < 0.02].any()


@pytest.mark.parametrize("offset", [1e-3, 0.1])
def test_a_point_is_seen_where_it_is_however_far_off_its_ray_begins(offset):
    """At a distance of 2 from the camera and 0.6 from its axis: 100 0.6 / 2 pixels from the middle."""
    point, (camera,) = torch.tensor([[0.6, 0.0, 1.0]]), zip(*from_above())
    body = round_body(0.5)
    scene = MeshScene(np.float32(body.vertices), np.int32(body.faces))
    found = in_view(scene, point, torch.tensor([[1.0, 0.0, 0.0]]), camera, offset, -1.0)
    assert found.at.tolist() == [[pytest.approx(80.0), pytest.approx(50.0)]]
    assert found.distance.item() == pytest.approx(math.hypot(0.6, 2.0)) and found.rows.tolist() == [0]


def test_a_photo_shows_what_lies_in_its_frame():
    """Its height and width are not equal, and x = 50 is half of its width only."""
    mesh = round_body(0.5)
    x, y, z = mesh.vertices.T
    top = z > 0.3
    for camera, visible, hidden in (
        (from_above(centre=(0.0, 50.0)), x > 0.02, x < -0.02),  # from x = 0 on to the right
        (from_above(centre=(50.0, 0.0)), y < -0.02, y > 0.02),  # from y = 0 downwards
        (from_above(centre=(50.0, 75.0), size=(150, 51)), x < 0.02, x > 0.1),
    ):
        found = seen(mesh, camera)
        assert found[top & visible].all() and not found[top & hidden].any()


def test_each_photo_has_a_frame_of_its_own():
    mesh = round_body(0.5)
    half, whole = from_above(size=(100, 51)), from_above()
    for first, second in ((half, whole), (whole, half)):
        both = Cameras(*(torch.cat(parts) for parts in zip(first, second)))
        assert np.array_equal(seen(mesh, both), seen(mesh, whole))
    assert seen(mesh, half).sum() < 0.7 * seen(mesh, whole).sum()


def test_what_another_body_hides_is_not_seen():
    hidden, roof = round_body(0.3, -0.5), round_body(0.6, 0.5)
    found = seen(hidden + roof, from_above())
    assert not found[: len(hidden.vertices)].any() and found[len(hidden.vertices) :].any()


def test_one_ray_that_slips_through_shows_nothing():
    mesh = round_body(1.0)
    half, one = mesh.vertices[:, 2] > 0.1, np.arange(len(mesh.vertices)) == 500
    assert not majority(mesh.faces, one).any() and majority(mesh.faces, ~one).all()
    assert (majority(mesh.faces, half) == half).mean() > 0.99
    for flags in np.array([[1, 1, 0, 0, 0], [0, 1, 1, 1, 0]], bool):  # as many for it as against it: it stays
        assert majority(np.array([[0, 1, 2], [0, 3, 4]]), flags)[0] == flags[0]


def test_behind_a_camera_nothing_is_seen():
    pose = torch.eye(4)
    pose[2, 3] = -DISTANCE  # looks down, away from the sphere
    # so wide that it would show all
    assert not seen(round_body(0.5), from_above(focal=1e-4)._replace(poses=pose[None])).any()


def test_a_flat_rim_gets_a_flat_cap():
    """The lower half of a sphere, below the rim at z = -0.2: it becomes the disc, and what is seen stays."""
    mesh = round_body(1.0)
    rim = mesh.vertices[:, 2] > -0.2
    vertices = mesh.vertices.copy()
    edge = rim & np.isin(np.arange(len(rim)), mesh.edges[~rim[mesh.edges].all(1)])
    vertices[edge, 2] = -0.2
    moved, _, stays = capped(np.float32(vertices), mesh.faces, rim)
    assert np.array_equal(stays, rim)
    assert np.array_equal(moved[rim], np.float32(vertices)[rim])
    assert moved[~rim, 2] == pytest.approx(-0.2, abs=1e-4)
    disc = trimesh.Trimesh(moved, mesh.faces, process=False)
    expected = np.pi * (2 / 3 + 0.2 - 0.2**3 / 3)  # of the segment above the plane
    assert is_closed(mesh.faces) and disc.volume == pytest.approx(expected, rel=0.03)


def test_what_lies_behind_a_narrow_hole_is_cut_out():
    """A hollow ball with a hole of radius 0.1 becomes a solid one, which the simplification can bring to any number of faces: of a
    wall that is folded into the hole it could not."""
    half = np.linspace(0.1, np.pi, 200)[:, None]
    wall = np.concatenate([np.sin(half), -np.cos(half)], axis=1)
    mesh = trimesh.creation.revolve([*wall, *0.9 * wall[::-1]], sections=200)
    outside = np.linalg.norm(mesh.vertices, axis=1) > 0.95
    vertices, faces, stays = capped(np.float32(mesh.vertices), mesh.faces, outside)
    assert is_closed(faces) and stays.sum() == outside.sum() and len(vertices) == outside.sum() + 1
    for found, n_faces in (((vertices, faces), len(faces)), (decimate(vertices, faces, 4000), 4000)):
        assert len(found[1]) <= n_faces
        assert trimesh.Trimesh(*found).volume == pytest.approx(4 / 3 * np.pi, rel=5e-3)


def test_a_body_that_no_photo_shows_goes():
    """Or of which an eleventh is shown, but not a ninth. Where nothing is shown at all, all stays, and nothing becomes a cap."""
    mesh = round_body(0.5) + round_body(0.5, 2.0)
    n = len(mesh.vertices) // 2
    number = np.arange(2 * n)
    for shown, left in ((n, 1), (n + n // 11, 1), (n + n // 9, 2), (2 * n, 2), (0, 2)):
        vertices, faces, seen, dropped = drop_unseen(np.float32(mesh.vertices), mesh.faces, number < shown)
        assert (len(vertices), len(faces), dropped) == (left * n, left * len(mesh.faces) // 2, 2 - left)
        assert np.array_equal(vertices, np.float32(mesh.vertices[: left * n])) and is_closed(faces)
        assert np.array_equal(seen, number[: left * n] < shown)
    moved, _, stays = capped(vertices, faces, seen)
    assert np.array_equal(moved, vertices) and stays.all()


def test_a_cap_keeps_its_places_and_normals():
    """The field's level set lies near it, but a cap is no part of it: no vertex moves there, no normal leans, and its
    albedo is that of its rim, at z = 0."""
    mesh = round_body(0.82)
    surface = ball()

    def leaning(x: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return 0.5 + 0.5 * x[:, 2:].expand(-1, 3), *surface.materials(x)[1:3], surface.gradient(x)[1]

    vertices, faces = np.float32(mesh.vertices), np.int32(mesh.faces)
    leans = dataclasses.replace(surface, materials=leaning)
    sizes = {"n_faces": 0, "texture_size": 128, "spacing": 0.0125, "occlusion_offset": 0.01}
    found, *_ = textured_asset("ball", vertices, faces, leans, **sizes, on_surface=mesh.vertices[:, 2] > 0)
    radius, up = np.linalg.norm(found.vertices, axis=1), found.vertices[:, 2]
    assert radius[up > 0.1] == pytest.approx(0.8, abs=1e-4) and radius[up < -0.01] == pytest.approx(0.82, abs=1e-6)
    tilt = (found.normals * found.vertices).sum(1) / radius
    assert tilt[up < -0.1].min() > 0.999 and tilt[up > 0.1].min() < 0.97
    row, column = (np.clip((found.uv * 128).astype(int), 0, 127)).T[::-1]
    flat = found.materials[0].normal_texture[row, column, 2]
    assert flat[up < -0.2].min() > 0.999
    albedo = found.materials[0].albedo_texture[row, column]
    assert albedo[up < -0.2] == pytest.approx(0.5, abs=0.06) and albedo[up > 0.5].min() > 0.7
