"""The processes that train one scene together: what they share, divide and agree on."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from datetime import timedelta
from typing import NamedTuple, TypeVar

import torch
import torch.distributed as dist
from torch import Tensor
from torch.nn.functional import pad

from splitnerf.devices import pinned
from splitnerf.errors import InputError
from splitnerf.progress import ending_signals
from splitnerf.render.renderer import RenderedRays
from splitnerf.training.batches import Batch
from splitnerf.training.finite import UNEXPLAINED, Diverged
from splitnerf.training.losses import Terms

PATIENCE = timedelta(days=1)  # the first process may look for the object, or mesh, while the others wait
LARGE = 1 << 21  # numbers of a gradient that is summed where it lies; to copy fewer costs less than one more exchange
Made = TypeVar("Made")


class RankLost(RuntimeError):
    """Another process of the training has ended."""


class Agreed(NamedTuple):
    """Sums over the processes of a step, equal on all of them.

    Attributes:
        samples, shaded, rays, segments: The samples, those shaded, the rays with samples and the ray segments.
        evaluated: The points evaluated to find the samples.
        without_room: The processes whose results had too little room.
        stopping: The processes that were asked to stop.
        seconds: The first process's time.
        meshes: The meshes that the first process has made beside the training.
    """

    samples: float
    shaded: float
    rays: float
    segments: float
    evaluated: float
    without_room: float = 0.0
    stopping: float = 0.0
    seconds: float = 0.0
    meshes: float = 0.0


class Alone:
    """A training in one process: nothing is divided, and nobody is asked.

    Attributes:
        rank: The number of this process.
        size: The number of processes.
        several: Whether there are others.
        is_first: Whether this process writes the run's files, and meshes.
    """

    rank, size, several, is_first = 0, 1, False, True

    def part(self, batch: Batch) -> Batch:
        """This process's rays and probes of a batch that all processes have drawn."""
        return batch

    def whole(self, x: Tensor) -> Tensor:
        """The rows [n, ...] of all rays of a batch from those of each process's part, in the batch's order."""
        return x

    def divisible(self, n: int) -> int:
        """The number of rays, at most ``n`` or one a process, that all processes take the same part of."""
        return n

    def own(self, generator: torch.Generator, seed: int, step: int) -> torch.Generator:
        """Random numbers of this process alone, where ``generator`` gives all processes the same."""
        return generator

    def agree(self, terms: Terms, ray: RenderedRays, room: Sequence[float]) -> Tensor | None:
        """Makes the terms of a loss those over the rays of all processes; their gradients will be parts of one sum.

        Args:
            terms: The terms over this process's rays.
            ray: The rendering of these rays.
            room: The most samples, shaded samples and segments that they have room for.

        Returns:
            The tensor form of :class:`Agreed`, on the device; None where nobody is asked.
        """
        return None

    def sum_gradients(self, parameters: Iterable[Tensor]) -> None:
        """Replaces the gradients of parameters by the sums over all processes; each process names the same ones."""

    def of_first(self, make: Callable[[], Made]) -> Made:
        """What ``make`` returns on the first process, on all."""
        return make()

    def divided(self, function: Callable[[Tensor], Tensor]) -> Callable[[Tensor], Tensor]:
        """A function from points [n, 3] to values [n], of which each process evaluates a part of the points; all call it with the same
        ones."""
        return function

    def align(self, device: torch.device) -> None:
        """Sets torch's default generator of a device to the state of the first process's."""

    def read(self, agreed: Agreed) -> None:
        """Takes in what the processes agreed on in a step, once it is known."""

    def stops(self, asked: bool, started: float) -> bool:
        """Whether to stop, where this process is ``asked`` to or not; its clock was at ``started`` when the training was."""
        return asked

    def seconds(self, started: float) -> float:
        """The time of the training since the clock was at ``started``."""
        return time.monotonic() - started

    def is_made(self, mesh: Future, n_used: int) -> bool:
        """Whether a mesh is ready, after ``n_used`` others were."""
        return mesh.done()

    def clearest(self, error: Diverged) -> Diverged:
        """The error of the process that knows where it came from."""
        return error

    def leave(self) -> None:
        """Ends the collaboration. Only the first process goes on, with the threads of all."""


ALONE = Alone()


