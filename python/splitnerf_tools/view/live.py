"""A run in training for the page: its surface, light and numbers, and the buttons that control it."""

from __future__ import annotations

import math
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from splitnerf.config.settings import UNLIMITED
from splitnerf.data.asset import Asset, Material
from splitnerf.data.normalisation import transform_points
from splitnerf.errors import InputError, plain
from splitnerf.export.meshing import extract_mesh
from splitnerf.export.scene import surface_of
from splitnerf.export.surface import surface_materials
from splitnerf.export.writers import glb_content
from splitnerf.render.model import SceneModel
from splitnerf.training.loop import Training
from splitnerf.training.metrics import METRICS, read_metrics
from splitnerf.training.observer import Event, Request

from splitnerf_tools.view.assets import Source, ViewedAssets, ViewedLight
from splitnerf_tools.view.events import EventStream

STATE_EVERY = 0.5  # seconds between two states
# least seconds between two surfaces, and the largest share of the time that they take
ASSET_EVERY, ASSET_SHARE = 4.0, 0.05
LIGHT_HEIGHT = 64  # rows of the light while it is recovered
# Of the buttons; "resume" takes one back.
REQUESTS = {"pause": Request.PAUSE, "checkpoint": Request.SAVE, "stop": Request.STOP}
ANSWERS = {"pause": "pauses until its page resumes it, or Ctrl-C ends it", "stop": "stops and exports"}
CURVES = ("step", "seconds", "psnr", "loss")  # and the terms of the loss


class Live:
    """An observer that shows a run in the page while it trains. As long as no page is open, it does nothing between steps.

    Attributes:
        shown: The assets of the server: the run's surface so far, and its light.
        events: The newest state for the pages: `stage`; `step` of `steps` (null where the time alone counts),
            `progress`, `left` (seconds, or null), `psnr`; `paused`; `version` of the asset, 0 for none; `lines`, the
            number of lines of the log; `saved`, the step of the checkpoint that was asked for last; `ended`.
    """

    def __init__(self, name: str):
        self.name, self.shown, self.events = name, ViewedAssets([]), EventStream()
        self._light = self.shown.add_light(ViewedLight("recovered light", np.ones((8, 16, 3), np.float32)))
        self.shown.keep_lights()
        self._world_from_box = np.eye(4)
        self._frame(np.eye(4))
        self.shown.sources.append(Source(name, self.shown.frame, bytes, self._light, version=0))
        self._lines: list[dict] = []
        self._requested: set[Request] = set()
        self._lock = threading.Lock()
        self._began = (0.0, 0.0)  # seconds and progress
        self._state_at = self._asset_at = -float("inf")
        self._cost, self._asset_step, self._taken = 0.0, -1, 0
        self._saving = False
        self._delivered: Path | None = None
        self.events.update(
            stage="preparation",
            step=0,
            steps=None,
            progress=0.0,
            left=None,
            psnr=None,
            paused=False,
            version=0,
            lines=0,
            saved=None,
        )

    # ---- called by the training's thread ----

    def __call__(self, event: Event) -> Request | None:
        if event.kind == "step":
            return self._between_steps(event.training)
        if event.kind == "begun":
            self._begin(event.training)
        elif event.kind == "logged":
            self._lines.append(_curves_of(event.line))
        elif event.training is None:
            self._deliver(event.kind, event.path)
        return None

    def _begin(self, training: Training) -> None:
        self._world_from_box = np.linalg.inv(training.dataset.box_from_world)
        self._frame(self._world_from_box)
        self._lines = [_curves_of(line) for line in read_metrics(training.run / METRICS)]
        self._began = training.seconds, training.progress
        self._tell(training, stage="training")

    def _between_steps(self, training: Training) -> Request | None:
        if self._saving:
            self._saving = False
            self._tell(training, saved=training.step)
        if self.events.listeners:
            self._show(training)
        return self._request() if self._requested else None

    def _deliver(self, stage: str, folder: Path | None) -> None:
        with self._lock:
            self._requested.clear()
        changes = {}
        if folder is not None and (folder / "mesh.glb").is_file():
            self._delivered, changes = folder, {"version": self.shown.sources[0].version + 1}
        self.events.update(stage=stage, paused=False, left=None, progress=1.0, lines=len(self._lines), **changes)

    # ---- called by the server's threads ----

    def ask(self, button: str) -> None:
        """Requests what a button stands for; the training reads the request after its step. Raises InputError where there is no
        such button, or the run does not train."""
        if button not in {*REQUESTS, "resume"}:
            raise InputError("there is no such button")
        with self._lock:
            if self.events.state["stage"] != "training":
                raise InputError("the run does not train now")
            if button == "resume":
                self._requested.discard(Request.PAUSE)
            else:
                self._requested.add(REQUESTS[button])
        if button in ("pause", "resume"):
            self.events.update(paused=button == "pause")
        if button in ANSWERS:
            print(f"splitnerf: note: the run {ANSWERS[button]}, as its page requests", file=sys.stderr)

    def lines(self, first: int) -> list[dict]:
        """The lines of the log from a number on."""
        return self._lines[first:]

    def taken(self, source: Source) -> None:
        """Records that a page has loaded an asset, so that the next one is made."""
        self._taken = max(self._taken, source.version)

    def load(self) -> None:
        """Shows the asset that the run has delivered, when a page requests it."""
        with self._lock:
            folder, self._delivered = self._delivered, None
        if folder is None:
            return
        try:
            source = self.shown.source_of(folder, self.name, self._light)
        except (InputError, OSError, MemoryError) as error:
            words = plain(f"{type(error).__name__}: {error}")
            said = str(error) if isinstance(error, InputError) else f"{folder}: cannot be shown ({words})"
            self.shown.problems.append(said)
            self.events.update(version=self.shown.sources[0].version)  # what is shown stays
            return
        self.shown.frame = source.asset
        self.shown.sources[0] = replace(source, version=self.shown.sources[0].version + 1)

    def _frame(self, world_from_box: np.ndarray) -> None:
        """The first camera has the whole ball of radius 1 in view, in which normalisation puts the object."""
        corners = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
        self.shown.frame = Asset(
            "frame",
            transform_points(world_from_box, corners),
            np.int32([[0, 1, 2], [3, 4, 5]]),
            corners,
            np.zeros(2, np.int32),
        )

    def _tell(self, training: Training, **changes: object) -> None:
        steps, (seconds, progress) = training.config.run.steps, self._began
        gained, left = training.progress - progress, None
        if gained > 0:
            left = (training.seconds - seconds) * (1.0 - training.progress) / gained
        self._state_at = time.monotonic()
        self.events.update(
            step=training.step,
            steps=None if steps >= UNLIMITED else steps,
            progress=training.progress,
            left=left,
            psnr=_rounded(training.log.psnr),
            lines=len(self._lines),
            **changes,
        )

    def _show(self, training: Training) -> None:
        """Sends the state if the last one is old enough, with a new surface if one is wanted."""
        now = time.monotonic()
        if now - self._state_at < STATE_EVERY:
            return
        due = now - self._asset_at >= max(ASSET_EVERY, self._cost / ASSET_SHARE)
        version = self.shown.sources[0].version
        if due and self._taken >= version and training.step != self._asset_step:
            version = self._update_asset(training)
            self._asset_at = time.monotonic()
            self._cost = self._asset_at - now
        self._tell(training, version=version)

    def _update_asset(self, training: Training) -> int:
        """Updates surface and light; returns the asset's version."""
        old, self._asset_step = self.shown.sources[0], training.step
        try:
            light = training.model.light.panorama(LIGHT_HEIGHT).detach().cpu().numpy()
            asset = training_asset(training.model, self._world_from_box)
        except RuntimeError:  # no surface yet, or one that the training itself refuses
            return old.version
        self.shown.add_light(ViewedLight("recovered light", light), self._light)
        self.shown.sources[0] = Source(
            self.name, asset, lambda: glb_content(asset, filtering=LINEAR), self._light, version=old.version + 1
        )
        return old.version + 1

    def _request(self) -> Request | None:
        with self._lock:
            if Request.SAVE in self._requested:
                self._requested.discard(Request.SAVE)
                self._saving = True
                return Request.SAVE
            return next((request for request in (Request.STOP, Request.PAUSE) if request in self._requested), None)


