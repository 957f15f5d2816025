"""A result folder that is read, every file checked before it is used."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.data import Image
from oatkit.errors import ResultError
from oatkit.result import Result
from oatkit.store.manifest import BY_FRAME, FrameEntry, ImageEntry, Manifest, chunk_file, digest, read_manifest

LARGEST_IMAGE = 2**32
"""Bytes of one image of one frame; a folder that declares more is not read."""


@dataclass(frozen=True)
class Store:
    """A result folder whose manifest was read; every file is checked before it is used."""

    path: Path
    manifest: Manifest

    @property
    def count(self) -> int:
        """Number of frames, failed ones included."""
        return self.manifest.frames

    @property
    def failed(self) -> Mapping[int, str]:
        """Why frames failed."""
        return {int(i): reason for i, reason in self.manifest.failed.items()}

    def read(self, index: int) -> Result:
        """Read frame `index`. Raises `ResultError` where it failed, with the reason, or is damaged."""
        record = self.record(index)
        return self._result({name: self.image(index, name) for name in self.manifest.images}, record)

    def first(self) -> Result:
        """Return the result as a whole, showing the first frame that has images; nothing is read yet."""
        index = min(map(int, self.manifest.records), default=0)
        return self._result(StoredImages(self, index), self.manifest.records.get(str(index)), self)

    def record(self, index: int) -> FrameEntry:
        """Return the provenance of frame `index`; raises as `read` does."""
        if str(index) in self.manifest.failed:
            raise ResultError(f"{self.path}: frame {index} failed: {self.manifest.failed[str(index)]}")
        if str(index) not in self.manifest.records:
            raise ResultError(f"{self.path}: the manifest does not know frame {index}")
        return self.manifest.records[str(index)]

    def when(self, index: int) -> tuple[int, float | None]:
        """Return which frame of the scan frame `index` is, and its time, s; raises as `read` does."""
        record = self.record(index)
        return record.frame_index, record.time_s

    def image(self, index: int, name: str) -> Image:
        """Read one image of frame `index`; raises as `read` does."""
        made, entry, file = self.record(index).images.get(name), self.manifest.images[name], chunk_file(name, index)
        if made is None:
            raise ResultError(f"{self.path}: the manifest does not know image '{name}' of frame {index}")
        check_file(self.path, file, self.manifest)
        array = self.arrays[name]
        try:
            values = array[index]
        except Exception as error:  # whatever a forged file makes zarr do
            raise ResultError(f"{self.path / file}: could not be decoded: {error}") from error
        grid = entry.grid.grid()
        return Image(values, entry.quantity, entry.unit, grid, entry.wavelengths_nm, made.history, made.diagnostics)

    @cached_property
    def arrays(self) -> Mapping[str, Any]:
        """The zarr arrays by name; raises `ResultError` where their metadata are damaged or not those declared."""
        import zarr

        for name in ("zarr.json", *(f"{image}/zarr.json" for image in self.manifest.images)):
            check_file(self.path, name, self.manifest)
        try:
            group = zarr.open_group(self.path, mode="r", zarr_format=3, use_consolidated=False)
            arrays: dict[str, Any] = {name: group[name] for name in self.manifest.images}
        except Exception as error:  # whatever a forged file makes zarr do
            raise ResultError(f"{self.path}: no zarr group with the images of the manifest: {error}") from error
        for name, array in arrays.items():
            _check_declared(f"{self.path / name}", array, self.manifest.images[name], self.count)
        return arrays

    def _result(self, images: Mapping[str, Image], record: FrameEntry | None, stored: "Store | None" = None) -> Result:
        manifest = self.manifest
        own = record.own if record else {}
        return Result(
            images,
            requested=manifest.requested,
            versions=manifest.versions,
            seconds=record.seconds if record else {},
            warnings=record.warnings if record else (),
            frame_index=record.frame_index if record else 0,
            time_s=record.time_s if record else None,
            stored=stored,
            **{key: own.get(key, getattr(manifest, key)) for key in BY_FRAME},
        )


@dataclass(frozen=True, eq=False)
class StoredImages(Mapping[str, Image]):
    """The images of one frame of a folder, each read when it is asked for and then kept."""

    store: Store
    index: int
    known: dict[str, Image] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Image:
        if name not in self.known:
            self.known[name] = self.store.image(self.index, name)
        return self.known[name]

    def __contains__(self, name: object) -> bool:
        return name in self.store.manifest.images

    def __iter__(self) -> Iterator[str]:
        return iter(self.store.manifest.images)

    def __len__(self) -> int:
        return len(self.store.manifest.images)


def load(path: str | Path) -> Result:
    """Open a result folder, its images to be read when they are asked for.

    Raises `ResultError` where it is none, its metadata are damaged, or it is of a newer format; a damaged image is
    found when it is read.
    """
    store = Store(Path(path), read_manifest(Path(path)))
    store.arrays  # noqa: B018  checks the metadata
    return store.first()


def check_file(folder: Path, name: str, manifest: Manifest) -> None:
    """Raise `ResultError` unless a file of the result is there, inside it, and as it was written."""
    path, expected = folder / name, manifest.files.get(name)
    if expected is None:
        raise ResultError(f"{path}: not in the manifest")
    if path.resolve() != folder.resolve() / name:
        raise ResultError(f"{path}: a link, which a result does not hold")
    try:
        found = digest(path)
    except OSError as error:
        raise ResultError(f"{path}: could not be read: {error.strerror or error}") from error
    if found.size != expected.size:
        raise ResultError(f"{path}: damaged: {found.size} bytes, {expected.size} were written")
    if found.sha256 != expected.sha256:
        raise ResultError(f"{path}: damaged: its content does not match its checksum")


def _check_declared(where: str, array: Any, entry: ImageEntry, frames: int) -> None:
    """Raise `ResultError` unless a zarr array is what the manifest says, and of a size that can be read."""
    found = (str(array.dtype), array.shape, array.shards)
    expected = (entry.dtype, (frames, *entry.shape), (1, *entry.shape))
    if found != expected:
        raise ResultError(f"{where}: dtype, shape and shards are {found}, the manifest says {expected}")
    if np.prod(entry.shape, dtype=float) * array.dtype.itemsize > LARGEST_IMAGE:
        raise ResultError(
            f"{where}: an image of {entry.shape} is larger than {LARGEST_IMAGE >> 30} GiB, so it is not read"
        )
