"""Reading a scan with whichever installed reader claims the file."""

from pathlib import Path

from oatkit.api import Reader
from oatkit.data import Scan
from oatkit.errors import ReadError
from oatkit.registry import installed


def read(path: str | Path, reader: Reader | None = None) -> Scan:
    """Return the scan in `path`, its signals lazily where the format allows.

    Without `reader`, the one installed reader that claims the file. Raises `ReadError` where the file is missing,
    damaged, claimed by no reader, or claimed by several (it names them).
    """
    path = Path(path)
    if not _exists(path):
        raise ReadError(f"{path}: no such file or folder")
    return (reader or _reader_of(path)).read(path)


def _reader_of(path: Path) -> Reader:
    readers = [make() for make in installed().of_kind("reader")]
    claiming = [r for r in readers if isinstance(r, Reader) and r.can_read(path)]
    names = [r.name for r in claiming]
    if len(claiming) > 1:
        raise ReadError(f"{path}: the readers {' and '.join(names)} both claim this file; hand one of them to read()")
    if not claiming:
        known = ", ".join(r.name for r in readers)
        raise ReadError(f"{path}: no installed reader knows this file (readers: {known})")
    return claiming[0]


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name too long, or with a NUL byte
        return False
