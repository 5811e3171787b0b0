"""A refinement, sweep by sweep: the outline, a compact lamp, the fit, the detail; with a state from which another process can
continue."""

from __future__ import annotations

import copy
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
from splitnerf.refinement.detail import detail_size, with_detail
from splitnerf.refinement.fit import FitSettings, Refinement, is_worse
from splitnerf.refinement.lamps import CompactLamp
from splitnerf.refinement.light import radiance_of
from splitnerf.refinement.outline import ROUNDS, fit_outline
from splitnerf.refinement.texels import check_form
from splitnerf.refinement.unknowns import to_values

PATIENCE = 6  # sweeps after the best one, after which the fit ends
# Factor on the error of held-out photos: training has fitted them, and the fit unlearns that. Measured 1.2 and 1.3 where test views stayed the same.
MAY_UNLEARN = 1.4
LEAST_SWEEPS = 4  # that fit into the minutes of a refinement: a longer sweep gathers fewer pixels
DETAIL_SHARE = 0.25  # of the minutes, kept for the detail where the photos show more than the textures hold
OUTLINE_SHARE = 0.5  # of the rest, after which no further round of the outline begins, nor the search for a lamp


@dataclass(frozen=True)
class Refined:
    """The result of a refinement.

    Attributes:
        light: [h, 2 h, 3] linear radiance.
        outline: Mean squared errors of the coverage at the outline, before each round and at the end; empty where the
            shape was kept.
        sweeps: The report of each sweep.
        held: The error of held-out pixels before the level, the lamp and the first sweep, and with what is delivered.
        delivered: The number of the sweep that is delivered; 0 for the start.
        saturated: The share of the covered pixels' values that the photos clip.
        lamp: The lamp that was made compact at the start, or None.
        level, tint: The factors by which the light was made brighter and coloured at the start, see :mod:`splitnerf.refinement.level`; 1:
            it was not.
        detail: The edge of the albedo's texture, which has the photos' detail; None where it has none.
    """

    asset: Asset
    light: np.ndarray
    outline: list[float]
    sweeps: list[Sweep]
    held: tuple[float, float]
    delivered: int
    saturated: float
    lamp: CompactLamp | None
    level: float
    tint: list[float]
    detail: int | None


class Sweep(NamedTuple):
    """The report of one sweep; errors are in sRGB units at the tone of the brightest pixel around."""

    number: int  # sweeps so far
    seconds: float  # since the start
    error: float  # mean squared error of the photos before its step, without the noise; perhaps slightly negative
    held: float  # mean squared error of held-out pixels after it


class Candidate(NamedTuple):
    """What may be delivered: the number of its sweep, the errors of batches of held-out pixels, the texels' unknowns and
    the levels of the light."""

    number: int
    held: list[float]
    unknowns: torch.Tensor
    light: list[torch.Tensor]


def decibels(error: float) -> float:
    """The PSNR of a mean squared error, which may come out as 0 or less where it is estimated."""
    return -10.0 * math.log10(max(error, 1e-8))


