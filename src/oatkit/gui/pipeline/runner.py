"""Runs the pipeline of a session beside the window, and tells the window what happens, in its own thread."""

from time import monotonic
from typing import Any

from qtpy.QtCore import QObject, QTimer, Signal

from oatkit.errors import OatkitError
from oatkit.gui.job import Failure, Job
from oatkit.gui.pipeline.ledger import Ledger
from oatkit.gui.pipeline.run_log import RunLog
from oatkit.gui.session import Session

PERIOD_MS = 40
"""Between two looks at what the job has yielded."""


class Runner(QObject):
    """One run at a time."""

    progressed = Signal()
    """Something was told; not sent where nothing was."""
    iterated = Signal(object)
    """A solver has taken a step: its newest `StepIterate`, none twice."""
    ended = Signal()
    """The run is over, in whatever way; see `failure`, `log` and `running`."""

    def __init__(self, session: Session, parent: Any = None) -> None:
        super().__init__(parent)
        self.session, self.ledger, self.log = session, Ledger(), RunLog()
        self.failure: Failure | None = None
        self.failed_at: Any = None
        """The place where the last run failed."""
        self.ended_by = ""
        """``"result"``, ``"failure"`` or ``"cancel"``."""
        self.pipeline = session.pipeline
        """Of the run."""
        self.seconds = 0.0
        """How long the last run took, from the press of the button."""
        self._job: Job | None = None
        self._left: list[Job] = []
        """Cancelled, and perhaps not at their end yet."""
        self._timer = QTimer(self)
        self._timer.setInterval(PERIOD_MS)
        self._timer.timeout.connect(self._look)

    @property
    def running(self) -> bool:
        """Whether a run is under way."""
        return self._job is not None

    def start(self, up_to: str | None = None) -> None:
        """Run the pipeline, or its steps up to one; a run under way is cancelled."""
        self.cancel()
        self.seconds = -monotonic()
        self.log, self.failure, self.failed_at, self.ended_by = RunLog(), None, None, ""
        self.pipeline = self.session.pipeline
        self.ledger.begin(self.pipeline, self.session.scan, self.session.frame)
        try:
            self._job = self.session.run(up_to)
        except OatkitError as error:
            self.failure = Failure(str(error), str(error))
            self._end("failure")
            return
        self._timer.start()
        self.progressed.emit()

    def cancel(self) -> None:
        """End the run now; work that does not look up at once ends unseen, and what it makes is dropped."""
        if self._job is not None:
            self._job.cancel()
            self._left = [job for job in (*self._left, self._job) if not job.done]
            self._end("cancel")

    def stop(self, seconds: float = 2.0) -> None:
        """Cancel without a word to the window, which is closing, and wait for the threads."""
        jobs = [*self._left, self._job] if self._job else self._left
        self._job, self._left = None, []
        for job in jobs:
            job.cancel()
        for job in jobs:
            job.wait(seconds)

    def _look(self) -> None:
        job = self._job
        if job is None:
            self._timer.stop()
            return
        done = job.done  # asked first: what is yielded between the two questions is not lost
        items = job.drain()
        for item in items:
            self.ledger.take(item)
        self.log.take(items)
        newest, job.newest = job.newest, None
        if newest is not None and not done:
            self.iterated.emit(newest)
        if items:
            self.progressed.emit()
        if done and self._job is job:
            self._end("failure" if job.failure else "result", job.failure)

    def _end(self, by: str, failure: Failure | None = None) -> None:
        self._job = None
        self.seconds += monotonic()
        self._timer.stop()
        self.failure, self.ended_by = failure or self.failure, by
        self.failed_at = self.ledger.end(failure.sentence if failure else "")
        self.ended.emit()
