"""Output that stands under its final name only when it is complete.

All is written to a hidden neighbour first, brought to the disk, and renamed; whoever is killed in between leaves
nothing under the final name.
"""

import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from oatkit.errors import ResultError


def check_output(path: Path, inputs: Iterable[str] = (), overwrite: bool = False) -> None:
    """Raise `ResultError` where `path` must not or cannot be written.

    That is: its folder is missing or read-only, it exists already and `overwrite` is not asked for, or it is, contains
    or lies inside one of `inputs`. Inputs that are no existing path (a simulated scan's) are passed over.
    """
    path = Path(path).absolute()
    if not path.parent.is_dir():
        raise ResultError(f"{path}: its folder does not exist")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise ResultError(f"{path}: its folder is read-only")
    for given in inputs:
        if given and os.path.exists(given):
            _check_apart(path.resolve(), Path(given).resolve())
    if os.path.lexists(path) and not overwrite:
        raise ResultError(f"{path}: exists already; choose another name, or ask to overwrite it")


def check_space(path: Path, size: int) -> None:
    """Raise `ResultError` where fewer than `size` bytes are free on the disk of `path`."""
    free = shutil.disk_usage(Path(path).absolute().parent).free
    if size > free:
        raise ResultError(f"{path}: needs {size / 1e6:,.1f} MB, but only {free / 1e6:,.1f} MB are free on that disk")


def sync(path: Path) -> None:
    """Bring a file or the entries of a folder to the disk."""
    if path.is_dir() and not hasattr(os, "O_DIRECTORY"):
        return  # a system whose folders cannot be opened
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_file(path: Path, content: bytes, overwrite: bool = False) -> None:
    """Write a whole file, or raise `ResultError` and leave what was there."""
    with new_file(path, overwrite) as hidden:
        check_space(path, len(content))
        hidden.write_bytes(content)


@contextmanager
def new_file(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """Yield a hidden path beside `path` for a file that takes this name when the block ends well, else vanishes.

    A file that stands there is replaced if `overwrite`, at the last moment. Raises `ResultError`, also in place of an
    `OSError` in the block.
    """
    path = Path(path).absolute()
    _check_file(path, overwrite)
    hidden = _hidden(path)
    try:
        yield hidden
        sync(hidden)
        _check_file(path, overwrite)
        os.replace(hidden, path)
        sync(path.parent)
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {error.strerror or error}") from error
    finally:
        hidden.unlink(missing_ok=True)


@contextmanager
def new_folder(
    path: Path, overwrite: bool = False, hidden: Path | None = None, worth_keeping: Callable[[], bool] = lambda: False
) -> Iterator[Path]:
    """Yield a hidden folder beside `path` that takes this name when the block ends well, and vanishes otherwise.

    One that is given by its name, `hidden`, may be there already, and stays after an exception where it is
    `worth_keeping`. A folder that stands at `path` is replaced if `overwrite`, at the last moment. Files must be synced
    by who writes them. Raises `ResultError`.
    """
    path = Path(path).absolute()
    made = hidden or _hidden(path)
    try:
        made.mkdir(exist_ok=hidden is not None)
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {error.strerror or error}") from error
    try:
        yield made
        _put_in_place(made, path, overwrite)
    finally:
        if not worth_keeping():
            shutil.rmtree(made, ignore_errors=True)


def _hidden(path: Path) -> Path:
    return path.with_name(f".{path.name}.partial-{os.getpid()}-{secrets.token_hex(3)}")


def _check_file(path: Path, overwrite: bool) -> None:
    check_output(path, overwrite=overwrite)
    if path.is_dir():
        raise ResultError(f"{path}: is a folder, not a file")


def _check_apart(output: Path, given: Path) -> None:
    if output == given:
        raise ResultError(f"{output}: is the input; choose another name for the output")
    if given in output.parents:
        raise ResultError(f"{output}: lies inside the input {given}; choose another place for the output")
    if output in given.parents:
        raise ResultError(f"{output}: contains the input {given}; choose another place for the output")


def _put_in_place(hidden: Path, path: Path, overwrite: bool) -> None:
    check_output(path, overwrite=overwrite)
    old = _hidden(path)
    try:
        if os.path.lexists(path):
            os.rename(path, old)
        os.rename(hidden, path)
        sync(path.parent)
    except OSError as error:
        if old.exists() and not path.exists():
            os.rename(old, path)
        raise ResultError(f"{path}: could not be put in place: {error.strerror or error}") from error
    shutil.rmtree(old, ignore_errors=True)
