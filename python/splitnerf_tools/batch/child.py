"""A scene's training as a process of its own, where Ray placed it. Imports neither torch nor Ray, so that a worker
stays small.

As a program (``python -m splitnerf_tools.batch.child PARENT COMMAND...``) it becomes the command, which receives
SIGTERM when its parent ends, however that ends.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from splitnerf.errors import plain
from splitnerf.files import is_locked

PR_SET_PDEATHSIG = 1  # of Linux's prctl
POLL, TIMEOUT = 0.2, 120.0  # seconds: between polls of the process, and for an earlier one to leave the folder
MOST_WORDS = 500  # letters of an error


class Work(NamedTuple):
    """The task of a worker.

    Attributes:
        data: The scene's folder.
        run: The folder of its run.
        options: The options of `splitnerf train`.
        threads: The number of threads of the process.
        log: The file that its output is appended to.
    """

    data: str
    run: str
    options: list[str]
    threads: int
    log: str


class Outcome(NamedTuple):
    """How a process ended.

    Attributes:
        code: Its exit code; negative, the signal that killed it. None where it was not started.
        error: One line with the reason of a failure.
        stopped: Whether it was interrupted.
    """

    code: int | None
    error: str
    stopped: bool


def train_scene(work: Work) -> Outcome:
    """Runs ``splitnerf train DATA --out RUN --resume auto`` to its end.

    KeyboardInterrupt, by which Ray cancels a task, makes it save its state, and is waited for.
    """
    stopped = False
    if not _free(Path(work.run)):
        return Outcome(None, f"{work.run}: is in use by another program", False)
    options = ["--out", work.run, "--resume", "auto", *work.options]
    command = [sys.executable, "-m", "splitnerf", "train", work.data, *options]
    hidden = ("RAY_AUTH_TOKEN", "RAY_AUTH_MODE")  # not needed there
    environment = {key: value for key, value in os.environ.items() if key not in hidden}
    environment |= {"OMP_NUM_THREADS": str(work.threads), "PYTHONUNBUFFERED": "1"}
    os.makedirs(os.path.dirname(work.log), exist_ok=True)
    with open(work.log, "ab") as log:
        log.write(f"$ {plain(' '.join(command))}\n".encode(errors="backslashreplace"))
        log.flush()
        begin = log.tell()
        child = subprocess.Popen(
            [sys.executable, "-m", "splitnerf_tools.batch.child", str(os.getpid()), *command],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            env=environment,
            start_new_session=True,
        )
        try:
            while child.poll() is None:
                time.sleep(POLL)
        except BaseException as error:
            stopped = isinstance(error, KeyboardInterrupt)
            child.terminate()
            child.wait()
            if not stopped:
                raise
    return Outcome(child.returncode, failure_line(Path(work.log), begin, child.returncode), stopped)


def failure_line(log: Path, begin: int, code: int) -> str:
    """The reason of a failure, from the log from a byte on; empty where there was none."""
    if code == 0:
        return ""
    if code < 0:
        return f"was killed by {signal.Signals(-code).name}"
    with open(log, "rb") as file:
        file.seek(begin)
        lines = [line for line in file.read().decode(errors="replace").splitlines() if line.strip()]
    ours = [line for line in lines if line.startswith("splitnerf: ") and not line.startswith("splitnerf: note:")]
    return plain((ours or lines or [f"ended with exit code {code}"])[-1].removeprefix("splitnerf: "))[:MOST_WORDS]


def _free(run: Path) -> bool:
    """Waits for an earlier process to leave a run's folder; one whose worker was killed still saves its state."""
    until = time.monotonic() + TIMEOUT
    while is_locked(run):
        if time.monotonic() > until:
            return False
        time.sleep(POLL)
    return True


def become(parent: int, command: list[str]) -> None:
    """Becomes a command that receives SIGTERM when this process's parent ends; on systems other than Linux it runs to its end."""
    signal.pthread_sigmask(signal.SIG_SETMASK, [])  # Ray blocks Ctrl-C in its own
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:  # it ended before
        sys.exit(1)
    os.execv(command[0], command)


if __name__ == "__main__":
    become(int(sys.argv[1]), sys.argv[2:])
