"""Parts of the export one by one: strips of a raster, where a small map stands in a large one, normals to fall back on, factors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
import trimesh
from splitnerf.data.asset import Asset, Material, vertex_tangents
from splitnerf.export import bake, writers
from splitnerf.export.bake import bake_occlusion
from splitnerf.export.surface import Surface
from splitnerf.export.textured import vertex_normals
from splitnerf.export.writers import encode_maps


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
        assert (
            normals == torch.tensor([0.0, 0.0, 1.0])
        ).all() and offset == 0.037  # traced off the surface along its normal
        return points[:, :1], None

    monkeypatch.setattr(bake, "occlusion_factors", factors)
    found = bake_occlusion(square(), 64, 0.037)
    x = (np.arange(64) + 0.5) / 64
    np.testing.assert_allclose(found[:, 2:-2], np.broadcast_to(x[2:-2], (64, 60)), atol=1e-3)


def test_charts_between_the_texels_are_refused():
    mesh = dataclasses.replace(square(), uv=square().uv * np.float32(0.01) + np.float32(0.02))
    assert (bake_occlusion(mesh, 8, 0.01) == 1).all()
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
    more, field = np.concatenate([vertices, np.float32([[0, 0.9, 0]])]), np.float32([0.3, 0.9, 0]) / 0.9**0.5
    assert vertex_normals(ball(), more, faces)[-1] == pytest.approx(field, abs=1e-5)  # of no face
    assert vertex_normals(ball(sign=0.0), more, faces)[-1].tolist() == [0, 0, 1]


def textured() -> Asset:
    material = Material("paint", roughness_metallic_texture=np.full((4, 4, 2), 0.25, np.float32))
    return dataclasses.replace(square(), materials=[material])


def test_without_occlusion_all_is_open_and_what_is_not_finite_is_refused():
    asset = textured()
    assert (encode_maps("a", asset, None).orm[..., 0] == 255).all()
    assert (encode_maps("a", asset, np.zeros((4, 4))).orm[..., 0] == 0).all()
    asset.materials[0].roughness_metallic_texture[0, 0, 0] = np.nan
    with pytest.raises(RuntimeError, match="finite"):
        encode_maps("a", asset, None)
