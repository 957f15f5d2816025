"""What the windows show and change: a scan, a pipeline, a frame, and what came out. No Qt, no napari."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.data import Image, Scan
from oatkit.engine import run_resolved
from oatkit.engine.rules import resolve
from oatkit.errors import ValidationError
from oatkit.events import Event, StepIterate
from oatkit.gui.document import PipelineDocument
from oatkit.gui.job import Job
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.quantification import STEPS
from oatkit.reading import read
from oatkit.result import Result

SLOTS = ("preprocess", "forward", "reconstruct", *STEPS)
"""The steps of a pipeline in their order."""


@dataclass(frozen=True)
class Converging:
    """The numbers of a solver's step; its image is the job's `newest`."""

    wavelength_nm: float
    iteration: int
    residual_norm: float
    relative_gap: float
    negative_share: float
    """Of all pixels, 0 .. 1."""


@dataclass(frozen=True)
class Finished:
    """A run came to its end."""

    result: Result


@dataclass
class Session:
    """One scan and one pipeline, worked on together."""

    document: PipelineDocument = field(default_factory=lambda: PipelineDocument.of_preset("maxent"))
    scan: Scan | None = None
    frame: int = 0
    memo: Memo = field(default_factory=Memo)
    result: Result | None = None
    """Of the last run that came to its end."""

    @property
    def pipeline(self) -> Pipeline:
        """The pipeline as it stands."""
        return self.document.pipeline

    def open_scan(self, path: str | Path) -> Scan:
        """Open a scan and go to its first frame. Raises `ReadError`."""
        self.take_scan(scan := read(path))
        return scan

    def take_scan(self, scan: Scan) -> None:
        """Work on a scan that is at hand, beginning with its first frame."""
        self.scan, self.frame, self.result = scan, 0, None

    def go_to_frame(self, frame: int) -> None:
        """Take another frame of the scan. Raises `ValidationError` where there is none."""
        if self.scan is None or not 0 <= frame < self.scan.frames:
            raise ValidationError(
                f"frame {frame}: the scan has frames 0 .. {(self.scan.frames if self.scan else 0) - 1}"
            )
        self.frame = frame

    def run(self, up_to: str | None = None) -> Job:
        """Start a job that yields the events of running the pipeline over the frame, and `Finished` at its end.

        `up_to` names the last step to run. What was computed before and has not changed is not computed again. Raises
        `ValidationError` where there is no scan.
        """
        scan, frame, asked = self._scan(), self.frame, _up_to(self.pipeline, up_to)
        # The unmixer finds the calibration of the absorption, also where it is not run itself.
        ruled = self.pipeline if asked.absorption else asked

        def work(job: Job) -> Iterator[Any]:
            def tell(event: Event) -> None:
                job.check()
                if isinstance(event, StepIterate):
                    # Images would pile up where a window is slow: of them only the newest waits.
                    job.newest = event
                    job.show(_numbers(event))
                else:
                    job.show(event)

            found = resolve(ruled, scan, self.memo, tell, frame)
            resolved = replace(found, pipeline=_up_to(found.pipeline, up_to), requested=asked)
            job.check()
            result = run_resolved(resolved, scan, frame, self.memo, tell)
            job.check()
            self.result = result
            yield Finished(result)

        return Job(work).start()

    def _scan(self) -> Scan:
        if self.scan is None:
            raise ValidationError("no scan is open: drag one into the window, or open the sample")
        return self.scan


def _numbers(event: StepIterate) -> Converging:
    state = event.iterate
    return Converging(
        event.wavelength_nm,
        state.iteration,
        state.residual_norm,
        state.relative_gap,
        float(np.mean(np.asarray(state.image) < 0)),
    )


def image_of(event: StepIterate, pipeline: Pipeline) -> Image:
    """Return the image of a solver's step, to look at while it converges."""
    values = np.asarray(event.iterate.image, dtype=np.float32)
    return Image(values, "initial_pressure", "a.u.", pipeline.grid.grid(), (event.wavelength_nm,))


def _up_to(pipeline: Pipeline, last: str | None) -> Pipeline:
    """Return the pipeline without the steps after `last`."""
    if last is None:
        return pipeline
    later = SLOTS[SLOTS.index(last) + 1 :]
    return pipeline.model_copy(update={slot: None for slot in later if slot in STEPS})
