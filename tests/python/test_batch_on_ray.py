"""splitnerf batch on Ray: a damaged scene beside a good one; who can reach it; what it leaves."""

import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

import pytest
from splitnerf.cli import BAD_INPUT, FAILED
from splitnerf_tools.batch.scenes import known_scenes
from tiny_runs import SMALL, as_options

pytestmark = [
    pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed: pip install 'splitnerf[batch]'"),
    pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="there is no /proc to look at processes in"),
]
TIMEOUT = 600.0  # seconds


class Call:
    """`splitnerf batch` as a program of its own.

    Args:
        folder: Where its words go.
        words: Its arguments.
    """

    def __init__(self, folder: Path, *words: str):
        folder.mkdir()
        self._folder, self.temporary = folder, Path(tempfile.mkdtemp(dir="/tmp"))  # short enough for Ray's sockets
        environment = {**os.environ, "TMPDIR": str(self.temporary), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-m", "splitnerf", "batch", *words, *as_options(SMALL)]
        with open(folder / "out", "w") as out, open(folder / "err", "w") as err:
            self.program = subprocess.Popen(command, stdout=out, stderr=err, env=environment)

    @property
    def out(self) -> str:
        return (self._folder / "out").read_text()

    @property
    def err(self) -> str:
        return (self._folder / "err").read_text()

    def wait_until(self, seen: Callable[[], object]) -> object:
        """What is seen, once it is true."""
        until = time.monotonic() + TIMEOUT
        while not (found := seen()):
            assert self.program.poll() is None and time.monotonic() < until, self.out + self.err
            time.sleep(0.1)
        return found

    def end(self) -> int:
        """Waits for its end; returns the exit code. Nothing of Ray is left then."""
        code = self.program.wait(TIMEOUT)
        assert [name for name in commands().values() if "raylet" in name and str(self.temporary) in name] == []
        assert list(self.temporary.glob("sn-*")) == [] and "Traceback" not in self.err
        assert all(re.match(r"(splitnerf: note: |[ \d]{3}% )", line) for line in self.err.splitlines()), self.err
        return code

    def kill(self) -> None:
        if self.program.poll() is None:
            self.program.kill()
            self.program.wait()
        shutil.rmtree(self.temporary, ignore_errors=True)


@pytest.fixture
def call(tmp_path):
    """Starts a batch; what is left of it ends with the test."""
    calls: list[Call] = []

    def start(*words: object) -> Call:
        calls.append(Call(tmp_path / f"call_{len(calls)}", *map(str, words)))
        return calls[-1]

    yield start
    for started in calls:
        started.kill()


def processes(name: str) -> dict[int, str]:
    """A file of /proc of all processes, by their number."""
    found = {}
    for path in Path("/proc").glob(f"[0-9]*/{name}"):
        with suppress(OSError):
            found[int(path.parent.name)] = path.read_text(errors="replace")
    return found


def commands() -> dict[int, str]:
    """The command lines of all processes, by their number."""
    return {process: text.replace("\0", " ") for process, text in processes("cmdline").items()}


def parents() -> dict[int, int]:
    """The parent of each process."""
    return {process: int(text.rpartition(")")[2].split()[1]) for process, text in processes("stat").items()}


def family(of: int) -> set[int]:
    """A process and all that descend from it."""
    members, tree = {of}, parents()
    while new := {child for child, parent in tree.items() if parent in members} - members:
        members |= new
    return members


def listeners(processes: set[int]) -> set[str]:
    """The addresses, as /proc writes them, at which processes listen by TCP."""
    sockets = set()
    for process in processes:
        for handle in Path(f"/proc/{process}/fd").glob("*"):
            with suppress(OSError):
                sockets.add(os.readlink(handle))
    found = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            if state == "0A" and f"socket:[{line.split()[9]}]" in sockets:
                found.add(local.partition(":")[0])
    return found


LOOPBACK = {"0100007F", "0000000000000000FFFF00000100007F", "00000000000000000000000001000000"}


def test_a_damaged_scene_stops_no_other_and_nobody_else_reaches_ray(data, tmp_path, call):
    good, bad, out = tmp_path / "good", tmp_path / "bad", tmp_path / "out"
    for scene in (good, bad):
        shutil.copytree(data, scene)
    os.truncate(bad / "transforms_train.json", 100)
    first = call(good, bad, "--out", out, "--steps", 4, "--cores-per-scene", "0.5")
    seen = first.wait_until(lambda: listeners(family(first.program.pid)))
    while first.program.poll() is None:
        seen |= listeners(family(first.program.pid))
        time.sleep(0.2)
    assert seen and seen <= LOOPBACK
    assert first.end() == FAILED
    assert (out / "good/mesh.glb").is_file() and not (out / "bad").exists()
    assert f"refused        -       -  {bad}/transforms_train.json: is not valid json" in first.out
    assert [(scene.name, scene.state) for scene in known_scenes(out)] == [("good", "done"), ("bad", "refused")]
    again = call(good, bad, "--out", out, "--steps", 4)
    assert again.end() == FAILED
    assert sorted(again.out.splitlines()[1:3]) == sorted(first.out.splitlines()[1:3])


def test_a_cluster_that_is_not_there_is_one_line(tmp_path, call):
    with socket.socket() as taken:  # a port at which nobody listens
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        asked = call(tmp_path, "--out", tmp_path / "out", "--address", address)
        assert asked.program.wait(TIMEOUT) == BAD_INPUT
    assert asked.err.startswith(f"splitnerf: --address {address}: no Ray cluster answers")
    assert len(asked.err.splitlines()) == 1
