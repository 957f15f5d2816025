"""Who runs the frames: this process, several on this machine, or a dask cluster."""

from collections.abc import Sequence
from typing import Literal, get_args

from oatkit.batch.engine import Engine, Outcomes
from oatkit.batch.pieces import Work, run_piece
from oatkit.errors import ValidationError
from oatkit.events import Listener
from oatkit.memo import Memo
from oatkit.names import did_you_mean

Name = Literal["serial", "processes", "dask"]


class Serial(Engine):
    """In this process, one frame after another, on all threads."""

    def run(self, work: Work, frames: Sequence[int], memo: Memo, on_event: Listener) -> Outcomes:
        """Yield outcomes in the order of the frames."""
        for frame in frames:
            yield run_piece(work, frame, memo, on_event)


def engine_named(name: str, workers: int | None = None, address: str = "") -> Engine:
    """Return an engine: ``"serial"``, ``"processes"`` with so many `workers`, or ``"dask"``.

    `address` is that of a dask scheduler; without it a cluster of `workers` is started on this machine. Raises
    `ValidationError` for another name, for an option that the engine does not have, and where dask is not installed.
    """
    if name not in get_args(Name):
        raise ValidationError(f"no engine named '{name}'{did_you_mean(name, get_args(Name))}")
    if workers is not None and not workers >= 1:
        raise ValidationError(f"workers: expected one or more, got {workers}")
    if address and name != "dask":
        raise ValidationError(f"the engine '{name}' has no scheduler; take --engine dask")
    if name == "serial":
        if workers not in (None, 1):
            raise ValidationError("the engine 'serial' has one worker; take --engine processes")
        return Serial()
    if name == "processes":
        from oatkit.batch.processes import Processes

        return Processes(workers)
    from oatkit.batch.cluster import Dask

    return Dask(address, workers)