class Ranks(Alone):
    """The processes of one torchrun. Each draws the whole batch and takes every ``size``-th ray of it.

    Most steps exchange two things (learned exposures, a refresh of the grid and a new mesh need more): a few dozen numbers between the
    forward and the backward pass, by :meth:`agree`, and all gradients after it, by :meth:`sum_gradients`. Decisions that depend on
    time or on counts are taken from the former, so that they are equal everywhere.

    Args:
        rank, size: The number of this process, and of all.

    Raises:
        RankLost: Any method: another process has ended.
    """

    several = True

    def __init__(self, rank: int, size: int):
        self.rank, self.size, self.is_first = rank, size, rank == 0
        self._own: torch.Generator | None = None
        self._asked, self._started, self._mesh, self._n_used = False, time.monotonic(), None, 0
        self._agreed = Agreed(0, 0, 0, 0, 0)

    def part(self, batch: Batch) -> Batch:
        mine = slice(self.rank, None, self.size)
        *of_rays, probes = batch
        parts = (x[mine].contiguous() for x in of_rays)
        return Batch(*parts, type(probes)(*(x[mine].contiguous() for x in probes)))

    def whole(self, x: Tensor) -> Tensor:
        return self._gathered(x).transpose(0, 1).flatten(0, 1)

    def _gathered(self, x: Tensor) -> Tensor:
        """The tensors [n, ...] of all processes, [size, n, ...]."""
        x = x.detach().contiguous()
        parts = x.new_empty(self.size, *x.shape)
        with lost_ranks():
            dist.all_gather(list(parts.unbind(0)), x)
        return parts

    def divisible(self, n: int) -> int:
        return max(self.size, n - n % self.size)

    def own(self, generator: torch.Generator, seed: int, step: int) -> torch.Generator:
        if self._own is None:
            self._own = torch.Generator(generator.device)
        return self._own.manual_seed(((seed * 1_000_003 + step) * 4096 + self.rank + 1) % (1 << 63))

    def agree(self, terms: Terms, ray: RenderedRays, room: Sequence[float]) -> Tensor:
        counts, device = torch.cat([ray.n_found[None], ray.sizes]), ray.mean.device
        without_room = (counts > _limits(*room, device)).any()[None]
        told = pinned(torch.tensor([self._asked, *self._told()], dtype=torch.float32), device).to(device, non_blocking=True)
        return terms.share(self.summed, torch.cat([counts, ray.evaluated.sum()[None], without_room, told]))

    def _told(self) -> tuple[float, float]:
        """What the first process tells: its time, and the number of its meshes."""
        if not self.is_first:
            return 0.0, 0.0
        return time.monotonic() - self._started, self._n_used + (self._mesh is not None and self._mesh.done())

    def summed(self, x: Tensor) -> Tensor:
        """The sum of a tensor over the processes, written over it; its bits are the same on all."""
        with lost_ranks():
            dist.all_reduce(x)
        return x

    @torch.no_grad()
    def sum_gradients(self, parameters: Iterable[Tensor]) -> None:
        parameters = list(parameters)
        device = parameters[0].device
        here = torch.tensor([p.grad is not None for p in parameters], dtype=torch.float32)
        present = pinned(here, device).to(device, non_blocking=True)  # else the host would wait for the backward pass
        parts = [torch.zeros_like(p) if p.grad is None else p.grad for p in parameters]
        small = [part for part in parts if part.numel() < LARGE]
        flat = self.summed(torch.cat([*(part.reshape(-1) for part in small), present]))
        *sums, present = flat.split([*(part.numel() for part in small), len(parameters)])
        torch._foreach_copy_(small, [x.view_as(part) for x, part in zip(sums, small)])
        for part in parts:
            if part.numel() >= LARGE:  # most often the table's alone: summed where it lies
                self.summed(part)
        for i, (parameter, part) in enumerate(zip(parameters, parts)):
            if parameter.grad is None and present[i] > 0:  # only another process has one
                parameter.grad = part

    def of_first(self, make: Callable[[], Made]) -> Made:
        made = [make() if self.is_first else None]
        with lost_ranks():
            dist.broadcast_object_list(made, src=0, device=torch.device("cpu"))
        return made[0]

    def divided(self, function: Callable[[Tensor], Tensor]) -> Callable[[Tensor], Tensor]:
        def together(points: Tensor) -> Tensor:
            n = -(-len(points) // self.size)
            values = function(points[self.rank * n : (self.rank + 1) * n])
            return self._gathered(pad(values, (0, n - len(values)))).flatten()[: len(points)]

        return together

    def align(self, device: torch.device) -> None:
        is_gpu = device.type == "cuda"
        state = torch.cuda.get_rng_state(device) if is_gpu else torch.get_rng_state()
        with lost_ranks():
            dist.broadcast(state, src=0)
        if is_gpu:
            torch.cuda.set_rng_state(state, device)
        else:
            torch.set_rng_state(state)

    def read(self, agreed: Agreed) -> None:
        self._agreed = agreed

    def stops(self, asked: bool, started: float) -> bool:
        self._asked, self._started = asked, started
        return self._agreed.stopping > 0

    def seconds(self, started: float) -> float:
        return self._agreed.seconds

    def is_made(self, mesh: Future, n_used: int) -> bool:
        self._mesh, self._n_used = mesh, n_used
        return self._agreed.meshes > n_used

    def clearest(self, error: Diverged) -> Diverged:
        said: list[str] = [""] * self.size
        with lost_ranks():
            dist.all_gather_object(said, str(error))
        return Diverged(next((text for text in said if UNEXPLAINED not in text), said[0]))

    def leave(self) -> None:
        with lost_ranks():
            dist.barrier()
        dist.destroy_process_group()
        if self.is_first:
            torch.set_num_threads(min(os.cpu_count() or 1, self.size * torch.get_num_threads()))


@functools.lru_cache(maxsize=256)
def _limits(samples: float, shaded: float, segments: float, device: torch.device) -> Tensor:
    """The most samples, shaded samples, rays and segments that there may be."""
    with torch.inference_mode(False):
        return torch.tensor([samples, shaded, math.inf, segments], device=device)


@contextlib.contextmanager
def lost_ranks() -> Iterator[None]:
    """Turns the error of a collective within the block into one that says what happened.

    Raises:
        RankLost: The collective failed.
    """
    try:
        yield
    except torch.OutOfMemoryError:
        raise
    except RuntimeError as error:  # gloo's and NCCL's
        ignore_signals()
        raise RankLost(
            "the processes of this training can no longer exchange numbers, most often because one has ended, so all end "
            f"({str(error).partition(chr(10))[0]}); to go on, repeat the command with --resume auto"
        ) from error


@contextlib.contextmanager
def joined() -> Iterator[Alone]:
    """The processes that torchrun started with this one, or :data:`ALONE` without torchrun.

    Processes but the first say nothing. Of all that fail only the one that fails first says why: the errors of the others have no
    words.
    """
    if "TORCHELASTIC_RUN_ID" not in os.environ or int(os.environ["WORLD_SIZE"]) == 1:
        yield ALONE
        return
    has_gpu = torch.cuda.is_available()
    store, rank, size = next(dist.rendezvous("env://", timeout=PATIENCE))
    backend = "cpu:gloo,cuda:nccl" if has_gpu and dist.is_nccl_available() else "gloo"
    dist.init_process_group(backend, store=store, rank=rank, world_size=size, timeout=PATIENCE)
    if has_gpu:
        torch.cuda.set_device(int(os.environ["LOCAL_RANK"]) % torch.cuda.device_count())
    try:
        with contextlib.ExitStack() as quiet:
            if rank:
                nowhere = quiet.enter_context(open(os.devnull, "w"))
                quiet.enter_context(contextlib.redirect_stdout(nowhere))
                quiet.enter_context(contextlib.redirect_stderr(nowhere))
            yield Ranks(rank, size)
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, RankLost):
            ignore_signals()
        if is_first_to_fail(store):
            raise
        raise (InputError if isinstance(error, InputError) else RuntimeError)("") from None


def is_first_to_fail(store: dist.Store) -> bool:
    """Whether no other process has asked this; true where nobody can tell."""
    try:
        return store.add("splitnerf/failed", 1) == 1
    except RuntimeError:
        return True


def ignore_signals() -> None:
    """Leaves the launcher's signal to end, which follows when a process has ended, without effect: this one ends by itself."""
    for number in ending_signals():
        signal.signal(number, signal.SIG_IGN)


def one_gpu_each(device: torch.device, ranks: Alone) -> None:
    """Raises InputError where processes of one machine would share a GPU."""
    if ranks.several and device.type == "cuda" and int(os.environ["LOCAL_WORLD_SIZE"]) > torch.cuda.device_count():
        raise InputError(
            f"torchrun: {os.environ['LOCAL_WORLD_SIZE']} processes and {torch.cuda.device_count()} GPUs; start one for each GPU, or "
            "give --device cpu"
        )
