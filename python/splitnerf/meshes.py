"""The surface of a training as a mesh: made anew from time to time, at once or beside the training."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.export.meshing import EmptyMesh, extract_mesh
from splitnerf.fields import VisibilityBits
from splitnerf.fields.visibility import TracedBits
from splitnerf.ops import MeshScene, SdfNetwork, sdf_values
from splitnerf.render.model import SceneModel


class TracedMesh(NamedTuple):
    """A mesh, ready to be traced, and what its vertices see where the model keeps that.

    Attributes:
        scene: The mesh below.
        vertices, faces: [n, 3] float32 and [m, 3] int32, on the CPU.
        bits: Of its vertices; None where occlusion is not cached.
    """

    scene: MeshScene
    vertices: Tensor
    faces: Tensor
    bits: TracedBits | None


class SurfaceMesh:
    """The newest mesh of a model's surface.

    Args:
        model: Uses each mesh as soon as it is there.
        background: Meshes are made by a thread of their own while the caller goes on: it reads a copy of the field, traces on
            the processor's cores, and :meth:`arrive` hands the mesh over.

    Attributes:
        current: The mesh in use; None before the first.
    """

    def __init__(self, model: SceneModel, *, background: bool = False):
        self.model, self.current = model, None
        self._pool = ThreadPoolExecutor(1, "mesh") if background else None
        self._made: Future[TracedMesh | None] | None = None

    @property
    def scene(self) -> MeshScene | None:
        """What rays are traced through."""
        return self.current.scene if self.current else None

    def renew(self) -> None:
        """Makes a mesh of the surface as it is now; beside the caller's work where that was asked for, unless one is
        being made. The old one stays while the field has no surface.

        Raises:
            RuntimeError: The field is not finite.
        """
        if self._pool is None:
            self._use(make_mesh(self.model, self.model.sdf_field.network()))
        elif self._made is None:
            self._made = self._pool.submit(make_mesh, self.model, self.model.sdf_field.network().snapshot())

    def arrive(self, wait: bool = False) -> None:
        """Uses a mesh that was made beside the caller's work, if it is done, or waits for it.

        Raises:
            RuntimeError: The field was not finite.
        """
        if self._made is not None and (wait or self._made.done()):
            made, self._made = self._made, None
            self._use(made.result())

    def restore(self, content: dict) -> None:
        """Uses the mesh of a checkpoint, if it has one."""
        if content["mesh_vertices"] is not None:
            self._use(traced(self.model, content["mesh_vertices"], content["mesh_faces"]))

    def state(self) -> dict[str, Tensor | None]:
        """What a checkpoint keeps of it."""
        _, vertices, faces, _ = self.current or (None,) * 4
        return {"mesh_vertices": vertices, "mesh_faces": faces}

    def close(self) -> None:
        """Ends the thread; a mesh that is being made is lost."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def _use(self, mesh: TracedMesh | None) -> None:
        if mesh is not None:
            self.current = mesh
            self.model.use_mesh(*mesh)


def make_mesh(model: SceneModel, network: SdfNetwork) -> TracedMesh | None:
    """The zero level set of a field, traced; None where it is empty. Of the model only constants are read.

    Raises:
        RuntimeError: The field is not finite.
    """
    try:
        vertices, faces = extract_mesh(distances(network), model.config.box, model.config.mesh_resolution)
    except EmptyMesh:
        return None
    return traced(model, torch.from_numpy(vertices), torch.from_numpy(faces))


def traced(model: SceneModel, vertices: Tensor, faces: Tensor) -> TracedMesh:
    """A mesh with the bits of its vertices, where the model reads such."""
    scene = MeshScene(vertices.numpy(), faces.numpy())
    bits = model.occlusion.traced(scene, vertices, faces) if isinstance(model.occlusion, VisibilityBits) else None
    return TracedMesh(scene, vertices, faces, bits)


def distances(network: SdfNetwork) -> Callable[[Tensor], Tensor]:
    """The field as a function of points [n, 3] on the CPU, wherever it is computed."""
    return lambda points: sdf_values(points.to(network.table.device), network).cpu()
