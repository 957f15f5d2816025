"""Brings what a job yields into the thread of the window."""

from collections.abc import Callable
from typing import Any

from qtpy.QtCore import QTimer

from oatkit.gui.job import Job
from oatkit.gui.leaving import when_gone

PERIOD_MS = 40


def watch(job: Job, take: Callable[[Any], None], fail: Callable[[str], None], window: Any) -> None:
    """Hand each thing that a job yields to `take`, and the sentence of its failure to `fail`.

    A window that is closed cancels the job, and nothing is handed over any more.
    """
    timer = QTimer(window)

    def look() -> None:
        done = job.done  # asked first: what is yielded between the two questions is not lost
        for item in job.drain():
            take(item)
        if done:
            timer.stop()
            timer.deleteLater()
            if job.failure:
                fail(job.failure.sentence)

    timer.timeout.connect(look)
    when_gone(timer, job.cancel)
    timer.start(PERIOD_MS)
