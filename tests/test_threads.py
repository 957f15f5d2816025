"""The pool of threads."""

import os
import threading

import pytest

from oatkit.errors import ValidationError
from oatkit.threads import for_each, thread_count


@pytest.mark.parametrize("text", ["0", "-1", "two", "1.5", "nan", "²"])
def test_a_wrong_number_of_threads_is_refused(monkeypatch, text):
    """OATKIT_THREADS must be a whole number of at least 1; the message repeats what was found."""
    monkeypatch.setenv("OATKIT_THREADS", text)
    with pytest.raises(ValidationError, match=f"OATKIT_THREADS.*'{text}'"):
        thread_count()


def test_without_the_variable_all_usable_cores_are_taken(monkeypatch):
    """An absent or empty OATKIT_THREADS means every core that this process may use."""
    monkeypatch.delenv("OATKIT_THREADS", raising=False)
    cores = thread_count()
    monkeypatch.setenv("OATKIT_THREADS", "")
    assert thread_count() == cores
    assert 1 <= cores <= (os.cpu_count() or 1)


@pytest.mark.parametrize("threads", ["1", "2", "3"])
def test_each_item_is_done_once(monkeypatch, threads):
    """Every item is worked on exactly once, by no more threads than were asked for."""
    monkeypatch.setenv("OATKIT_THREADS", threads)
    done, workers = [], set()

    def work(item):
        done.append(item)
        workers.add(threading.get_ident())

    for_each(work, range(200))
    assert sorted(done) == list(range(200))
    assert len(workers) <= int(threads)


@pytest.mark.parametrize("threads", ["1", "2"])
def test_an_exception_reaches_the_caller(monkeypatch, threads):
    """What a piece of work raises comes out of `for_each`."""
    monkeypatch.setenv("OATKIT_THREADS", threads)
    with pytest.raises(ZeroDivisionError):
        for_each(lambda item: 1 / item, [1, 0, 2])


def test_work_may_hand_out_work(monkeypatch):
    """`for_each` inside `for_each` ends, though all threads of the pool wait for the inner one."""
    monkeypatch.setenv("OATKIT_THREADS", "2")
    done = []
    for_each(lambda outer: for_each(lambda inner: done.append((outer, inner)), range(5)), range(8))
    assert sorted(done) == [(outer, inner) for outer in range(8) for inner in range(5)]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_makes_its_own_pool(monkeypatch):
    """After a fork, `for_each` works in the child, where the threads of the parent are gone."""
    monkeypatch.setenv("OATKIT_THREADS", "2")
    for_each(lambda item: None, range(4))
    child = os.fork()
    if child == 0:
        done = []
        for_each(done.append, range(4))
        os._exit(0 if sorted(done) == [0, 1, 2, 3] else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
