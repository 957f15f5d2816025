"""Long work can be stopped between its passes, in its own thread and nowhere else."""

import threading

import pytest

from oatkit.checkpoint import at_checkpoints, checkpoint


class Stop(BaseException):
    """What a test raises, as Ctrl-C does: an exception of the usual kind would be taken for a plugin's fault."""


def stop():
    """Ask the work to end."""
    raise Stop


def test_a_checkpoint_does_nothing_unless_asked():
    """Outside of `at_checkpoints`, and after it, a checkpoint does nothing."""
    checkpoint()
    with pytest.raises(Stop), at_checkpoints(stop):
        checkpoint()
    checkpoint()


def test_checkpoints_of_another_thread_are_left_alone():
    """What is asked for in one thread does not stop another."""
    reached = []

    def work():
        checkpoint()
        reached.append(True)

    with at_checkpoints(stop):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert reached == [True]


def test_solving_passes_a_checkpoint_at_each_step():
    """`Solver.solve` can be stopped after any iterate."""
    import numpy as np

    import oatkit
    from oatkit.api import Problem

    problem = Problem(np.eye(9), np.ones(9), (3, 3))
    with pytest.raises(Stop), at_checkpoints(stop):
        oatkit.plugin("solver", "lsqr")(weight=0.1).solve(problem)


def test_a_reconstruction_passes_a_checkpoint_at_each_step(small_scan):
    """A run can be stopped at any iterate, even where the signal that asked for it was swallowed on its way."""
    import oatkit

    pipeline = oatkit.Pipeline.load("lsqr", ["grid.pixels=16", "grid.field_of_view_mm=9"])
    with pytest.raises(Stop), at_checkpoints(stop):
        oatkit.run(pipeline, small_scan)
