"""The surface of a training as a mesh, renewed from time to time, in the training's thread or in another."""

from __future__ import annotations

from concurrent.futures import Future
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.devices import SideStream, in_background
from splitnerf.export.meshing import EmptyMesh, extract_mesh
from splitnerf.fields import EvaluatedLight, VisibilityBits
from splitnerf.ops import MeshScene
from splitnerf.ops.sdf import SdfNetwork, sdf_values
from splitnerf.render.model import SceneModel

ENVIRONMENT_EVERY = 16  # steps between refreshes of the light that weighs the occlusion


class TracedMesh(NamedTuple):
    """A mesh through which rays can be traced, and what its vertices see."""

    scene: MeshScene  # the mesh, ready to be traced
    vertices: Tensor  # [n, 3] float32, on the CPU like faces, [m, 3] int32
    faces: Tensor
    bits: VisibilityBits | None  # the visibility of the vertices; None where occlusion is not cached


class SurfaceMesh:
    """The newest mesh of a model's surface.

    Args:
        model: The scene; it uses each mesh as soon as the mesh is ready.
        background: Whether a thread makes the meshes while the caller continues. The thread reads a copy of the field,
            in a CUDA stream of its own, traces on the CPU, and brings the bits to the model's device; :meth:`poll`
            takes over the mesh. The thread ends with the program.

    Attributes:
        current: The mesh in use; None before the first.
        made_at: The training's progress in [0, 1] at the request for the mesh in use.
        asked_at: The training's progress in [0, 1] at the newest request.
        environment: [h, 2h, 3] linear radiance that weighs the traced occlusion; None where none is traced, or before the
            first mesh.
    """

    def __init__(self, model: SceneModel, *, background: bool = False):
        self.model, self.background, self.current = model, background, None
        self.made_at = self.asked_at = 0.0
        self.environment: Tensor | None = None
        self._made: Future[TracedMesh | None] | None = None
        self._side = SideStream(model.device)

    @property
    def scene(self) -> MeshScene | None:
        """The scene that rays are traced through; None before the first mesh."""
        return self.current.scene if self.current else None

    def request(self, progress: float) -> None:
        """Makes a mesh of the current surface. With ``background`` the thread makes it, unless it is still busy with an earlier
        mesh. The old mesh stays in use while the field has no surface. Raises RuntimeError where the field is not finite."""
        if self._made is not None:
            return
        self.asked_at, network, aims = progress, self.model.sdf_field.network(), self.model.aims()
        if not self.background:
            self._use(make_mesh(self.model, network, aims))
            return
        network = network.snapshot()
        self._side.follow()
        self._made = in_background(make_beside, self._side, self.model, network, aims)

    def poll(self, wait: bool = False) -> None:
        """Uses the mesh of the thread if it is ready; with ``wait``, waits for it. Raises RuntimeError where the field was not
        finite."""
        if self._made is not None and (wait or self._made.done()):
            made, self._made = self._made, None
            mesh = made.result()
            self._side.join()
            self._use(mesh)

    def light_up(self, light: EvaluatedLight, step: int) -> None:
        """Brings the light on the mesh up to date, where that is due in a step: what weighs its occlusion, and its indirect
        light."""
        c, model = self.model.config, self.model
        if self.current is None:
            return
        if c.occlusion.kind == "mlp" and c.losses.occlusion_weight > 0:
            if self.environment is None or step % ENVIRONMENT_EVERY == 0:
                self.environment = model.light.panorama(c.constants.occlusion_environment_height)
        if step % ENVIRONMENT_EVERY == 0:
            model.weigh_occlusion(light)
        if c.occlusion.indirect and step % c.constants.indirect_every == 0:
            model.refresh_indirect(light)

    def restore(self, content: dict) -> None:
        """Uses the mesh of a checkpoint, if it has one."""
        self.asked_at = content["meshed_at"]
        if (environment := content["environment"]) is not None:
            self.environment = environment.to(self.model.device)
        mesh, light = (content["mesh_vertices"], content["mesh_faces"]), content["occlusion_light"]
        self._use(None if mesh[0] is None else traced(self.model, *mesh, light.get("aims")))
        if light:
            self.model.bits.restore(light)

    def state(self) -> dict[str, Tensor | float | dict | None]:
        """The part of the state that a checkpoint stores."""
        _, vertices, faces, _ = self.current or (None,) * 4
        light = {} if self.model.bits is None else self.model.bits.state()
        return {
            "mesh_vertices": vertices,
            "mesh_faces": faces,
            "meshed_at": self.made_at,
            "environment": self.environment,
            "occlusion_light": light,
        }

    def _use(self, mesh: TracedMesh | None) -> None:
        self.made_at = self.asked_at
        if mesh is not None:
            self.current = mesh
            self.model.use_mesh(mesh.bits)


def make_mesh(model: SceneModel, network: SdfNetwork, aims: Tensor | None) -> TracedMesh | None:
    """The zero level set of a field, traced in directions `aims` [k, 3]; None where it is empty. Only constants of the
    model are read. Raises RuntimeError where the field is not finite."""
    try:
        vertices, faces = extract_mesh(
            lambda points: sdf_values(points.to(network.table.device), network).cpu(),
            model.config.constants.box,
            model.config.mesh.resolution,
        )
    except EmptyMesh:
        return None
    return traced(model, torch.from_numpy(vertices), torch.from_numpy(faces), aims)


def make_beside(side: SideStream, model: SceneModel, network: SdfNetwork, aims: Tensor | None) -> TracedMesh | None:
    """The result of :func:`make_mesh` in the order of another stream, its bits on the model's device."""
    with side.within():
        mesh = make_mesh(model, network, aims)
        return mesh if mesh is None or mesh.bits is None else mesh._replace(bits=mesh.bits.to(model.device))


def traced(model: SceneModel, vertices: Tensor, faces: Tensor, aims: Tensor | None) -> TracedMesh:
    """A mesh with its visibility in directions `aims`, where the model caches that."""
    scene = MeshScene(vertices.numpy(), faces.numpy())
    return TracedMesh(scene, vertices, faces, model.trace(scene, vertices, faces, aims))
