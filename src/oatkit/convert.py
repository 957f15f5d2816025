"""Writing a scan in a format for other programs, or in oatkit's own."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from oatkit.data import Scan
from oatkit.errors import ValidationError
from oatkit.ipasc import write_ipasc
from oatkit.scanfile import write_scan


def convert(scan: Scan, file: str | Path, overwrite: bool = False) -> tuple[str, ...]:
    """Write a scan in the format that the name asks for; return, in sentences, what that format cannot hold.

    Signals that lie in a file are read as they are written. Raises `ValidationError` for a name whose ending is not
    among `FORMATS`, and `ResultError` where the file exists and `overwrite` is not asked for, or cannot be written.
    """
    file = Path(file)
    write = FORMATS.get(file.suffix.lower())
    if write is None:
        known = ", ".join(f"{ending} ({words})" for ending, words in DESCRIPTIONS.items())
        raise ValidationError(f"{file}: the name must end in one of {known}")
    return write(scan, file, overwrite)


def _scan_file(scan: Scan, file: Path, overwrite: bool) -> tuple[str, ...]:
    write_scan(scan, file, overwrite=overwrite)
    return ()


FORMATS: Mapping[str, Callable[[Scan, Path, bool], tuple[str, ...]]] = MappingProxyType(
    {".h5": _scan_file, ".hdf5": write_ipasc}
)
"""Endings of file names, and what writes such a file."""
DESCRIPTIONS: Mapping[str, str] = MappingProxyType({".h5": "oatkit's scan file", ".hdf5": "IPASC"})
"""The same endings in words."""
