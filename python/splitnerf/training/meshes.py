"""The surface of a training as a mesh: made anew from time to time, at once or beside the training."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.devices import wait_for
from splitnerf.export.meshing import EmptyMesh, extract_mesh
from splitnerf.fields.visibility import TracedBits
from splitnerf.ops import MeshScene, SdfNetwork, sdf_values
from splitnerf.render.model import SceneModel


class TracedMesh(NamedTuple):
    """A mesh through which rays can be traced, and what its vertices see.

    Attributes:
        scene: The mesh below.
        vertices, faces: [n, 3] float32 and [m, 3] int32, on the CPU.
        bits: What the vertices see; None where occlusion is not cached.
    """

    scene: MeshScene
    vertices: Tensor
    faces: Tensor
    bits: TracedBits | None


class SurfaceMesh:
    """The newest mesh of a model's surface.

    Args:
        model: Uses each mesh as soon as it is there.
        background: Whether a thread of its own makes the meshes while the caller goes on. The thread reads a copy of the field
            and traces on the processor's cores; :meth:`poll` takes the mesh over. The thread ends with the program.

    Attributes:
        current: The mesh in use; None before the first.
        made_at: The progress of the training whose surface that is.
        asked_at: The same of the newest that was asked for.
    """

    def __init__(self, model: SceneModel, *, background: bool = False):
        self.model, self.background, self.current = model, background, None
        self.made_at = self.asked_at = 0.0
        self._made: Future[TracedMesh | None] | None = None

    @property
    def scene(self) -> MeshScene | None:
        """What rays are traced through."""
        return self.current.scene if self.current else None

    def request(self, progress: float) -> None:
        """Makes a mesh of the surface as it is now; beside the caller's work where that was asked for, unless one is
        being made. The old one stays while the field has no surface.

        Raises:
            RuntimeError: The field is not finite.
        """
        if self._made is not None:
            return
        self.asked_at, network = progress, self.model.sdf_field.network()
        if not self.background:
            self._use(make_mesh(self.model, network))
            return
        network = network.snapshot()
        wait_for(self.model.device)  # the thread's work has a queue of its own
        self._made = Future()
        threading.Thread(target=fulfil, args=(self._made, make_mesh, self.model, network), daemon=True).start()

    def poll(self, wait: bool = False) -> None:
        """Uses a mesh that was made beside the caller's work, if it is done, or waits for it.

        Raises:
            RuntimeError: The field was not finite.
        """
        if self._made is not None and (wait or self._made.done()):
            made, self._made = self._made, None
            self._use(made.result())

    def restore(self, content: dict) -> None:
        """Uses the mesh of a checkpoint, if it has one."""
        self.asked_at = content["meshed_at"]
        stored = content["mesh_vertices"], content["mesh_faces"]
        self._use(None if stored[0] is None else traced(self.model, *stored))

    def state(self) -> dict[str, Tensor | float | None]:
        """What a checkpoint keeps of it."""
        _, vertices, faces, _ = self.current or (None,) * 4
        return {"mesh_vertices": vertices, "mesh_faces": faces, "meshed_at": self.made_at}

    def _use(self, mesh: TracedMesh | None) -> None:
        self.made_at = self.asked_at
        if mesh is not None:
            self.current = mesh
            self.model.use_mesh(mesh.bits)


def fulfil(future: Future, function: Callable, *args: object) -> None:
    """Calls a function for somebody who waits for what it returns or raises."""
    try:
        future.set_result(function(*args))
    except BaseException as error:  # is raised where it is waited for
        future.set_exception(error)


def make_mesh(model: SceneModel, network: SdfNetwork) -> TracedMesh | None:
    """The zero level set of a field, traced; None where it is empty. Of the model only constants are read.

    Raises:
        RuntimeError: The field is not finite.
    """
    try:
        vertices, faces = extract_mesh(distances(network), model.config.surface.box, model.config.mesh.resolution)
    except EmptyMesh:
        return None
    return traced(model, torch.from_numpy(vertices), torch.from_numpy(faces))


def traced(model: SceneModel, vertices: Tensor, faces: Tensor) -> TracedMesh:
    """A mesh with what the model's occlusion keeps of it."""
    scene = MeshScene(vertices.numpy(), faces.numpy())
    return TracedMesh(scene, vertices, faces, model.occlusion.trace(scene, vertices, faces))


def distances(network: SdfNetwork) -> Callable[[Tensor], Tensor]:
    """The field as a function of points [n, 3] on the CPU, wherever it is computed."""
    return lambda points: sdf_values(points.to(network.table.device), network).cpu()
