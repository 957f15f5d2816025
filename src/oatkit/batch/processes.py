"""Frames in several processes of this machine, each on a share of its threads."""

import os
import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context

from oatkit.batch.engine import IN_FLIGHT, Engine, Outcomes
from oatkit.batch.pieces import Outcome, Work, run_piece
from oatkit.errors import SolverError
from oatkit.events import Listener
from oatkit.memo import Memo
from oatkit.threads import thread_count

POISONOUS = "the process that ran it died, twice; it may need more memory than there is"


class Processes(Engine):
    """Spawned processes, which build their operator once.

    Where one dies, the frames that were under way are run again, one at a time; one whose process dies twice has
    failed.
    """

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or thread_count()

    def run(self, work: Work, frames: Sequence[int], memo: Memo, on_event: Listener) -> Outcomes:
        """Yield outcomes as they come."""
        left = dict.fromkeys(frames)
        while left:
            under_way: set[int] = set()
            try:
                for outcome in self._run(work, list(left), self.workers, under_way):
                    del left[outcome.frame]
                    yield outcome
            except BrokenProcessPool:
                # Each that was under way alone, so that the poisonous one is known.
                for frame in sorted(under_way):
                    del left[frame]
                    yield from self._alone(work, frame)

    def _alone(self, work: Work, frame: int) -> Iterator[Outcome]:
        """Yield the outcome of a frame that is suspected."""
        try:
            yield from self._run(work, [frame], 1, set())
        except BrokenProcessPool:
            yield Outcome(frame, error=SolverError(POISONOUS))

    def _run(self, work: Work, frames: Sequence[int], workers: int, under_way: set[int]) -> Iterator[Outcome]:
        """Yield outcomes from one pool; `under_way` tells which frames it has when it breaks."""
        threads = max(1, thread_count() // workers)
        pool = ProcessPoolExecutor(
            min(workers, len(frames)), get_context("spawn"), _begin, (pickle.dumps(work), threads)
        )
        others = set(active_children())
        waiting: dict[Future[Outcome], int] = {}
        try:
            for frame in frames:
                waiting[pool.submit(_work, frame)] = frame
                under_way.add(frame)
                if len(waiting) >= IN_FLIGHT * workers:
                    yield from _first(waiting, under_way)
            while waiting:
                yield from _first(waiting, under_way)
        finally:
            if waiting:  # nobody wants what is under way
                for process in set(active_children()) - others:
                    process.terminate()
            pool.shutdown(wait=True, cancel_futures=True)


def _first(waiting: dict[Future[Outcome], int], under_way: set[int]) -> Iterator[Outcome]:
    """Yield what has come, at least one."""
    for future in wait(waiting, return_when=FIRST_COMPLETED).done:
        outcome = future.result()
        under_way.discard(waiting.pop(future))
        yield outcome


_work_of_all: Work
_memo: Memo


def _begin(work: bytes, threads: int) -> None:
    """Set up a worker."""
    global _work_of_all, _memo
    os.environ["OATKIT_THREADS"] = str(threads)
    _work_of_all, _memo = pickle.loads(work), Memo()


def _work(frame: int) -> Outcome:
    return run_piece(_work_of_all, frame, _memo)
