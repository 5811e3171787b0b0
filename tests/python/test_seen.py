"""What photos show of a mesh, and the cap over what they do not show."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
import trimesh
from splitnerf.export.simplify import capped, is_closed
from splitnerf.export.textured import textured_asset
from splitnerf.render.seen import GRAZING, Cameras, majority, seen_vertices
from test_export_parts import ball

DISTANCE = 3.0


def from_above(focal: float = 100.0, centre: tuple[float, float] = (50.0, 50.0), size: tuple[int, int] = (100, 100)):
    """A camera on the z axis that looks down."""
    pose = torch.eye(4)
    pose[2, 3] = DISTANCE
    return Cameras(pose[None], torch.tensor([[focal, focal, *centre]]), torch.tensor([size]))


def sphere(radius: float, height: float = 0.0) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(4, radius).apply_translation([0, 0, height])


def seen(mesh: trimesh.Trimesh, cameras: Cameras) -> np.ndarray:
    return seen_vertices(np.float32(mesh.vertices), np.int32(mesh.faces), cameras, 1e-3)


def test_a_camera_sees_the_cap_of_a_sphere():
    """Those whose normal is within acos(GRAZING) of the line to the camera; the mesh's own faces are left a margin."""
    mesh = sphere(1.0)
    to_camera = np.array([0, 0, DISTANCE]) - mesh.vertices
    cosine = (to_camera * mesh.vertices).sum(1) / np.linalg.norm(to_camera, axis=1)
    found = seen(mesh, from_above())
    assert found[cosine > GRAZING + 0.03].all() and not found[cosine < GRAZING - 0.03].any()


def test_a_photo_shows_what_lies_in_its_frame():
    """Its height and width are not equal, and x = 50 is half of its width only."""
    mesh = sphere(0.5)
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
    mesh = sphere(0.5)
    half, whole = from_above(size=(100, 51)), from_above()
    for first, second in ((half, whole), (whole, half)):
        both = Cameras(*(torch.cat(parts) for parts in zip(first, second)))
        assert np.array_equal(seen(mesh, both), seen(mesh, whole))
    assert seen(mesh, half).sum() < 0.7 * seen(mesh, whole).sum()


def test_what_another_body_hides_is_not_seen():
    hidden, roof = sphere(0.3, -0.5), sphere(0.6, 0.5)
    found = seen(hidden + roof, from_above())
    assert not found[: len(hidden.vertices)].any() and found[len(hidden.vertices) :].any()


def test_one_ray_that_slips_through_shows_nothing():
    mesh = sphere(1.0)
    half, one = mesh.vertices[:, 2] > 0.1, np.arange(len(mesh.vertices)) == 500
    assert not majority(mesh.faces, one).any() and majority(mesh.faces, ~one).all()
    assert (majority(mesh.faces, half) == half).mean() > 0.99


def test_behind_a_camera_nothing_is_seen():
    pose = torch.eye(4)
    pose[2, 3] = -DISTANCE  # looks down, away from the sphere
    assert not seen(
        sphere(0.5), from_above(focal=1e-4)._replace(poses=pose[None])
    ).any()  # so wide that it would show all


def test_a_flat_rim_gets_a_flat_cap():
    """The lower half of a sphere, below the rim at z = -0.2: it becomes the disc, and what is seen stays."""
    mesh = sphere(1.0)
    rim = mesh.vertices[:, 2] > -0.2
    vertices = mesh.vertices.copy()
    edge = rim & np.isin(np.arange(len(rim)), mesh.edges[~rim[mesh.edges].all(1)])
    vertices[edge, 2] = -0.2
    moved, stays = capped(np.float32(vertices), mesh.faces, rim)
    assert np.array_equal(stays, rim)
    assert np.array_equal(moved[rim], np.float32(vertices)[rim])
    assert moved[~rim, 2] == pytest.approx(-0.2, abs=1e-4)
    disc = trimesh.Trimesh(moved, mesh.faces, process=False)
    expected = np.pi * (2 / 3 + 0.2 - 0.2**3 / 3)  # of the segment above the plane
    assert is_closed(mesh.faces) and disc.volume == pytest.approx(expected, rel=0.03)


def test_bodies_that_no_photo_shows_stay():
    mesh = sphere(0.5) + sphere(0.5, 2.0)
    n = len(mesh.vertices) // 2
    flags = np.arange(2 * n) < n
    for seen in (flags, ~flags | flags, flags & False):
        moved, stays = capped(np.float32(mesh.vertices), mesh.faces, seen)
        assert np.array_equal(moved, np.float32(mesh.vertices)) and stays.all()


def test_a_cap_keeps_its_places_and_normals():
    """The field's level set lies near it, but a cap is no part of it: no vertex moves there, no normal leans, and its
    albedo is that of its rim, at z = 0."""
    mesh = sphere(0.82)
    surface = ball()

    def leaning(x: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return 0.5 + 0.5 * x[:, 2:].expand(-1, 3), *surface.materials(x)[1:3], surface.gradient(x)[1]

    found = textured_asset(
        "ball",
        np.float32(mesh.vertices),
        np.int32(mesh.faces),
        dataclasses.replace(surface, materials=leaning),
        n_faces=0,
        texture_size=128,
        spacing=0.05,
        occlusion_offset=0.01,
        on_surface=mesh.vertices[:, 2] > 0,
    ).asset
    radius, up = np.linalg.norm(found.vertices, axis=1), found.vertices[:, 2]
    assert radius[up > 0.1] == pytest.approx(0.8, abs=1e-4) and radius[up < -0.01] == pytest.approx(0.82, abs=1e-6)
    tilt = (found.normals * found.vertices).sum(1) / radius
    assert tilt[up < -0.1].min() > 0.999 and tilt[up > 0.1].min() < 0.97
    row, column = (np.clip((found.uv * 128).astype(int), 0, 127)).T[::-1]
    flat = found.materials[0].normal_texture[row, column, 2]
    assert flat[up < -0.2].min() > 0.999
    albedo = found.materials[0].albedo_texture[row, column]
    assert albedo[up < -0.2] == pytest.approx(0.5, abs=0.06) and albedo[up > 0.5].min() > 0.7
