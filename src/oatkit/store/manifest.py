"""The manifest of a result folder: how the images came about, and a checksum of every file.

``manifest.json`` is a JSON object with two keys, ``sha256`` and ``manifest``; the checksum is of the bytes of the
second one's value, so the manifest vouches for itself too.
"""

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints, model_validator
from pydantic import ValidationError as Invalid

from oatkit.atomic import sync
from oatkit.data import Grid, Image
from oatkit.errors import ResultError
from oatkit.plain import decode, encode
from oatkit.result import Result

FILE_NAME = "manifest.json"
FORMAT = "oatkit-result"
VERSION = 1
BY_FRAME = ("pipeline", "scan", "weight_choice", "speed_choice", "calibration_choice")
"""What frames may have of their own, where the pipeline's ``scan.rules`` is "frame"."""
LARGEST_MANIFEST = 2**28
"""Bytes; more is not read."""

Plain = Annotated[dict[str, Any], BeforeValidator(decode)]
Size = Annotated[int, Field(ge=1, le=100_000)]
ImageName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]
"""Images name folders, so a name is nothing but letters, digits, ``_`` and ``-``."""
FrameKey = Annotated[str, StringConstraints(pattern=r"^(0|[1-9][0-9]{0,6})$")]
"""Keys of JSON are text: the number of a frame within the result."""


class Entry(BaseModel):
    """A part of what a result folder says of itself: strict, and frozen."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")


class FileEntry(Entry):
    """What a file was when it was written."""

    size: int
    sha256: str


class GridEntry(Entry):
    """A `Grid`."""

    shape: tuple[Size, Size]
    pixel_size_m: float
    centre_m: tuple[float, float]

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.grid()
        return self

    def grid(self) -> Grid:
        """Return the grid itself; raises `oatkit.errors.ValidationError` where there can be none."""
        return Grid(self.shape, self.pixel_size_m, self.centre_m)


class ImageEntry(Entry):
    """What the images of one name have in common in all frames."""

    quantity: str
    unit: str
    dtype: Literal["float32", "float64"]
    wavelengths_nm: Annotated[tuple[float, ...], Field(max_length=100_000)]
    grid: GridEntry

    @classmethod
    def of(cls, image: Image) -> "ImageEntry":
        """Describe `image`."""
        grid = image.grid
        return cls(
            quantity=image.quantity,
            unit=image.unit,
            dtype="float32" if image.values.dtype == np.float32 else "float64",
            wavelengths_nm=image.wavelengths_nm,
            grid=GridEntry(shape=grid.shape, pixel_size_m=grid.pixel_size_m, centre_m=grid.centre_m),
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """``(wavelength, y, x)``."""
        return (max(1, len(self.wavelengths_nm)), *self.grid.shape)


class MadeEntry(Entry):
    """How one image of one frame was made."""

    history: tuple[Plain, ...]
    diagnostics: Plain


class FrameEntry(Entry):
    """What differs between frames."""

    frame_index: int
    time_s: float | None = None
    """Mean time of its pulses, s."""
    seconds: Plain
    warnings: tuple[str, ...]
    images: dict[str, MadeEntry]
    own: Plain = Field(default_factory=dict)
    """Pipeline as run and choices of its numbers, where they are not those of the manifest."""

    @classmethod
    def of(cls, result: Result, own: dict[str, Any]) -> "FrameEntry":
        """Describe `result`, in plain values only; raises `ResultError` where something cannot be stored."""
        made = {name: {"history": image.history, "diagnostics": image.diagnostics} for name, image in result.items()}
        frame = {
            "frame_index": result.frame_index,
            "time_s": result.time_s,
            "seconds": result.seconds,
            "warnings": result.warnings,
            "images": made,
            "own": own,
        }
        return cls.model_validate_json(json.dumps(encode(frame, f"frame {result.frame_index}")))


class Manifest(Entry):
    """All that is known about a result folder."""

    format: Literal["oatkit-result"] = "oatkit-result"
    version: Literal[1] = 1
    row_0: Literal["bottom"] = "bottom"
    """Where the first row of every image lies: y points up."""
    frames: Annotated[int, Field(ge=1, le=9_999_999)]
    """Number of frames, failed ones included."""
    requested: Plain
    pipeline: Plain
    versions: Plain
    scan: Plain
    weight_choice: Plain
    speed_choice: Plain = Field(default_factory=dict)
    calibration_choice: Plain = Field(default_factory=dict)
    images: dict[ImageName, ImageEntry]
    records: dict[FrameKey, FrameEntry]
    """By the number of the frame in this result."""
    failed: dict[FrameKey, str]
    """Reasons, likewise; such a frame has no chunks, and reads as NaN in programs that do not know of this."""
    files: dict[str, FileEntry]
    """All files of the folder but this one, by their path from it."""


class _Head(BaseModel):
    format: str = ""
    version: int = 0


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write the manifest of `folder` and bring it to the disk."""
    body = json.dumps(encode(manifest.model_dump(), "result"), allow_nan=False, indent=1)
    path = folder / FILE_NAME
    path.write_bytes(_seal(body.encode()))
    sync(path)


def read_manifest(folder: Path) -> Manifest:
    """Read and check the manifest of `folder`. Raises `ResultError`; the folder's other files are not looked at."""
    body = _unseal(folder, _read(folder))
    try:
        head = _Head.model_validate_json(body)
        if head.format == FORMAT and head.version > VERSION:
            raise ResultError(
                f"{folder}: format version {head.version} is newer than {VERSION}, the last that this oatkit reads"
            )
        return Manifest.model_validate_json(body)
    except Invalid as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise ResultError(f"{folder / FILE_NAME}: not a valid manifest: {where}: {first['msg']}") from error


def chunk_file(image: str, index: int) -> str:
    """Return the path of one image of frame `index` within the folder."""
    return f"{image}/c/{index}/0/0/0"


def digest(path: Path) -> FileEntry:
    """Return size and checksum of a file."""
    with path.open("rb") as file:
        return FileEntry(sha256=hashlib.file_digest(file, "sha256").hexdigest(), size=file.tell())


def _read(folder: Path) -> bytes:
    path = folder / FILE_NAME
    if not folder.exists():
        raise ResultError(f"{folder}: there is no such result")
    if path.is_symlink() or not path.is_file():
        raise ResultError(f"{folder}: no oatkit result: it has no file {FILE_NAME}")
    if path.stat().st_size > LARGEST_MANIFEST:
        raise ResultError(f"{path}: larger than {LARGEST_MANIFEST >> 20} MiB, so it is not read")
    try:
        return path.read_bytes()
    except OSError as error:
        raise ResultError(f"{path}: could not be read: {error.strerror or error}") from error


def _seal(body: bytes) -> bytes:
    return b'{"sha256": "%b",\n"manifest": %b}\n' % (hashlib.sha256(body).hexdigest().encode(), body)


_BODY = slice(len(_seal(b"")) - 2, -2)


def _unseal(folder: Path, content: bytes) -> bytes:
    body = content[_BODY]
    if _seal(body) != content:
        raise ResultError(f"{folder / FILE_NAME}: damaged: its content does not match its checksum")
    return body
