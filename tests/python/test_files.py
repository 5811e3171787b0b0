"""Results are written whole or not at all, and one program at a time writes into a folder."""

import errno
import fcntl
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from splitnerf import files
from splitnerf.data.images import read_image, write_image
from splitnerf.errors import InputError
from splitnerf.files import LOCK, PARTIAL, atomic_path, locked
from splitnerf_tools.capture.photographs import write_png

HOLDS = """
import sys, time
from pathlib import Path
from splitnerf.files import atomic_path, locked
with locked(Path(sys.argv[1])), atomic_path(Path(sys.argv[1]) / "sub" / "mesh.glb") as temporary:
    temporary.write_text("half")
    print("holds", flush=True)
    time.sleep(600)
"""


@contextmanager
def held(folder: Path) -> Iterator[subprocess.Popen]:
    """A program that holds a folder and has half-written a file there; its end at the end of the block."""
    process = subprocess.Popen([sys.executable, "-c", HOLDS, str(folder)], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "holds\n"
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def no_more_than(n_bytes: int) -> Iterator[None]:
    """Within the block no file becomes longer, as on a disk with as much left."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


# ---- one file ----


def test_a_file_is_on_the_disk_before_it_takes_its_name(tmp_path, monkeypatch):
    """And the folder with the new name after it."""
    order = []
    sync, replace = os.fsync, os.replace
    name_of = lambda handle: os.readlink(f"/proc/self/fd/{handle}")
    monkeypatch.setattr(os, "fsync", lambda handle: order.append(name_of(handle)) or sync(handle))
    monkeypatch.setattr(os, "replace", lambda *names: order.append("replace") or replace(*names))
    with atomic_path(tmp_path / "a.txt") as temporary:
        temporary.write_text("whole")
    assert order == [str(temporary), "replace", str(tmp_path)] and (tmp_path / "a.txt").read_text() == "whole"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES])
@pytest.mark.parametrize("where", ["in the block", "making it", "to the disk", "taking the name"])
def test_an_error_names_the_file_and_its_cause_and_keeps_the_old_one(tmp_path, monkeypatch, number, where):
    path = tmp_path / "a.glb"
    path.write_text("old")

    def fails(*arguments, **options):
        raise OSError(number, os.strerror(number), str(tmp_path / ".a.xyz.glb"))

    places = {"making it": (tempfile, "mkstemp"), "to the disk": (os, "fsync"), "taking the name": (os, "replace")}
    if where in places:
        monkeypatch.setattr(*places[where], fails)
    with pytest.raises(OSError) as caught, atomic_path(path) as temporary:
        temporary.write_text("new")
        if where == "in the block":
            fails()
    assert str(caught.value) == f"{path}: cannot be written ({os.strerror(number)})"
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".exr", ".hdr", "of a video"])
def test_an_image_without_room_is_an_error_and_keeps_the_old_one(tmp_path, suffix):
    pixels = np.random.default_rng(0).random((40, 40, 3)).astype(np.float32)
    path = tmp_path / ("a.png" if suffix == "of a video" else f"a{suffix}")
    path.write_text("old")
    said = "" if suffix in (".exr", ".hdr") else "cannot be written .File too large."  # these are made elsewhere first
    with no_more_than(700), pytest.raises(OSError, match=f"{path.name}: {said}"):
        write_png(path, np.uint8(255 * pixels)) if suffix == "of a video" else write_image(path, pixels)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_an_image_holds_no_time_of_writing(tmp_path):
    """Runs of the same bits stay so in all files."""
    write_image(tmp_path / "a.exr", np.ones((4, 8, 3), np.float32))
    header = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec().extra_attribs
    assert not {"DateTime", "capDate"} & {attribute.name for attribute in header}
    assert b"capDate" not in (tmp_path / "a.exr").read_bytes()


def test_names_that_are_no_text(tmp_path):
    """As an old archive leaves them: bytes that are not UTF-8."""
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9"))
    pixels = np.random.default_rng(0).random((4, 8, 3)).astype(np.float32)
    for suffix in (".png", ".jpg", ".exr", ".hdr"):
        write_image(folder / f"a{suffix}", pixels)
        assert np.abs(read_image(folder / f"a{suffix}") - pixels).max() < (0.2 if suffix == ".jpg" else 0.01)


# ---- one folder ----


def test_a_folder_in_use_is_refused_and_its_owner_named(tmp_path):
    run = tmp_path / "run"
    with held(run) as owner:
        words = rf"run: is in use by pid {owner.pid} on {socket.gethostname()}; wait for its end, or give another --out"
        with pytest.raises(InputError, match=words), locked(run):
            pass
        assert len(list((run / "sub").iterdir())) == 1  # what the owner is writing is left alone
    with locked(run):
        with locked(run):  # a program may lock it again within
            pass
        assert f"pid {os.getpid()} on " in (run / LOCK).read_text() and list((run / "sub").iterdir()) == []
    assert not (run / LOCK).exists()


def test_a_lock_that_its_owner_removed_meanwhile_is_none(tmp_path, monkeypatch):
    """Between opening and locking it; a third program would take the new file of that name."""
    lock, removed = fcntl.flock, []

    def flock(file, operation) -> None:
        if not removed:
            removed.append((tmp_path / LOCK).unlink())
        lock(file, operation)

    monkeypatch.setattr(fcntl, "flock", flock)
    with locked(tmp_path):
        assert (tmp_path / LOCK).read_text().startswith(f"pid {os.getpid()} on ")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_stays_empty_is_removed(tmp_path):
    """With those around it that it took; not one that was there before, where what a killed program left is removed alone."""
    (tmp_path / "there").mkdir()
    for folder in ("a/b", "there"):
        with pytest.raises(KeyError), locked(tmp_path / folder):
            raise KeyError
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
    with locked(tmp_path / "c/d"):
        (tmp_path / "c/mine").touch()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["c", "mine", "there"]
    for name in (f"{PARTIAL}abc.pt", ".mine.partial.pt"):
        (tmp_path / "there" / name).touch()
    with locked(tmp_path / "there"):
        pass
    assert [path.name for path in (tmp_path / "there").iterdir()] == [".mine.partial.pt"]


def test_a_folder_that_was_removed_is_not_made_again(tmp_path):
    """Nor is written to where another program has made it again."""
    run = tmp_path / "run"
    for again in (False, True):
        with locked(run):
            (run / LOCK).unlink()
            run.rmdir()
            if again:
                run.mkdir()
                (run / LOCK).touch()
            with pytest.raises(OSError, match="run: was removed while it was written to"), atomic_path(run / "a.txt"):
                pass
        assert run.exists() == again and not (run / "a.txt").exists()


def test_a_file_system_without_locks_is_told_of(tmp_path, monkeypatch, capsys):
    def fails(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", fails)
    with locked(tmp_path), atomic_path(tmp_path / "a.txt") as temporary:
        temporary.write_text("whole")
    assert "has no locks (No locks available); start no second run" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_folder_that_cannot_be_written_to_is_refused(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: is a file; give --out a folder"), locked(tmp_path / "file"):
        pass
    with pytest.raises(InputError, match="run: cannot be written to .Not a directory."), locked(tmp_path / "file/run"):
        pass

    def fails(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(files.os, "open", fails)
    words = "a: cannot be written to .Read-only file system.; give"
    with pytest.raises(InputError, match=words), locked(tmp_path / "a"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
