"""Reading a file with whichever installed reader claims it: its scan, finished images, regions of interest."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from oatkit.api import Reader, Region
from oatkit.blame import blame
from oatkit.data import Image, Scan
from oatkit.errors import ReadError
from oatkit.registry import installed

RESULT = "manifest.json"
"""The file that every folder of a result has."""


def read(path: str | Path, reader: Reader | None = None) -> Scan:
    """Return the scan in `path`, its signals lazily where the format allows.

    Without `reader`, the one installed reader that claims the file. Raises `ReadError` where the file is missing,
    damaged, claimed by no reader, or claimed by several (it names them).
    """
    with blame(reader := reader or _reader_of(Path(path))):
        return reader.read(Path(path))


def read_images(path: str | Path, reader: Reader | None = None) -> Mapping[str, Sequence[Image]]:
    """Return the finished images in or beside a file by name, each with one image for each frame, read when asked for.

    Raises as `read` does.
    """
    with blame(reader := reader or _reader_of(Path(path))):
        return reader.images(Path(path))


def read_regions(path: str | Path, reader: Reader | None = None) -> tuple[Region, ...]:
    """Return the regions of interest in or beside a file. Raises as `read` does."""
    with blame(reader := reader or _reader_of(Path(path))):
        return reader.regions(Path(path))


def _reader_of(path: Path) -> Reader:
    if not _exists(path):
        raise ReadError(f"{path}: no such file or folder")
    readers = [make() for make in installed().of_kind("reader")]
    claiming, failed = [], []
    for reader in readers:
        assert isinstance(reader, Reader)
        try:
            if reader.can_read(path):
                claiming.append(reader)
        except Exception as error:  # somebody's reader must not keep the others from reading
            failed.append(f"; reader '{reader.name}' failed: {type(error).__name__}: {error}")
    if len(claiming) > 1:
        names = " and ".join(reader.name for reader in claiming)
        raise ReadError(f"{path}: the readers {names} both claim this file; hand one of them to read()")
    if not claiming:
        known = ", ".join(reader.name for reader in readers)
        raise ReadError(f"{path}: {_unknown(path)} (readers: {known}){''.join(failed)}")
    return claiming[0]


def _unknown(path: Path) -> str:
    """Say that nobody reads a file, and what may have been meant."""
    if (path / RESULT).is_file():
        return "a result of a run, not a scan; `oatkit report`, `oatkit roi` and `oatkit export` take it"
    if path.is_dir():
        return "no installed reader knows this folder; name the file of the scan in it"
    if path.suffix.lower() in (".npy", ".tif", ".tiff"):
        return "an array without a description; write a small .toml beside it, as the page on file formats shows"
    empty = path.is_file() and not path.stat().st_size
    return "the file is empty" if empty else "no installed reader knows this file"


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name too long, or with a NUL byte
        return False
