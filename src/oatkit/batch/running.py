"""Many frames through one pipeline, streamed into a result on disk."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from oatkit.data import Scan
from oatkit.engine import run_resolved
from oatkit.errors import OatkitError, ResultError, ValidationError
from oatkit.events import Listener, ignore
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.plain import decode, encode
from oatkit.provenance import versions
from oatkit.reconstruction import frame_key
from oatkit.result import Result
from oatkit.rules import Resolved, motion_in, resolve
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
) -> Result:
    """Run `pipeline` over `frames` (all unless said) and return the result that now lies in the folder `path`.

    Words that stand for numbers are replaced once, unless ``scan.rules`` asks otherwise, and the operator is built
    once. A frame that fails is recorded with its reason and the rest goes on. Frames with a pulse out of place are no
    part of the result where the pipeline's table ``[motion]`` says ``leave_out``; each frame's warnings list them.

    A run that is interrupted, by whatever, leaves the frames that were done in a hidden folder; the same call with
    `resume` goes on with them and ends in the result that an uninterrupted run gives, bit by bit. Where there is
    nothing to go on with it starts; where the result is complete already it is returned.

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
    with StoreWriter(path, len(chosen), scan.source, overwrite, run, resume) as writer:
        todo = [(index, frame) for index, frame in enumerate(chosen) if index not in writer.done]
        for index in writer.done:
            on_frame(chosen[index])
        if pipeline.scan.rules == "scan" and todo:
            resolved = _resolved(pipeline, scan, writer.common, memo, on_event)
            resolved = replace(resolved, left_out=left_out)
        first_failure, failed = None, 0
        for index, frame in todo:
            try:
                if pipeline.scan.rules == "frame":
                    resolved = replace(resolve(pipeline, scan, memo, on_event, frame), left_out=left_out)
                result = run_resolved(resolved, scan, frame, memo, on_event)
            except OatkitError as error:
                # Only one is held: with it go the images that were in the making.
                first_failure, failed = first_failure or error, failed + 1
                writer.fail(index, f"frame {frame}: {error}")
            else:
                writer.write(index, result)
            # No other frame needs what was made of this one; without this, memory grows with the scan.
            memo.forget(*frame_key(scan, frame))
            on_frame(frame)
        if first_failure and failed == len(chosen):
            raise first_failure
    return load(path)


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
    """Return the pipeline with its rules replaced: as an interrupted run has done it, or anew."""
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
