"""The diary of a result in the making: what is on the disk for good, so that an interrupted run can go on.

A text file beside the unfinished folder with one line for each thing that was done, in order; each line begins with the
SHA-256 of the rest. What was written when the power failed is a line that does not match: it and all after it are
dropped.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal, Self

from pydantic import Field
from pydantic import ValidationError as Invalid

from oatkit.atomic import sync
from oatkit.plain import encode
from oatkit.store.manifest import Entry, FileEntry, FrameEntry, FrameKey, ImageEntry, ImageName, Plain, digest


class Begun(Entry):
    """The first line: what the result is of, and what all its frames have in common."""

    what: Literal["begun"] = "begun"
    run: Plain
    """Who asked for what: compared when the run goes on."""
    common: Plain
    images: dict[ImageName, ImageEntry]
    files: dict[str, FileEntry]


class Written(Entry):
    """A frame that is on the disk."""

    what: Literal["written"] = "written"
    index: FrameKey
    record: FrameEntry
    files: dict[str, FileEntry]


class Failed(Entry):
    """A frame that has no images."""

    what: Literal["failed"] = "failed"
    index: FrameKey
    reason: str


Line = Begun | Written | Failed


class _Any(Entry):
    line: Line = Field(discriminator="what")


def add(path: Path, line: Line) -> None:
    """Bring one line to the end of a diary and to the disk."""
    body = json.dumps(encode({"line": line.model_dump()}, "result"), allow_nan=False).encode()
    with path.open("ab") as file:
        file.write(_sealed(body))
        file.flush()
        os.fsync(file.fileno())
    sync(path.parent)


class Story:
    """What a diary tells: the head, and the frames whose files are as they were written."""

    def __init__(self, head: Begun, written: Mapping[str, Written], failed: Mapping[str, str]) -> None:
        self.head, self.written, self.failed = head, written, failed

    @classmethod
    def read(cls, path: Path, folder: Path) -> Self | None:
        """Read the diary of a folder, and cut off what is torn; None where there is nothing to go on from."""
        if path.is_symlink() or not path.is_file():
            return None
        lines, good = _lines(path)
        if not lines or not isinstance(lines[0], Begun) or not _intact(folder, lines[0].files):
            return None
        os.truncate(path, good)
        written = {line.index: line for line in lines if isinstance(line, Written) and _intact(folder, line.files)}
        return cls(lines[0], written, {line.index: line.reason for line in lines if isinstance(line, Failed)})

    @property
    def frames(self) -> int:
        """How many frames need not be run again."""
        return len(self.written) + len(self.failed)


def _lines(path: Path) -> tuple[list[Line], int]:
    """Return the lines up to the first torn one, and how many bytes they take."""
    found: list[Line] = []
    good = 0
    for sealed, line in _unsealed(path):
        found.append(line)
        good += len(sealed)
    return found, good


def _unsealed(path: Path) -> Iterator[tuple[bytes, Line]]:
    with path.open("rb") as file:
        for sealed in file:
            body = sealed[65:-1]
            if sealed != _sealed(body):
                return
            try:
                yield sealed, _Any.model_validate_json(body).line
            except Invalid:  # of a newer version
                return


def _sealed(body: bytes) -> bytes:
    return hashlib.sha256(body).hexdigest().encode() + b" " + body + b"\n"


def _intact(folder: Path, files: Mapping[str, FileEntry]) -> bool:
    try:
        return all(digest(folder / name) == entry for name, entry in files.items())
    except OSError:
        return False
