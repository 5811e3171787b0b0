"""The surface of a training as a mesh, made at once or beside the training."""

import threading

import numpy as np
import pytest
import torch
import trimesh
from splitnerf.config import preset
from splitnerf.render.model import SceneModel
from splitnerf.training import meshes
from splitnerf.training.meshes import SurfaceMesh

SMALL = {"n_levels": 2, "start_levels": 2, "log2_table_size": 8, "mesh_resolution": 24, "light_resolution": 16}


@pytest.fixture
def model() -> SceneModel:
    torch.manual_seed(0)
    return SceneModel(preset("cpu").replace(SMALL))


def test_a_mesh_is_the_surface_in_the_whole_box_at_its_resolution():
    """A ball that reaches beyond 1, closed, faces outward; triangles as large as cells of 24 nodes along an edge."""
    torch.manual_seed(0)
    model = SceneModel(preset("cpu").replace(SMALL | {"sphere_radius": 1.2, "box": 1.6}))
    mesh = SurfaceMesh(model)
    mesh.request(0.1)
    shape = trimesh.Trimesh(mesh.current.vertices.numpy(), mesh.current.faces.numpy(), process=False)
    assert shape.is_watertight and model.sdf_field.sdf(mesh.current.vertices).abs().max() < 0.02
    assert 5.0 < shape.volume < 10.0 and 1.2 < mesh.current.vertices.abs().max() < 1.6
    cell = 2 * 1.6 / 23
    assert np.sqrt(2) * cell < shape.edges_unique_length.max() < np.sqrt(3) * cell
    assert mesh.scene is mesh.current.scene and len(model.bits.cache.vertices) == len(shape.vertices)


@pytest.mark.parametrize("background", [False, True])
def test_a_mesh_is_traced_where_the_light_is_when_it_is_asked_for(model, background):
    mesh = SurfaceMesh(model, background=background)
    before = model.cells.centres
    for progress in (0.1, 0.2):
        with torch.no_grad():
            model.light.texels.normal_()
        mesh.request(progress)
        mesh.poll(wait=True)
        found = model.bits.cache.directions
        assert torch.equal(found, model.aims()) and not torch.equal(found, before)
        before = found


def test_a_mesh_made_beside_is_that_of_the_moment_it_was_asked_for(model, monkeypatch):
    at_once = SurfaceMesh(model)
    at_once.request(0.1)
    begun, make = threading.Event(), meshes.make_mesh
    monkeypatch.setattr(meshes, "make_mesh", lambda *args: (begun.wait(10), make(*args))[1])
    beside = SurfaceMesh(model, background=True)
    beside.request(0.2)
    with torch.no_grad():
        model.sdf_field.out_bias[0] += 0.3  # the surface moves on
        model.sdf_field.grid.table += 0.1
    beside.request(0.3)  # one is being made
    beside.poll()
    assert beside.current is None and beside.asked_at == 0.2
    before = {name: beside.state()[name] for name in ("mesh_vertices", "mesh_faces", "meshed_at")}
    assert before == {"mesh_vertices": None, "mesh_faces": None, "meshed_at": 0.0}
    begun.set()
    beside.poll(wait=True)
    assert beside.made_at == 0.2
    for ours, theirs in zip(beside.current[1:3], at_once.current[1:3]):
        assert torch.equal(ours, theirs)
    assert torch.equal(beside.current.bits.cache.bits, at_once.current.bits.cache.bits)
    assert model.has_mesh and torch.equal(model.bits.cache.vertices, beside.current.vertices)


@pytest.mark.parametrize("background", [False, True])
def test_without_a_surface_the_old_mesh_stays(model, background):
    mesh = SurfaceMesh(model, background=background)
    mesh.request(0.1)
    mesh.poll(wait=True)
    before = mesh.current
    with torch.no_grad():
        model.sdf_field.out_bias[0] = 10.0
    mesh.request(0.2)
    mesh.poll(wait=True)
    assert mesh.made_at == 0.2 and before is not None and mesh.current is before


def test_what_goes_wrong_beside_is_told(model):
    with torch.no_grad():
        model.sdf_field.out_bias[0] = torch.nan
    mesh = SurfaceMesh(model, background=True)
    mesh.request(0.1)
    with pytest.raises(RuntimeError, match="not finite"):
        mesh.poll(wait=True)
    assert mesh.current is None
