"""Writing a result folder; `oatkit.store` describes it."""

import os
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from pydantic import TypeAdapter
from pydantic import ValidationError as Invalid

from oatkit.atomic import check_output, check_space, new_folder, sync
from oatkit.data import Image
from oatkit.errors import ResultError, ValidationError
from oatkit.plain import decode, encode
from oatkit.result import Result
from oatkit.store.arrays import attributes, create_array
from oatkit.store.journal import Begun, Failed, Line, Story, Written, add
from oatkit.store.lock import locked
from oatkit.store.manifest import (
    BY_FRAME,
    FILE_NAME,
    FileEntry,
    FrameEntry,
    ImageEntry,
    ImageName,
    Manifest,
    chunk_file,
    digest,
    write_manifest,
)
from oatkit.store.unfinished import Unfinished

_COMMON = ("pipeline", "requested", "versions", "scan", "weight_choice", "speed_choice", "calibration_choice")
"""What is stored once for all frames, from the first one written."""


class StoreWriter:
    """Writes a result folder frame by frame, in any order::

        with StoreWriter("out.zarr", frames=scan.frames, source=scan.source) as writer:
            for i in range(scan.frames):
                writer.write(i, run(pipeline, scan, frame=i))

    The folder takes its name when the block ends well; an exception (Ctrl-C too) leaves nothing. `source` is the path
    of the input, which the output may not touch. Raises `ResultError` on entering where the output exists already and
    `overwrite` is not asked for, cannot be written or is being written by somebody else; only a result folder is ever
    overwritten.

    With `run` (plain values that say who asked for what) the frames that are done stay in a hidden folder when an
    exception, a kill or a power cut ends the block. Entered once more, with `resume`, the writer knows them (`done`)
    and takes the others; without it, it refuses to throw them away unless `overwrite` is asked for. Raises
    `ValidationError` where they are of another run.
    """

    def __init__(
        self,
        path: str | Path,
        frames: int = 1,
        source: str = "",
        overwrite: bool = False,
        run: Mapping[str, Any] | None = None,
        resume: bool = False,
    ) -> None:
        if not frames >= 1:
            raise ValidationError(f"{path}: a result has at least one frame, got {frames}")
        self.path = Path(path)
        self.frames = frames
        self._source, self._overwrite, self._resume = source, overwrite, resume
        self._unfinished = Unfinished(self.path, run) if run is not None else None
        self._stack = ExitStack()
        self._arrays: dict[str, Any] = {}
        self._common: dict[str, Any] = {}
        self._images: dict[str, ImageEntry] = {}
        self._records: dict[str, FrameEntry] = {}
        self._failed: dict[str, str] = {}
        self._files: dict[str, FileEntry] = {}

    @property
    def done(self) -> set[int]:
        """Frames that are written, or known to have failed."""
        return {int(index) for index in (*self._records, *self._failed)}

    @property
    def written(self) -> int:
        """How many frames have images."""
        return len(self._records)

    @property
    def common(self) -> Mapping[str, Any]:
        """What all frames have in common: ``pipeline`` as run, choices, ...; empty before the first is written."""
        return decode(self._common)

    def __enter__(self) -> Self:
        check_output(self.path, [self._source], self._overwrite)
        with ExitStack() as stack:
            stack.enter_context(locked(self.path))
            check_output(self.path, overwrite=self._overwrite)  # another run may have ended while we came here
            if os.path.lexists(self.path) and not _looks_like_a_result(self.path):
                raise ResultError(f"{self.path}: is no oatkit result, so it is not overwritten; choose another name")
            story = self._unfinished.story(self.frames, self._resume, self._overwrite) if self._unfinished else None
            hidden = self._unfinished.folder if self._unfinished else None
            self._folder = stack.enter_context(new_folder(self.path, self._overwrite, hidden, self._worth_keeping))
            if story is not None:
                self._take_up(story)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        if kind is not None:
            return self._stack.__exit__(kind, error, trace)
        with self._stack:
            self._finish()
        if self._unfinished is not None:
            self._unfinished.journal.unlink(missing_ok=True)
        return None

    def write(self, index: int, result: Result) -> None:
        """Write `result` as frame `index` of the folder.

        Raises `ResultError` where the frame was written before, differs from the others in names, shapes, units or
        pipeline, holds a value that is not finite (NaN is allowed in all but the initial pressure: absorption has no
        value outside the body), or cannot be written.
        """
        self._check_new(index)
        for name, image in result.items():
            _check_values(f"frame {index}: {name}", image)
        try:
            if not self._arrays:
                self._begin(result)
            self._check_alike(index, result)
            record = FrameEntry.of(result, self._own(result))
            for name, image in result.items():
                self._arrays[name][index] = image.values
                self._seal(chunk_file(name, index))
            self._note(Written(index=str(index), record=record, files=self._chunks(result, index)))
        except OSError as error:
            raise ResultError(f"{self.path}: could not be written: {error.strerror or error}") from error
        self._records[str(index)] = record

    def fail(self, index: int, reason: str) -> None:
        """Record that frame `index` has no images, and why."""
        self._check_new(index)
        if self._common:  # before the first frame with images there is no diary; such frames are run again
            self._note(Failed(index=str(index), reason=reason))
        self._failed[str(index)] = reason

    def _check_new(self, index: int) -> None:
        if not 0 <= index < self.frames:
            raise ResultError(f"{self.path}: frame {index} is not one of 0 .. {self.frames - 1}")
        if str(index) in self._records or str(index) in self._failed:
            raise ResultError(f"{self.path}: frame {index} was written already")

    def _begin(self, result: Result) -> None:
        """Make the arrays, with the shapes and the provenance of the first frame."""
        import zarr

        if not result:
            raise ResultError(f"{self.path}: the result holds no image")
        self._common = {key: encode(getattr(result, key), key) for key in _COMMON}
        self._images = {_checked(name): ImageEntry.of(image) for name, image in result.items()}
        check_space(self.path, self.frames * sum(image.values.nbytes for image in result.values()))
        group = zarr.create_group(self._folder, zarr_format=3, attributes=attributes(self._images))
        self._seal("zarr.json")
        for name, entry in self._images.items():
            self._arrays[name] = create_array(group, name, entry, self.frames)
            self._seal(f"{name}/zarr.json")
        if self._unfinished is not None:
            run = encode(self._unfinished.run)
            self._note(Begun(run=run, common=self._common, images=self._images, files=dict(self._files)))

    def _take_up(self, story: Story) -> None:
        """Go on with the frames of an interrupted run."""
        import zarr

        head = story.head
        self._common, self._images = {key: encode(value) for key, value in head.common.items()}, dict(head.images)
        self._files = dict(head.files)
        for index, frame in story.written.items():
            self._records[index] = frame.record
            self._files |= frame.files
        self._failed = dict(story.failed)
        # zarr would try to read what is there of a frame before it writes it anew, and it may be torn.
        for path in self._folder.rglob("*"):
            if path.is_file() and path.relative_to(self._folder).as_posix() not in self._files:
                path.unlink()
        group: Any = zarr.open_group(self._folder, mode="r+", zarr_format=3, use_consolidated=False)
        self._arrays = {name: group[name] for name in self._images}

    def _note(self, line: Line) -> None:
        """Write a line into the diary, where there is one."""
        if self._unfinished is not None:
            add(self._unfinished.journal, line)

    def _worth_keeping(self) -> bool:
        return self._unfinished is not None and bool(self._records)

    def _chunks(self, result: Result, index: int) -> dict[str, FileEntry]:
        return {file: self._files[file] for file in (chunk_file(name, index) for name in result)}

    def _check_alike(self, index: int, result: Result) -> None:
        if {name: ImageEntry.of(image) for name, image in result.items()} != self._images:
            raise ResultError(
                f"{self.path}: frame {index} differs from the first in images, shapes, wavelengths or units"
            )
        same = ("requested",) if _rules_by_frame(result) else ("requested", "pipeline")
        if any(encode(getattr(result, key)) != self._common[key] for key in same):
            raise ResultError(f"{self.path}: frame {index} comes from another pipeline than the first")

    def _own(self, result: Result) -> dict[str, Any]:
        """Return what this frame does not have in common with the first one."""
        keys = BY_FRAME if _rules_by_frame(result) else ()
        return {key: own for key in keys if (own := encode(getattr(result, key))) != self._common[key]}

    def _begin_with_the_first(self) -> None:
        """Let what frames have in common be what the first one has, in whatever order they came."""
        first = self._records[min(self._records, key=int)].own
        common = {**self._common, **{key: encode(value) for key, value in first.items()}}
        for index, record in self._records.items() if first else ():
            mine = {**{key: self._common[key] for key in first}, **{k: encode(v) for k, v in record.own.items()}}
            own = {key: value for key, value in mine.items() if value != common[key]}
            self._records[index] = record.model_copy(update={"own": decode(own)})
        self._common = common

    def _seal(self, name: str) -> None:
        """Bring a file to the disk and note its checksum."""
        sync(self._folder / name)
        self._files[name] = digest(self._folder / name)

    def _finish(self) -> None:
        missing = [i for i in range(self.frames) if str(i) not in self._records.keys() | self._failed.keys()]
        if missing:
            raise ResultError(
                f"{self.path}: {len(missing)} of {self.frames} frames were not written, the first is {missing[0]}"
            )
        if not self._records:
            raise ResultError(f"{self.path}: no frame gave an image; frame 0: {self._failed['0']}")
        self._begin_with_the_first()
        manifest = Manifest(
            frames=self.frames,
            images=self._images,
            records=self._records,
            failed=self._failed,
            files=self._files,
            **self._common,
        )
        try:
            write_manifest(self._folder, manifest)
            for folder, _, _ in os.walk(self._folder):
                sync(Path(folder))
        except OSError as error:
            raise ResultError(f"{self.path}: could not be written: {error.strerror or error}") from error


def save(result: Result, path: str | Path, overwrite: bool = False) -> None:
    """Write all frames of a result to a folder. Raises `ResultError`."""
    with StoreWriter(path, result.frames, str(result.scan.get("source", "")), overwrite) as writer:
        for index in range(result.frames):
            if index in result.failed:
                writer.fail(index, result.failed[index])
            else:
                writer.write(index, result.frame(index))


def _rules_by_frame(result: Result) -> bool:
    return bool((result.requested.get("scan") or {}).get("rules") == "frame")


def _checked(name: str) -> str:
    try:
        return TypeAdapter(ImageName).validate_python(name)
    except Invalid as error:
        raise ResultError(f"image name {name!r}: expected letters, digits, '_' and '-' only") from error


def _looks_like_a_result(path: Path) -> bool:
    return (path / FILE_NAME).is_file() and not path.is_symlink()


def _check_values(where: str, image: Image) -> None:
    infinite, undefined = int(np.isinf(image.values).sum()), int(np.isnan(image.values).sum())
    if infinite or (undefined and image.quantity == "initial_pressure"):
        raise ResultError(f"{where}: {infinite} infinite and {undefined} undefined pixels; expected finite ones only")
