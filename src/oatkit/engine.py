"""The one engine: it runs a pipeline over one frame, step by step.

Script, command line and window all drain the same generator, `steps`; so the same pipeline gives the same numbers
everywhere. A step is computed again only where the scan, the frame or a step up to it has changed (`Memo`).
"""

import math
import time
from collections.abc import Iterator, Mapping
from typing import Any

from oatkit.data import Image, Scan
from oatkit.events import Event, Listener, StepDone, StepIterate, StepStarted, ignore
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.provenance import versions
from oatkit.quantification import following, quantify
from oatkit.reconstruction import preprocess, raw_key, reconstruct
from oatkit.result import Result
from oatkit.rules import Resolved, resolve


def run(
    pipeline: Pipeline, scan: Scan, frame: int = 0, memo: Memo | None = None, on_event: Listener = ignore
) -> Result:
    """Run `pipeline` over one frame of `scan` and return its images, with how they came about.

    A weight or a speed of sound that is still the name of a rule is chosen first, on the scan's first frame. `on_event`
    is shown every event. Raises an `OatkitError`.
    """
    memo = Memo() if memo is None else memo
    return run_resolved(resolve(pipeline, scan, memo, on_event), scan, frame, memo, on_event)


def run_resolved(resolved: Resolved, scan: Scan, frame: int, memo: Memo, on_event: Listener) -> Result:
    """Run a pipeline whose rules `oatkit.rules.resolve` has replaced."""
    images: dict[str, Image] = {}
    seconds: dict[str, float] = {}
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
        weight_choice=resolved.weight.table() if resolved.weight else {},
        speed_choice=resolved.speed.table() if resolved.speed else {},
    )


def steps(pipeline: Pipeline, scan: Scan, frame: int = 0, memo: Memo | None = None) -> Iterator[Event]:
    """Yield the events of running `pipeline` over one frame; close the generator to cancel.

    Raises `ValidationError` where the weight is still the name of a rule (`oatkit.rules.resolve` replaces it) or a step
    lacks one that it builds on, `PluginError` where a plugin fails or returns what it may not.
    """
    memo = Memo() if memo is None else memo
    pipeline.check_order()
    yield StepStarted("preprocess")
    start = time.perf_counter()
    clean, grid = preprocess(pipeline, scan, frame, memo), pipeline.grid.grid()
    yield StepDone("preprocess", time.perf_counter() - start, {}, clean.notes[len(scan.notes) :])

    chain = (*raw_key(pipeline, scan, frame), pipeline.grid, pipeline.forward, pipeline.reconstruct)
    images: dict[str, Image] = {}
    for event in _memoised(memo, chain, "reconstruct", reconstruct(pipeline, clean, grid, memo)):
        yield event
        images |= _images_of(event)
    for name, parts in following(pipeline):
        chain = (*chain, *parts)
        for event in _memoised(memo, chain, name, _once(name, pipeline, images)):
            yield event
            images |= _images_of(event)


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
    if resolved.speed is None:
        return "pipeline"
    return f"focus; the file's is {scan.geometry.speed_of_sound_m_s:.1f} m/s, {scan.speed_of_sound_source}"


def _memoised(memo: Memo, key: tuple[Any, ...], step: str, work: Iterator[Any]) -> Iterator[Event]:
    """Yield the events of a step whose work yields iterates and at last a dict of images, unless it is known."""
    yield StepStarted(step)
    start = time.perf_counter()
    images = memo.peek(key)
    if images is None:
        for item in work:
            if isinstance(item, StepIterate):
                yield item
            else:
                images = item
        memo.put(key, images, sum(image.values.nbytes for image in images.values()))
    yield StepDone(step, time.perf_counter() - start, images, _warnings(step, images))


def _warnings(step: str, images: Mapping[str, Image]) -> tuple[str, ...]:
    """Say what a step found worth saying, and of each wavelength whose solver did not keep its promise why."""
    found = []
    for name, image in images.items():
        found += [f"{name}: {note}" for note in image.diagnostics.get("notes", ())]
        converged = image.diagnostics.get("converged", ())
        reasons = image.diagnostics.get("reason", ())
        for wavelength, fine, reason in zip(image.wavelengths_nm, converged, reasons, strict=False):
            if not fine:
                found.append(f"{step} at {wavelength:g} nm did not converge: {reason}")
    return tuple(found)


def _once(name: str, pipeline: Pipeline, images: Mapping[str, Image]) -> Iterator[dict[str, Image]]:
    """Yield the images of a step that has no iterates."""
    yield quantify(name, pipeline, images)


def _images_of(event: Event) -> Mapping[str, Image]:
    return event.images if isinstance(event, StepDone) else {}
