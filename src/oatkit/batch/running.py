"""One run over many frames: what is to be done, who does it, and what goes into the result."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from oatkit.batch.engine import Engine
from oatkit.batch.engines import engine_named
from oatkit.batch.pieces import Outcome, Work
from oatkit.data import Scan
from oatkit.engine.provenance import versions
from oatkit.engine.rules import Resolved, motion_in, resolve
from oatkit.errors import OatkitError, ResultError, ValidationError
from oatkit.events import Listener, ignore
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.plain import decode, encode
from oatkit.result import Result
from oatkit.store import StoreWriter, load


def run_frames(
    pipeline: Pipeline,
    scan: Scan,
    path: str | Path,
    frames: Iterable[int] | None = None,
    on_event: Listener = ignore,
    on_frame: Callable[[int], None] = lambda frame: None,
    overwrite: bool = False,
    resume: bool = False,
    engine: str | Engine = "serial",
) -> Result:
    """Run `pipeline` over `frames` (all unless said) and return the result that now lies in the folder `path`.

    Words that stand for numbers are replaced once, unless ``scan.rules`` asks otherwise, and the operator is built
    once. A frame that fails is recorded with its reason and the rest goes on. Frames with a pulse out of place are no
    part of the result where the pipeline's table ``[motion]`` says ``leave_out``; each frame's warnings list them.

    A run that is interrupted, by whatever, leaves the frames that were done in a hidden folder; the same call with
    `resume` goes on with them and ends in the result that an uninterrupted run gives, bit by bit. Where there is
    nothing to go on with it starts; where the result is complete already it is returned.

    `engine` says who runs the frames (see `oatkit.batch.engine_named`); the result is the same, bit by bit, and a run
    may go on with another engine. Events of frames are told by ``"serial"`` alone.

    Raises `ValidationError` for a frame that does not exist, where all are left out, and where the interrupted run was
    another one; `ResultError` where the result cannot be written; and the frame's own error where every frame failed;
    then nothing is left at `path`.
    """
    chosen = list(range(scan.frames) if frames is None else frames)
    missing = [f for f in chosen if not 0 <= f < scan.frames]
    if missing or not chosen:
        raise ValidationError(f"frames {missing or chosen}: the scan has frames 0 .. {scan.frames - 1}")
    # A slip of the pipeline's is not each frame's failure.
    pipeline.scan.apply(scan).geometry.check_grid(pipeline.grid.grid())
    memo = Memo()
    left_out = _left_out(pipeline, scan, chosen, memo, on_event)
    chosen = [frame for frame in chosen if frame not in left_out]
    run = _identity(pipeline, scan, chosen)
    if resume and not overwrite and (complete := _complete(Path(path), run)):
        return complete
    by = engine_named(engine) if isinstance(engine, str) else engine
    with StoreWriter(path, len(chosen), scan.source, overwrite, run, resume) as writer:
        for index in writer.done:
            on_frame(chosen[index])
        places = {frame: index for index, frame in enumerate(chosen) if index not in writer.done}
        if places:
            resolved = _resolved(pipeline, scan, writer.common, memo, on_event)
            work = Work(replace(resolved, left_out=left_out), scan)
            with closing(by.run(work, list(places), memo, on_event)) as outcomes:
                first_failure = _write(writer, outcomes, places, on_frame)
            if first_failure and not writer.written:
                raise first_failure
    return load(path)


def _write(
    writer: StoreWriter, outcomes: Iterable[Outcome], places: Mapping[int, int], on_frame: Callable[[int], None]
) -> OatkitError | None:
    """Write what becomes of each frame, and return the first failure."""
    first: OatkitError | None = None
    for outcome in outcomes:
        index = places[outcome.frame]
        if outcome.result is None:
            first = first or outcome.error
            writer.fail(index, f"frame {outcome.frame}: {outcome.error}")
        else:
            writer.write(index, outcome.result)
        on_frame(outcome.frame)
    return first


def _identity(pipeline: Pipeline, scan: Scan, chosen: list[int]) -> dict[str, Any]:
    """Return what makes two runs the same: one can go on with the other."""
    return {
        "pipeline": pipeline.model_dump(),
        "scan": scan.fingerprint,
        "frames": ", ".join(map(str, chosen)),
        "version": versions(pipeline),
    }


def _complete(path: Path, run: Mapping[str, Any]) -> Result | None:
    """Return the result at `path`, if there is one and it is of this run."""
    if not path.exists():
        return None
    found = load(path)
    frames = {found.when(i)[0] for i in range(found.frames) if i not in found.failed}
    asked = [int(frame) for frame in run["frames"].split(", ")]
    of_it = (dict(found.requested), found.scan.get("fingerprint")) == (decode(encode(run["pipeline"])), run["scan"])
    if not (of_it and found.frames == len(asked) and frames <= set(asked)):
        raise ResultError(f"{path}: exists already, and is of another run; choose another name, or overwrite it")
    return found


def _resolved(pipeline: Pipeline, scan: Scan, common: Mapping[str, Any], memo: Memo, on_event: Listener) -> Resolved:
    """Return the pipeline with its rules replaced: as an interrupted run has done it, or anew.

    Where each frame has rules of its own nothing is replaced here.
    """
    if pipeline.scan.rules == "frame":
        return Resolved(pipeline, pipeline)
    if not common:
        return resolve(pipeline, scan, memo, on_event)
    ran = Pipeline.of_table(common["pipeline"])
    choices = {name: common[name] for name in ("speed_choice", "weight_choice", "calibration_choice")}
    return Resolved(ran, pipeline, motion=motion_in(pipeline, scan, memo, on_event), known=choices)


def _left_out(pipeline: Pipeline, scan: Scan, chosen: list[int], memo: Memo, on_event: Listener) -> tuple[int, ...]:
    """Return which frames are not run, since a pulse of theirs is out of place."""
    motion = motion_in(pipeline, scan, memo, on_event)
    if motion is None or pipeline.motion is None or not pipeline.motion.leave_out:
        return ()
    left_out = tuple(frame for frame in motion.frames if frame in chosen)
    if len(left_out) == len(set(chosen)):
        raise ValidationError(
            f"[motion].leave_out: all frames asked for are out of place: {', '.join(map(str, left_out))}; "
            "set it to false to see them"
        )
    return left_out
