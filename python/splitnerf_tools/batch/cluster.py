"""Ray, here or on a cluster: its start, and the share of a machine for a scene."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TextIO

from splitnerf.errors import InputError, plain
from splitnerf.files import own_folder
from splitnerf.memory import memory_bytes
from splitnerf.progress import Interrupt

from splitnerf_tools.batch.scenes import LOGS
from splitnerf_tools.doctor.machine import GIB, TRAINING_GIB, processors

GB = 1e9
TRAINING = TRAINING_GIB * GIB / GB  # GB of memory of a training without its photos
MEMORY = 4.0  # GB of a scene, photos included
GPU = 0.25  # of a scene: four at once made a third more steps than one alone on an H100, see docs/cuda.md
TIMEOUT = 10.0  # seconds for a cluster to answer, and for Ray here to leave its folder
OBJECT_STORE = 100 << 20  # bytes; results are small
SHARE_OF_FREE = 0.9  # of the free memory of this machine, for the scenes
LONGEST_FOLDER = 37  # letters of Ray's folder: its sockets' paths have 64 more, and the system allows 103
# Read when Ray is imported: no report of its use, sockets on 127.0.0.1 alone, and answers to those alone who have the
# token.
NO_REPORT = {"RAY_USAGE_STATS_ENABLED": "0"}
ALONE = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_AUTH_MODE": "token"}
# they save their state, see splitnerf_tools.batch.child.become
NO_KILL = {"RAY_kill_child_processes_on_worker_exit": "false"}


@dataclass(frozen=True)
class Share:
    """The share of a machine for a scene: cores and GPUs, which may be fractions, and GB of memory."""

    cores: float
    gpus: float
    memory: float

    @property
    def threads(self) -> int:
        """The number of threads of a training."""
        return max(1, int(self.cores))

    @property
    def photos(self) -> float:
        """GB of memory for its photos; more are read from a file."""
        return max(self.memory - TRAINING, self.memory / 4)

    def __str__(self) -> str:
        gpus = f", {self.gpus:g} GPU" if self.gpus else ""
        return f"{self.cores:g} {'core' if self.cores == 1 else 'cores'}{gpus} and {self.memory:.3g} GB"


def share_of(
    machines: Sequence[Mapping[str, float]],
    n_scenes: int,
    *,
    cores: float | None,
    gpus: float | None,
    memory: float | None,
    photos: float | None = None,
    whole_gpu: bool = False,
) -> Share:
    """The share of each of some scenes. Raises InputError where no machine has that much.

    Args:
        machines: The resources of each by Ray: "CPU", "GPU", "memory" in bytes.
        n_scenes: The number of scenes; cores are divided among them, and each gets at least one.
        cores, gpus, memory: The requests of the user, memory in GB; None for the needs of a training.
        photos: GB for the photos of a scene; None for the rest of its memory.
        whole_gpu: Whether a training fills a GPU.
    """
    most = {key: max((machine.get(key, 0.0) for machine in machines), default=0.0) for key in ("CPU", "GPU", "memory")}
    if cores is None:
        cores = min(most["CPU"], max(1.0, sum(machine["CPU"] for machine in machines) // max(1, n_scenes)))
    if gpus is None:
        gpus = 0.0 if most["GPU"] == 0 else 1.0 if whole_gpu else GPU
    if memory is None:
        memory = min(MEMORY if photos is None else TRAINING + photos, most["memory"] / GB)
    needs = {"CPU": cores, "GPU": gpus, "memory": memory * GB}
    share = Share(cores, gpus, memory)
    if not any(all(need <= machine.get(key, 0.0) for key, need in needs.items()) for machine in machines):
        raise InputError(
            f"no machine offers {share}; request less by --cores-per-scene, --gpus-per-scene or --memory-per-scene"
        )
    return share


@contextmanager
def ray_on(address: str | None, out: Path) -> Iterator[ModuleType]:
    """Ray, connected to the cluster whose head is at `address`, or (None) started on this machine and ended with the block.

    Ray's output goes into a file of the logs in the batch's folder `out`. Signals to end raise KeyboardInterrupt within the block.
    Raises InputError where Ray is not installed or cannot be loaded, no cluster answers, or the logs would replace other files, and
    RuntimeError where Ray does not start here.
    """
    if find_spec("ray") is None:
        raise InputError("batch needs the package ray: pip install 'splitnerf[batch]'")
    os.environ.update(NO_REPORT if address else NO_REPORT | ALONE | NO_KILL | {"RAY_AUTH_TOKEN": secrets.token_hex(32)})
    # `ray start` wrote it, and its cluster asks for it
    if address and Path("~/.ray/auth_token").expanduser().is_file():
        os.environ.setdefault("RAY_AUTH_MODE", "token")
    try:
        import ray
    except ImportError as error:
        raise InputError(f"the package ray cannot be loaded ({plain(str(error))}); install it again") from None
    own_folder(out / LOGS, "batch")
    place = None if address else ray_folder()
    with open(out / LOGS / "ray.log", "a", encoding="utf-8", errors="backslashreplace") as log:
        with redirect_stdout(log), redirect_stderr(log):
            try:
                with _compiled_words_to(log), Interrupt() as interrupt:  # Ray crashes where its start is interrupted
                    _start(ray, place) if place else _connect(ray, address)
                if interrupt.asked:
                    raise KeyboardInterrupt
                yield ray
            finally:
                ray.shutdown()
                if place is not None:
                    remove_folder(place)


def machines_of(ray: ModuleType) -> list[dict[str, float]]:
    """The resources of each machine of Ray."""
    return [node["Resources"] for node in ray.nodes() if node["Alive"] and node["Resources"].get("CPU")]


@contextmanager
def _compiled_words_to(log: TextIO) -> Iterator[None]:
    """Redirects standard error to a file within the block, for compiled code too."""
    kept = os.dup(2)
    os.dup2(log.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _start(ray: ModuleType, place: str) -> None:
    """Starts Ray on this machine, its files in a folder."""
    try:
        ray.init(
            address="local",
            num_cpus=processors(),
            object_store_memory=OBJECT_STORE,
            include_dashboard=False,
            logging_level="error",
            log_to_driver=False,
            _temp_dir=place,
            _memory=int(SHARE_OF_FREE * memory_bytes()[1]),
        )
    except Exception as error:  # of many kinds; on a busy machine Ray's own patience ends
        why = plain(str(error).strip()).partition(". ")[0]
        raise RuntimeError(f"Ray does not start here ({why}); repeat the command when the machine is free") from None


def _connect(ray: ModuleType, address: str) -> None:
    """Connects to a cluster."""
    host, _, port = address.rpartition(":")
    try:
        if port.isdigit():  # Ray itself would try for minutes
            socket.create_connection((host.rpartition("/")[2].strip("[]"), int(port)), TIMEOUT).close()
        ray.init(address=address, logging_level="error", log_to_driver=False)
    except (OSError, ValueError, OverflowError, ray.exceptions.RayError) as error:
        why = plain(str(error).strip()).partition(". ")[0]
        raise InputError(
            f"--address {address}: no Ray cluster answers ({why}); start one by `ray start --head`"
        ) from None


def remove_folder(folder: str) -> None:
    """Removes Ray's folder; processes of Ray that end may still write into it, for at most some seconds."""
    until = time.monotonic() + TIMEOUT
    while os.path.exists(folder) and time.monotonic() < until:
        shutil.rmtree(folder, ignore_errors=True)
        time.sleep(0.1)


def ray_folder() -> str:
    """A private folder with a short name for Ray's sockets and logs."""
    place = tempfile.gettempdir()
    if len(place) > LONGEST_FOLDER - len("/sn-12345678"):
        place = "/tmp"
    return tempfile.mkdtemp(prefix="sn-", dir=place)
