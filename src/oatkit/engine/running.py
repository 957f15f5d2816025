"""The one engine: it runs a pipeline over one frame, step by step.

Script, command line and window all drain the same generator, `oatkit.engine.stepping.steps`; so the same
pipeline gives the same numbers everywhere.
"""

import math
from typing import Any

from oatkit.data import Image, Scan
from oatkit.engine.provenance import versions
from oatkit.engine.rules import Resolved, resolve
from oatkit.engine.stepping import steps
from oatkit.events import Listener, StepDone, ignore
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.result import Result


def run(
    pipeline: Pipeline, scan: Scan, frame: int = 0, memo: Memo | None = None, on_event: Listener = ignore
) -> Result:
    """Run `pipeline` over one frame of `scan` and return its images, with how they came about.

    Words that stand for numbers (see `oatkit.engine.rules.resolve`) are replaced first. `on_event` is shown every
    event. Raises an `OatkitError`.
    """
    memo = Memo() if memo is None else memo
    return run_resolved(resolve(pipeline, scan, memo, on_event, frame), scan, frame, memo, on_event)


def run_resolved(resolved: Resolved, scan: Scan, frame: int, memo: Memo, on_event: Listener) -> Result:
    """Run a pipeline whose rules `oatkit.engine.rules.resolve` has replaced."""
    images: dict[str, Image] = {}
    seconds: dict[str, float] = {}
    choices = resolved.choices
    notes = [*scan.notes, *resolved.notes, *resolved.notes_on(frame)]
    for event in steps(resolved.pipeline, scan, frame, memo):
        on_event(event)
        if isinstance(event, StepDone):
            images |= event.images
            seconds[event.step] = event.seconds
            notes += event.notes
    return Result(
        images=images,
        pipeline=resolved.pipeline.model_dump(),
        requested=resolved.requested.model_dump(),
        versions=versions(resolved.pipeline),
        scan=describe_scan(scan, resolved),
        seconds=seconds,
        warnings=tuple(dict.fromkeys(notes)),
        frame_index=frame,
        time_s=_time_of(scan, frame),
        weight_choice=choices["weight_choice"],
        speed_choice=choices["speed_choice"],
        calibration_choice=choices["calibration_choice"],
    )


def describe_scan(scan: Scan, resolved: Resolved) -> dict[str, Any]:
    """Return what a result keeps of the scan that it was made from, as plain values.

    The fingerprint is that of the scan as read; the speed of sound is the one that was used.
    """
    used = resolved.pipeline.scan.speed_of_sound_m_s
    return {
        "name": scan.name,
        "source": scan.source,
        "reader": scan.reader,
        "fingerprint": scan.fingerprint,
        "frames": scan.frames,
        "wavelengths_nm": list(scan.wavelengths_nm),
        "speed_of_sound_m_s": scan.geometry.speed_of_sound_m_s if used is None else used,
        "speed_of_sound_source": scan.speed_of_sound_source if used is None else _origin(scan, resolved),
        "notes": list(scan.notes),
    }


def _time_of(scan: Scan, frame: int) -> float | None:
    """Return the mean time of a frame's pulses, s; None where it is not known."""
    time_s = float("nan") if scan.timestamps_s is None else float(scan.timestamps_s[frame].mean())
    return time_s if math.isfinite(time_s) else None


def _origin(scan: Scan, resolved: Resolved) -> str:
    """Say where a speed of sound that is not the scan's own comes from."""
    if not resolved.choices["speed_choice"]:
        return "pipeline"
    return f"focus; the file's is {scan.geometry.speed_of_sound_m_s:.1f} m/s, {scan.speed_of_sound_source}"