def _curves_of(line: dict[str, object]) -> dict[str, object]:
    """The values that the page draws of a line of metrics.jsonl, in few digits; None for those that are not finite."""
    drawn = {name: value for name, value in line.items() if name in CURVES or name.startswith("loss_")}
    return {name: _rounded(value) if isinstance(value, float) else value for name, value in drawn.items()}


def _rounded(value: float | None) -> float | None:
    return float(f"{value:.5g}") if value is not None and math.isfinite(value) else None


# ---- the surface in few triangles, with materials at their corners ----

RESOLUTION = 128  # nodes along an edge of the box
LEVELS = 64  # of roughness and metallic
LINEAR = 9729  # glTF's filter; smaller pictures of the texture would mix its far ends


@torch.no_grad()
def training_asset(model: SceneModel, world_from_box: np.ndarray, resolution: int = RESOLUTION) -> Asset:
    """A scene's surface in the data's world, z up. Its texture coordinates stand for roughness and metallic, which are thus linear
    over a triangle. Raises EmptyMesh where the surface is empty, RuntimeError where a field is not finite."""
    surface = surface_of(model)
    vertices, faces = extract_mesh(surface.sdf, model.config.constants.box, resolution)
    albedo, roughness, metallic, normals = surface_materials(surface, vertices)
    pairs = np.clip(np.column_stack([roughness, metallic]), 0, 1)
    steps = np.linspace(0, 1, LEVELS, dtype=np.float32)
    all_pairs = np.stack(np.meshgrid(steps, steps), axis=2)  # roughness grows to the right, metallic downwards
    return Asset(
        name="growing",
        vertices=transform_points(world_from_box, vertices),
        triangles=faces,
        normals=normals,
        material_ids=np.zeros(len(faces), np.int32),
        colors=np.clip(albedo, 0, 1),
        uv=((pairs * (LEVELS - 1) + 0.5) / LEVELS).astype(np.float32),
        materials=[Material(metallic=1.0, roughness_metallic_texture=all_pairs)],
    )
