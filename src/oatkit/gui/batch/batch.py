"""Many scans through one pipeline, one after another: each has a result or a reason, and none stops the others."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from oatkit.batch import run_frames
from oatkit.errors import ValidationError
from oatkit.events import Event
from oatkit.gui.job import Cancelled, Job, failure_of
from oatkit.pipeline import Pipeline
from oatkit.reading import read


@dataclass(frozen=True)
class FileStatus:
    """How it stands with one scan."""

    index: int
    """Of the scan in the list."""
    word: str
    """``"running"``, ``"done"`` or ``"failed"``."""
    sentence: str
    details: str = ""
    """Of a failure, to copy."""


def outputs(scans: Sequence[Path], folder: Path) -> list[Path]:
    """Return where the result of each scan goes: its name with ``.zarr``, numbered where names are alike."""
    found: list[Path] = []
    for scan in scans:
        names = (f"{scan.stem}{f'-{n}' if n > 1 else ''}.zarr" for n in range(1, len(scans) + 1))
        found.append(next(folder / name for name in names if folder / name not in found))
    return found


def run_all(pipeline: Pipeline, scans: Sequence[Path], folder: Path, overwrite: bool = False) -> Job:
    """Start a job that runs all frames of each scan into `folder` and yields a `FileStatus` whenever one changes.

    Raises `ValidationError` where there is nothing to run.
    """
    if not scans:
        raise ValidationError("no scan is in the list: add some")

    def work(job: Job) -> Iterator[FileStatus]:
        for index, (scan, output) in enumerate(zip(scans, outputs(scans, folder), strict=True)):
            yield FileStatus(index, "running", "reading")
            try:
                sentence = _run_one(job, index, pipeline, scan, output, overwrite)
            except Cancelled:
                raise
            except BaseException as error:  # a plugin may raise anything, SystemExit too
                failure = failure_of(error)
                yield FileStatus(index, "failed", failure.sentence, failure.details)
            else:
                yield FileStatus(index, "done", sentence)

    return Job(work).start()


def _run_one(job: Job, index: int, pipeline: Pipeline, path: Path, output: Path, overwrite: bool) -> str:
    scan = read(path)
    done = 0

    def check(event: Event) -> None:
        job.check()

    def count(frame: int) -> None:
        nonlocal done
        done += 1
        job.show(FileStatus(index, "running", f"{done} of {scan.frames} frames"))

    result = run_frames(
        pipeline, scan, output, on_event=check, on_frame=count, overwrite=overwrite, resume=not overwrite
    )
    failed = f"; {len(result.failed)} of {result.frames} frames failed" if result.failed else ""
    return f"{output.name}{failed}"
