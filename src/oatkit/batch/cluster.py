"""Frames on a dask cluster: of this machine, or of any scheduler that has an address."""

import os
import pickle
from collections.abc import Iterator, Sequence
from typing import Any
from uuid import uuid4

from oatkit.batch.engine import IN_FLIGHT, Engine, Outcomes
from oatkit.batch.pieces import Outcome, Work, run_piece
from oatkit.errors import SolverError, ValidationError
from oatkit.events import Listener
from oatkit.memo import Memo
from oatkit.threads import thread_count

MALLOC, MALLOC_VARIABLES = 2**30, ("MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_")
"""dask has workers give memory back at once. Arrays of some 100 kB, which a solver makes at each step, then come as
fresh pages from the system each time, and take twice as long."""
DEATHS = 2
"""Of workers that one frame may cost."""


POISONOUS = f"{DEATHS} workers that ran it died; it may need more memory than there is"


class Dask(Engine):
    """Any cluster that `distributed.Client` reaches; without an address, a `LocalCluster`.

    A frame whose worker dies is run again by another; one that costs `DEATHS` workers alone has failed. Workers must
    have oatkit, the plugins of the pipeline, and see the scan under the same path.
    """

    def __init__(self, address: str = "", workers: int | None = None) -> None:
        try:
            import distributed  # noqa: F401
        except ImportError as error:
            raise ValidationError(
                f'the engine "dask" needs dask and distributed: pip install "oatkit[scale]" ({error})'
            ) from None
        self.address, self.workers = address, workers or thread_count()

    def run(self, work: Work, frames: Sequence[int], memo: Memo, on_event: Listener) -> Outcomes:
        """Yield outcomes as they come."""
        import dask
        from distributed import Client

        settings = {
            "distributed.scheduler.allowed-failures": DEATHS - 1,
            "distributed.scheduler.work-stealing": False,
            **{f"distributed.nanny.pre-spawn-environ.{name}": MALLOC for name in MALLOC_VARIABLES},
        }
        with dask.config.set(settings):
            given: Any = {"address": self.address} if self.address else self._local()
            with Client(**given, set_as_default=False) as client:
                yield from self._run(client, work, frames)

    def _local(self) -> dict[str, Any]:
        return {"n_workers": self.workers, "threads_per_worker": 1, "processes": True, "dashboard_address": None}

    def _run(self, client: Any, work: Work, frames: Sequence[int]) -> Iterator[Outcome]:
        from distributed import KilledWorker, as_completed

        # Not scattered: what is scattered is lost with the last worker that has it.
        shared, run = pickle.dumps(work), uuid4().hex
        queue = iter(frames)
        most = IN_FLIGHT * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        waiting: dict[Any, int] = {}
        suspects: list[int] = []

        def submit() -> Any:
            frame = next(queue, None)
            if frame is None:
                return None
            future = client.submit(_work, run, shared, frame, pure=False)
            waiting[future] = frame
            return future

        first = [future for _ in range(most) if (future := submit()) is not None]
        coming = as_completed(first, loop=client.loop)
        for future in coming:
            frame = waiting.pop(future)
            try:
                yield future.result()
            except KilledWorker:
                suspects.append(frame)
            future.release()
            if (another := submit()) is not None:
                coming.add(another)
        # dask also blames a frame that only waited at a worker that died: each alone, so that the poisonous one is
        # known.
        for frame in suspects:
            try:
                yield client.submit(_work, run, shared, frame, pure=False).result()
            except KilledWorker:
                yield Outcome(frame, error=SolverError(POISONOUS))


_kept: dict[str, tuple[Work, Memo]] = {}
"""Of a worker: the work of the run that it is at, and the operator, which it holds from frame to frame."""


def _work(run: str, work: bytes, frame: int) -> Outcome:
    from distributed import get_worker

    # As many threads as the cluster gives to the worker, unless who set it up says otherwise.
    os.environ.setdefault("OATKIT_THREADS", str(get_worker().state.nthreads))
    if run not in _kept:
        _kept.clear()
        _kept[run] = pickle.loads(work), Memo()
    return run_piece(_kept[run][0], frame, _kept[run][1])
