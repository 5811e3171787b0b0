"""A refinement, sweep by sweep: the outline, a compact lamp, the fit; with a state from which another process can continue."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset
from splitnerf.data.tensor_files import check_tensor
from splitnerf.refinement.fit import FitSettings, Refinement
from splitnerf.refinement.lamps import CompactLamp
from splitnerf.refinement.outline import ROUNDS, fit_outline
from splitnerf.refinement.texels import check_form

LEAST_SWEEPS = 4  # that fit into the minutes of a refinement: a longer sweep gathers fewer pixels
OUTLINE_SHARE = 0.5  # of the minutes, after which no further round of the outline begins, nor the search for a lamp


@dataclass(frozen=True)
class Refined:
    """The result of a refinement.

    Attributes:
        asset: The asset.
        light: [h, 2 h, 3] linear radiance.
        outline: Mean squared errors of the coverage at the outline, before each round and at the end; empty where the
            shape was kept.
        sweeps: The report of each sweep.
        saturated: The share of the covered pixels' values that the photos clip.
        lamp: The lamp that was made compact at the start, or None.
        level: The factor by which the light was made brighter at the start, see :mod:`splitnerf.refinement.level`.
    """

    asset: Asset
    light: np.ndarray
    outline: list[float]
    sweeps: list[Sweep]
    saturated: float
    lamp: CompactLamp | None
    level: float


class Sweep(NamedTuple):
    """The report of one sweep.

    Attributes:
        number: Sweeps so far.
        seconds: Time since the start.
        error: Mean squared error of the photos before the sweep's step, without the noise, in sRGB units at the tone of
            the brightest pixel around; it may come out slightly negative.
        moved: [7] root mean square of the step, by unknown.
    """

    number: int
    seconds: float
    error: float
    moved: list[float]


def decibels(error: float) -> float:
    """The PSNR of a mean squared error, which may come out as 0 or less where it is estimated."""
    return -10.0 * math.log10(max(error, 1e-8))


class Stage:
    """A refinement, sweep by sweep, with a state from which another process can continue.

    The minutes limit it: after OUTLINE_SHARE of them no further round of the outline begins, except the first, and no
    lamp is searched for. A sweep takes at most a LEAST_SWEEPS-th of them, the last one the rest. One sweep is always
    made.

    Args:
        dataset, asset, environment, settings: See :class:`Refinement`.
        state: What :meth:`state` returned with the same arguments (`sweeps` and `minutes` may differ); None begins.
        show: Called often with the share done and a message.

    Attributes:
        outline, sweeps, lamp: See :class:`Refined`.

    Raises:
        ValueError, KeyError, TypeError: The asset or the light has another form, or the state belongs to another
            refinement.
        InputError: The photos show nothing.
    """

    def __init__(
        self,
        dataset: Dataset,
        asset: Asset,
        environment: np.ndarray,
        settings: FitSettings,
        state: dict | None = None,
        show: Callable[[float, str], None] = lambda share, message: None,
    ):
        check_form(asset)
        self.settings, self.show, self.outline, self.sweeps = settings, show, [], []
        self.started, self.last_seconds = time.monotonic(), 0.0  # of the last sweep made here
        if state is not None:
            check_tensor("vertices", state["vertices"], asset.vertices.shape, torch.float32)
            asset = replace(asset, vertices=state["vertices"].numpy())
            self.outline, self.sweeps = list(map(float, state["outline"])), [Sweep(*sweep) for sweep in state["sweeps"]]
            self.started -= float(state["seconds"])
        elif settings.outline:
            asset, self.outline = fit_outline(dataset, asset, settings.seed, self._begins)
        show(self.progress, "refinement, the texels' pixels")
        self.fit, self.lamp = Refinement(dataset, asset, environment, settings), None
        if state is not None:
            self.fit.restore(state["fit"])
            self.lamp = None if state["lamp"] is None else CompactLamp(*state["lamp"])
        elif settings.light_step > 0 and self.seconds < OUTLINE_SHARE * self.limit:
            show(self.progress, "refinement, looking for a lamp")
            self.lamp = self.fit.make_lamp_compact()

    def _begins(self, turn: int) -> bool:
        """Whether there is time for a round of the outline as long as those before; always for the first."""
        self.show(self.progress, f"refinement, outline, round {turn + 1} of {ROUNDS}")
        return turn == 0 or self.seconds * (turn + 1) / turn <= OUTLINE_SHARE * self.limit

    @property
    def seconds(self) -> float:
        """Seconds spent in all parts of the refinement."""
        return time.monotonic() - self.started

    @property
    def limit(self) -> float:
        """The time limit in seconds."""
        return 60.0 * self.settings.minutes if self.settings.minutes > 0 else math.inf

    @property
    def finished(self) -> bool:
        """Whether all sweeps are made, or what is left of the minutes is less than half of a sweep like the last
        one."""
        if len(self.sweeps) >= self.settings.sweeps:
            return True
        return bool(self.sweeps) and self.limit - self.seconds <= 0.5 * self.last_seconds

    @property
    def progress(self) -> float:
        """The share done, in [0, 1]: of the sweeps, or of the minutes where those are further; 1 at the end alone."""
        if self.finished:
            return 1.0
        return min(0.99, max(len(self.sweeps) / self.settings.sweeps, self.seconds / self.limit))

    def advance(self) -> Sweep:
        """Makes one sweep. Raises RuntimeError where numbers are no longer finite."""
        started = self.seconds
        seconds = self.limit / LEAST_SWEEPS
        if self.sweeps:
            seconds = min(seconds, self.limit - started)
        message = self.message(len(self.sweeps) + 1)
        error, moved = self.fit.sweep(seconds, lambda: self.show(min(0.99, self.progress), message))
        self.last_seconds = self.seconds - started
        self.sweeps.append(Sweep(len(self.sweeps) + 1, self.seconds, error, moved))
        return self.sweeps[-1]

    def message(self, step: int) -> str:
        """The message of a step, with the error of the photos before the last whole step."""
        return f"refinement, step {step}" + (
            f", photos {decibels(self.sweeps[-1].error):.2f} dB" if self.sweeps else ""
        )

    def state(self) -> dict[str, object]:
        """The state from which the refinement continues, as tensors and plain values."""
        vertices = torch.from_numpy(np.ascontiguousarray(self.fit.texels.asset.vertices, np.float32))
        return {
            "vertices": vertices,
            "outline": self.outline,
            "sweeps": [list(sweep) for sweep in self.sweeps],
            "lamp": None if self.lamp is None else list(self.lamp),
            "seconds": self.seconds,
            "fit": self.fit.state(),
        }

    def result(self) -> Refined:
        """The result so far."""
        fit = self.fit
        light, saturated = fit.light.radiance().detach().numpy(), float(fit.pixels.saturated.mean())
        asset = fit.texels.asset_with(fit.maps())
        return Refined(asset, light, self.outline, self.sweeps, saturated, self.lamp, fit.level)


def refine(
    dataset: Dataset,
    asset: Asset,
    environment: np.ndarray,
    settings: FitSettings,
    report: Callable[[Sweep], None] = lambda sweep: None,
) -> Refined:
    """Fits an asset's outline, its textures and the light to photos; see :class:`Refinement` for the arguments.

    Args:
        report: Called after each sweep.

    Raises:
        ValueError: The asset or the light has another form than :class:`Refinement` takes.
        InputError: The photos show nothing of the asset.
        RuntimeError: Numbers are no longer finite.
    """
    stage = Stage(dataset, asset, environment, settings)
    while not stage.finished:
        report(stage.advance())
    return stage.result()