class Stage:
    """A refinement, sweep by sweep, with a state from which another process can continue. Raises InputError where the photos show
    nothing, and ValueError, KeyError or TypeError where the asset or the light has another form, or the state belongs to another
    refinement.

    An eighth of the photos is not fitted. PATIENCE sweeps after the one that left these photos the smallest error the fit
    ends. The texels and the light after the last sweep are delivered, unless that one, or the start, is clearly better by more than
    MAY_UNLEARN; without the normal texture, unless these photos are explained clearly worse without it.

    Where the photos' pixels are about as fine as the texels or finer, the albedo gets their detail at the end.

    The minutes limit it: after OUTLINE_SHARE of those that the detail leaves no further round of the outline begins, except the first, and no
    lamp is searched for. A sweep takes at most a LEAST_SWEEPS-th of them, the last one the rest. One sweep is always
    made.

    Args:
        dataset, asset, environment, settings: See :class:`Refinement`.
        state: What :meth:`state` returned with the same arguments (`sweeps` and `minutes` may differ); None begins.
        show: Called often with the share done and a message.

    Attributes:
        outline, sweeps, lamp: See :class:`Refined`.
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
        self.dataset, self.settings, self.show, self.outline, self.sweeps = dataset, settings, show, [], []
        self.albedo_size = detail_size(dataset, asset, settings.albedo_size)
        self.started, self.last_seconds = time.monotonic(), 0.0  # of the last sweep made here
        self.best: Candidate | None = None
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
            self.held_start = float(state["held_start"])
            self.best, self.last = (self._checked(state[name]) for name in ("best", "last"))
            return
        start = self.fit.held_errors()
        self.held_start = float(start.mean())
        start = self.fit.find_level(start)
        if settings.light_step > 0 and self.seconds < OUTLINE_SHARE * self.limit:
            show(self.progress, "refinement, looking for a lamp")
            self.lamp = self.fit.make_lamp_compact()
        if self.lamp is not None:  # photos do not tell a compact lamp from a smeared one: steps are judged with it
            start = self.fit.held_errors()
        self.best = self.last = self._candidate(0, self.unseen * start)

    @property
    def unseen(self) -> float:
        """The factor by which errors of held-out pixels would be larger at the start had training not fitted them, too. The mean of
        n noisy values has 1 - 1/n of their variance to those values and 1 + 1/n to others. Training is smoother: it counts as the
        mean of twice the sightings."""
        return 1.0 + 1.0 / max(self.fit.sightings, 1.0)

    def _candidate(self, number: int, held: np.ndarray) -> Candidate:
        return Candidate(number, held.tolist(), self.fit.unknowns, self.fit.light.levels)

    def _checked(self, stored: list) -> Candidate:
        """A candidate of a state. Raises ValueError or TypeError where it belongs to another fit."""
        candidate = Candidate(*stored)
        check_tensor("unknowns", candidate.unknowns, tuple(self.fit.unknowns.shape), torch.float32)
        for level, kept in zip(self.fit.light.levels, candidate.light, strict=True):
            check_tensor("a level of the light", kept, tuple(level.shape), torch.float32)
        return candidate._replace(held=list(map(float, candidate.held)))

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
        """The time limit of outline, lamp and sweeps in seconds."""
        return self.minutes_limit * (1.0 if self.albedo_size is None else 1.0 - DETAIL_SHARE)

    @property
    def minutes_limit(self) -> float:
        """The time limit of all in seconds."""
        return 60.0 * self.settings.minutes if self.settings.minutes > 0 else math.inf

    @property
    def finished(self) -> bool:
        """Whether all sweeps are made, or what is left of the minutes is less than half of a sweep like the last
        one."""
        useless = self.best is not None and len(self.sweeps) >= self.best.number + PATIENCE
        if useless or len(self.sweeps) >= self.settings.sweeps:
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
        error, held = self.fit.sweep(seconds, lambda: self.show(min(0.99, self.progress), message))
        number = len(self.sweeps) + 1
        self.last = self._candidate(number, held)
        held = float(np.mean(self.last.held))
        if held < np.mean(self.best.held):
            self.best = self.last
        self.last_seconds = self.seconds - started
        self.sweeps.append(Sweep(number, self.seconds, error, held))
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
            "held_start": self.held_start,
            "best": list(self.best),
            "last": list(self.last),
            "fit": self.fit.state(),
        }

    def normals_show(self, chosen: Candidate) -> bool:
        """Whether the mesh's own normals explain the photos held out worse than the normal texture does."""
        judge = copy.copy(self.fit)
        judge.light = copy.copy(judge.light)
        judge.light.levels = chosen.light
        judge.unknowns = chosen.unknowns.clone()
        judge.unknowns[:, -2:] = 0.0  # tilts
        return is_worse(judge.held_errors(), np.array(chosen.held) / (1.0 if chosen.number else self.unseen))

    def result(self) -> Refined:
        """The result so far."""
        fit, size = self.fit, self.albedo_size
        chosen = self.best if is_worse(self.last.held, MAY_UNLEARN * np.array(self.best.held)) else self.last
        asset = fit.texels.asset_with(fit.texels.maps(to_values(chosen.unknowns)))
        if not self.normals_show(chosen):
            asset = replace(asset, materials=[replace(asset.materials[0], normal_texture=None)])
        light = radiance_of(chosen.light).numpy()
        if size is not None:
            left = max(self.minutes_limit - self.seconds, DETAIL_SHARE * self.minutes_limit)
            asset = with_detail(
                self.dataset, asset, light, size, left, lambda share: self.show(share, "refinement, detail")
            )
        held = (self.held_start, float(np.mean(chosen.held)) / (1.0 if chosen.number else self.unseen))
        saturated = float(fit.pixels.saturated.mean())
        found = self.lamp, fit.level, fit.tint.tolist()
        return Refined(asset, light, self.outline, self.sweeps, held, chosen.number, saturated, *found, size)
