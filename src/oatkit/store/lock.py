"""One writer for one output: a lock that ends with the process that holds it, however that ends."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from oatkit.errors import ResultError

try:
    import fcntl
except ImportError:  # Windows, where there is no lock
    fcntl = None  # type: ignore[assignment]

ENDING = ".lock"


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of an output, a hidden file beside it, while the block runs.

    Raises `ResultError` where another process holds it, with who that is. A lock that was left behind by a process that
    was killed is free. On Windows, and on a file system that knows no locks, there is none.
    """
    path = path.absolute()
    file = path.with_name(f".{path.name}{ENDING}")
    try:
        handle = _taken(file)
    except BlockingIOError:
        raise ResultError(f"{path}: is being written by {_owner(file)}") from None
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {error.strerror or error}") from error
    try:
        yield
    finally:
        # First the name, then the lock: nobody can lock a file that is about to vanish without noticing.
        file.unlink(missing_ok=True)
        os.close(handle)


def _taken(file: Path) -> int:
    """Return a handle that holds the lock of `file`. Raises `BlockingIOError` where somebody has it."""
    while True:
        handle = os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o644)
        try:
            _lock(handle)
            if _is_still(file, handle):
                os.ftruncate(handle, 0)
                os.pwrite(handle, _me().encode(), 0) if hasattr(os, "pwrite") else os.write(handle, _me().encode())
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # its holder has just removed it


def _lock(handle: int) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # a file system without locks
        return


def _is_still(file: Path, handle: int) -> bool:
    """Say whether the file that a handle belongs to still has its name."""
    try:
        return os.path.samestat(os.stat(file), os.fstat(handle))
    except FileNotFoundError:
        return False


def _me() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}, since {datetime.now():%Y-%m-%d %H:%M}"


def _owner(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8", errors="replace") or "another process"
    except OSError:
        return "another process"
