"""The surface of a training as a mesh, made at once or beside the training."""

from __future__ import annotations

import threading
from contextlib import contextmanager

import numpy as np
import pytest
import torch
import trimesh
from pretend_gpu import GPU, pretend_gpu
from splitnerf.config import preset
from splitnerf.fields.occlusion import TracedBits
from splitnerf.ops import SdfNetwork
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
    assert mesh.scene is mesh.current.scene and len(model.occlusion.cache.vertices) == len(shape.vertices)


def content_of(mesh: SurfaceMesh) -> dict:
    """What a checkpoint holds of a mesh."""
    return mesh.state() | {"occlusion_light": mesh.model.occlusion.cached_light()}


def test_a_mesh_comes_back_as_it_was_stored(model):
    """Traced where the light of then was, not that of the other model."""
    with torch.no_grad():
        model.light.texels.normal_()
    stored = SurfaceMesh(model)
    nothing = content_of(stored)
    stored.request(0.3)
    torch.manual_seed(1)
    other = SceneModel(model.config)
    restored = SurfaceMesh(other)
    restored.restore(nothing)
    assert restored.current is None and not other.occlusion.ready
    restored.restore(content_of(stored))
    assert (restored.asked_at, restored.made_at) == (0.3, 0.3) and restored.scene is not None
    assert torch.equal(restored.current.vertices, stored.current.vertices)
    assert torch.equal(restored.current.faces, stored.current.faces)
    assert other.occlusion.ready and torch.equal(other.occlusion.cache.bits, model.occlusion.cache.bits)
    assert torch.equal(other.occlusion.directions, model.occlusion.directions)
    assert not torch.equal(other.occlusion.directions, other.occlusion.centres)


@pytest.mark.parametrize("background", [False, True])
def test_a_mesh_is_traced_where_the_light_is_when_it_is_asked_for(model, background):
    mesh = SurfaceMesh(model, background=background)
    before = model.occlusion.centres
    for progress in (0.1, 0.2):
        with torch.no_grad():
            model.light.texels.normal_()
        mesh.request(progress)
        mesh.poll(wait=True)
        found = model.occlusion.directions.clone()
        model.occlusion.aim(model.evaluate_light())
        assert torch.equal(found, model.occlusion.aims) and not torch.equal(found, before)
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
    assert beside.state() == {"mesh_vertices": None, "mesh_faces": None, "meshed_at": 0.0}
    begun.set()
    beside.poll(wait=True)
    assert beside.made_at == 0.2
    for ours, theirs in zip(beside.current[1:3], at_once.current[1:3]):
        assert torch.equal(ours, theirs)
    assert torch.equal(beside.current.bits.cache.bits, at_once.current.bits.cache.bits)
    assert model.occlusion.ready and torch.equal(model.occlusion.cache.vertices, beside.current.vertices)


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


def test_beside_it_works_in_a_stream_of_its_own_and_brings_the_bits_to_the_device(model, monkeypatch):
    """The copy of the field is made before the stream goes on; the caller's stream waits before the bits are used."""
    with pretend_gpu(monkeypatch):
        told, main = [], threading.current_thread()

        class Noted:
            def __init__(self, name):
                self.name = name

            def wait_stream(self, other):
                told.append(f"{self.name} waits for {other.name}")

        @contextmanager
        def within(stream):
            assert threading.current_thread() is not main
            told.append(f"in {stream.name}")
            yield
            told.append(f"out of {stream.name}")

        monkeypatch.setattr(torch.cuda, "Stream", lambda device: Noted("ours"))
        monkeypatch.setattr(torch.cuda, "current_stream", lambda device: Noted("theirs"))
        monkeypatch.setattr(torch.cuda, "stream", within)
        monkeypatch.setattr(torch.cuda, "synchronize", None)  # the host waits for nothing
        snapshot, moved, use = SdfNetwork.snapshot, TracedBits.to, type(model.occlusion).use
        monkeypatch.setattr(SdfNetwork, "snapshot", lambda self: told.append("copied") or snapshot(self))
        monkeypatch.setattr(TracedBits, "to", lambda self, device: told.append("moved") or moved(self, device))
        monkeypatch.setattr(type(model.occlusion), "use", lambda self, bits: told.append("used") or use(self, bits))
        mesh = SurfaceMesh(model.to("cuda"), background=True)
        mesh.request(0.1)
        mesh.poll(wait=True)
        assert mesh.current is not None and model.occlusion.cache.bits.device == GPU
    made = [
        "copied",
        "ours waits for theirs",
        "in ours",
        "moved",
        "out of ours",
        "theirs waits for ours",
        "used",
        "moved",
    ]
    assert told == made
