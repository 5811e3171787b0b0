"""Writing of results: each file whole or not at all, and into a folder by one program at a time."""

from __future__ import annotations

import fcntl
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from splitnerf.errors import InputError, note

LOCK = ".splitnerf.lock"  # the file in a folder that names the program that writes there
OWNER = "pid "  # its first word
PARTIAL = ".splitnerf-partial-"  # how the name of a file begins that is not yet whole
MARK = ".splitnerf"  # the file in a folder of the program's own, with what it was made for
_locks: dict[Path, TextIO] = {}  # the locks of this program, by folder


@contextmanager
def atomic_path(path: str | os.PathLike) -> Iterator[Path]:
    """Yields a temporary name of the same suffix in the folder of `path`, which is made, that replaces it when the
    block succeeds.

    On any error the temporary file is removed and the old file at `path` stays. The new file is synchronised before it takes the
    name, so that a power failure leaves the old one or the new one. Raises InputError where the path is a device, a pipe or a
    socket, and OSError, which names the file and not the temporary one, where it cannot be written.
    """
    path = Path(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: is a device or a pipe, which is not replaced; give the name of a file")
    temporary = None
    try:
        _check_locked(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=PARTIAL, suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        _synchronise(temporary)
        os.replace(temporary, path)
        with suppress(OSError):  # not every file system synchronises folders
            _synchronise(path.parent)
    except OSError as error:
        if error.errno is None:  # a message of its own
            raise
        raise OSError(f"{path}: cannot be written ({reason(error)})") from error
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Locks a folder for this program within the block; the file LOCK in it names the program.

    The lock ends with the program, however that ends. The next program takes the folder over and removes half-written
    files. A folder that the block leaves empty is removed, if it was not there before. This program may have locked it
    already. Raises InputError where another program has locked the folder, or it cannot be made or written to.
    """
    key = folder.resolve()
    if key in _locks:
        yield
        return
    made: list[Path] = []
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is a file; give --out a folder")
        made += [parent for parent in (folder, *folder.parents) if not parent.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        lock = _acquired(folder / LOCK)
    except OSError as error:
        _remove_empty(made)
        raise InputError(f"{folder}: cannot be written to ({reason(error)}); give another --out") from None
    _locks[key] = lock
    try:
        remove_partial(folder)
        yield
    finally:
        with suppress(OSError):
            if _is_at(lock, folder / LOCK):
                (folder / LOCK).unlink()
        del _locks[key]
        lock.close()
        _remove_empty(made)


def is_locked(folder: Path) -> bool:
    """Whether a program, which may be this one, has locked a folder."""
    try:
        with open(folder / LOCK, "rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # there is no lock, or this file system has none
        pass
    return False


def remove_partial(folder: Path) -> None:
    """Removes half-written files of a killed program from a folder, and from folders in it that are not locked."""
    inner = (leftover for leftover in folder.glob(f"*/{PARTIAL}*") if not is_locked(leftover.parent))
    for leftover in (*folder.glob(f"{PARTIAL}*"), *inner):
        if not leftover.is_dir():
            leftover.unlink(missing_ok=True)


def is_own(folder: Path) -> bool:
    """Whether :func:`own_folder` made a folder."""
    return not folder.is_symlink() and (folder / MARK).is_file()


def refuse_foreign(folder: Path) -> None:
    """Raises InputError where a folder holds files, but :func:`own_folder` did not make it."""
    if folder.is_symlink() or (
        folder.exists() and not is_own(folder) and (not folder.is_dir() or any(folder.iterdir()))
    ):
        raise InputError(f"{folder}: holds other files, which would be replaced; move them, or give another --out")


def own_folder(folder: Path, purpose: str = "") -> None:
    """Makes a folder that the program may empty, and empties the one that it made before, but for the same purpose,
    unless that is "". Raises InputError where the folder holds other files."""
    refuse_foreign(folder)
    mark = folder / MARK
    if is_own(folder):
        if purpose and mark.read_text(encoding="utf-8", errors="replace") == purpose:
            return
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with atomic_path(mark) as temporary:
        temporary.write_text(purpose, encoding="utf-8")


def refuse_others(result: Path, words: bytes, *beside: Path, option: str = "--out") -> None:
    """Raises InputError where a result, or a file written beside it, would replace another file: one is there that is not
    empty, and the result does not have its `words` near its beginning."""
    begin = result.open("rb").read(4096) if result.is_file() else b""
    for path in (result, *beside):
        if os.path.lexists(path) and not (path.is_file() and (words in begin or path.stat().st_size == 0)):
            raise InputError(f"{path}: is not an earlier result, and would be replaced; give another {option}")


def reason(error: OSError) -> str:
    """The message of a system error, without its number."""
    return error.strerror or str(error)


def _acquired(path: Path) -> TextIO:
    """The lock file at a path, locked, with this program's pid. Raises InputError where another program has it or the
    file is something else, OSError where it cannot be written."""
    while True:
        if path.is_symlink():
            raise InputError(f"{path}: is a link, and no lock of this program; remove it, or give another --out")
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW
        lock = open(os.open(path, flags, 0o666), "a+", encoding="utf-8", errors="replace")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            owner = lock.read().strip() or "another program"
            lock.close()
            raise InputError(f"{path.parent}: is in use by {owner}; wait for its end, or give another --out") from None
        except OSError as error:
            note(f"{path}: this file system has no locks ({reason(error)}); start no second run in the folder")
        if _is_at(lock, path):
            break
        lock.close()  # its owner ended and removed it in between
    lock.seek(0)
    if lock.read(len(OWNER)) not in ("", OWNER):
        lock.close()
        raise InputError(f"{path}: is no lock of this program; move it away, or give another --out")
    try:
        lock.truncate(0)
        lock.write(f"{OWNER}{os.getpid()} on {socket.gethostname()}\n")
        lock.flush()
    except OSError:
        path.unlink(missing_ok=True)
        with suppress(OSError):
            lock.close()
        raise
    return lock


def _is_at(lock: TextIO, path: Path) -> bool:
    """Whether the open file is the one at the path."""
    try:
        return os.path.samestat(os.fstat(lock.fileno()), os.stat(path))
    except FileNotFoundError:
        return False


def _check_locked(path: Path) -> None:
    """Raises OSError where a folder of the path that this program has locked was removed or replaced."""
    parent = path.parent.resolve()
    for folder, lock in _locks.items():
        if folder in (parent, *parent.parents) and not _is_at(lock, folder / LOCK):
            raise OSError(f"{folder}: was removed while it was written to; nothing more is written there")


def _synchronise(path: Path) -> None:
    """Waits until a file, or the names in a folder, are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _remove_empty(folders: list[Path]) -> None:
    """Removes folders, the innermost first, until one is not empty."""
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()
