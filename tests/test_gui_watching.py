"""What runs beside the window: handed over in its thread, told of when it fails, and ended with it."""

import threading
import time

from gui_viewers import QWidget, wait_for
from oatkit.gui.job import Job
from oatkit.gui.watching import watch


def test_what_a_job_yields_comes_in_order_in_the_thread_of_the_window(qtbot):
    """Every item is handed over once, in order, in the main thread, then the sentence of the failure."""
    window, taken, told = QWidget(), [], []
    qtbot.addWidget(window)

    def work(job):
        yield from range(100)
        raise RuntimeError("out of light")

    main = threading.main_thread()
    watch(Job(work).start(), lambda i: taken.append((i, threading.current_thread() is main)), told.append, window)
    wait_for(lambda: bool(told), qtbot, 10)
    assert taken == [(i, True) for i in range(100)]
    assert told == ["RuntimeError: out of light"]


def test_a_window_that_is_closed_ends_what_runs_beside_it(qtbot):
    """A job without end stops when its window is destroyed, and hands nothing over any more."""
    window, taken = QWidget(), []

    def work(job):
        while True:
            time.sleep(0.005)
            yield 1

    job = Job(work).start()
    watch(job, taken.append, taken.append, window)
    wait_for(lambda: bool(taken), qtbot, 10)
    with qtbot.waitSignal(window.destroyed):
        window.deleteLater()
    assert job.wait(2)
    count = len(taken)
    qtbot.wait(100)
    assert len(taken) == count
