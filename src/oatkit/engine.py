"""The one engine: it runs a pipeline over one frame, step by step.

Script, command line and window all drain the same generator, `steps`; so the same pipeline gives the same numbers
everywhere. A step is computed again only where the scan, the frame or a step up to it has changed (`Memo`).
"""

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from oatkit import weights
from oatkit.api import UnmixProblem
from oatkit.blame import blame
from oatkit.data import Image, Scan
from oatkit.errors import PluginError
from oatkit.events import Event, Listener, StepDone, StepIterate, StepStarted, ignore
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.provenance import versions
from oatkit.reconstruction import check_finite, preprocess, problems, raw_key, reconstruct
from oatkit.result import Result
from oatkit.vectors import norm


def run(
    pipeline: Pipeline, scan: Scan, frame: int = 0, memo: Memo | None = None, on_event: Listener = ignore
) -> Result:
    """Run `pipeline` over one frame of `scan` and return its images, with how they came about.

    A weight that is still the name of a rule is chosen first, on the scan's first frame. `on_event` is shown every
    event. Raises an `OatkitError`.
    """
    memo = Memo() if memo is None else memo
    resolved, choice = resolve(pipeline, scan, memo, on_event)
    return run_resolved(resolved, pipeline, choice, scan, frame, memo, on_event)


def run_resolved(
    resolved: Pipeline,
    requested: Pipeline,
    choice: weights.Choice | None,
    scan: Scan,
    frame: int,
    memo: Memo,
    on_event: Listener,
) -> Result:
    """Run a pipeline whose weight `resolve` has chosen; `requested` and `choice` are what it came from."""
    images: dict[str, Image] = {}
    seconds: dict[str, float] = {}
    notes = [*scan.notes, *(choice.notes if choice else ())]
    for event in steps(resolved, scan, frame, memo):
        on_event(event)
        if isinstance(event, StepDone):
            images |= event.images
            seconds[event.step] = event.seconds
            notes += event.notes
    return Result(
        images=images,
        pipeline=resolved.model_dump(),
        requested=requested.model_dump(),
        versions=versions(resolved),
        scan=describe_scan(scan, resolved),
        seconds=seconds,
        warnings=tuple(dict.fromkeys(notes)),
        frame_index=frame,
        weight_choice=choice.table() if choice else {},
    )


def steps(pipeline: Pipeline, scan: Scan, frame: int = 0, memo: Memo | None = None) -> Iterator[Event]:
    """Yield the events of running `pipeline` over one frame; close the generator to cancel.

    Raises `ValidationError` where the weight is still the name of a rule (`resolve` chooses it), `PluginError` where
    a plugin fails or returns what it may not.
    """
    memo = Memo() if memo is None else memo
    yield StepStarted("preprocess")
    start = time.perf_counter()
    clean, grid = preprocess(pipeline, scan, frame, memo), pipeline.grid.grid()
    yield StepDone("preprocess", time.perf_counter() - start, {}, clean.notes[len(scan.notes) :])

    chain = (*raw_key(pipeline, scan, frame), pipeline.grid, pipeline.forward, pipeline.reconstruct)
    images: dict[str, Image] = {}
    for event in _memoised(memo, chain, "reconstruct", reconstruct(pipeline, clean, grid, memo)):
        yield event
        images |= _images_of(event)
    for name in ("segment", "unmix"):
        plugin = getattr(pipeline, name)
        if plugin is None:
            continue
        chain = (*chain, plugin)
        for event in _memoised(memo, chain, name, _single(name, plugin, dict(images))):
            yield event
            images |= _images_of(event)


def resolve(
    pipeline: Pipeline, scan: Scan, memo: Memo | None = None, on_event: Listener = ignore
) -> tuple[Pipeline, weights.Choice | None]:
    """Return the pipeline with its weight chosen, and how it was chosen.

    The rule runs once, on the scan's first frame and its strongest wavelength (the one of the largest signals),
    whatever part of the scan is asked for. A weight that is a number is left alone.
    """
    if not isinstance(getattr(pipeline.reconstruct, "weight", None), str):
        return pipeline, None
    memo = Memo() if memo is None else memo
    on_event(StepStarted("choosing the weight"))
    clean = preprocess(pipeline, scan, 0, memo)
    each = problems(pipeline, clean, pipeline.grid.grid(), memo)
    _, strongest = max(each, key=lambda pair: norm(pair[1].data))
    with blame(pipeline.reconstruct):
        solver, choice = weights.resolve(pipeline.reconstruct, strongest)
    return pipeline.with_solver(solver), choice


def describe_scan(scan: Scan, pipeline: Pipeline) -> dict[str, Any]:
    """Return what a result keeps of the scan that it was made from, as plain values.

    The fingerprint is that of the scan as read; the speed of sound is the one that was used.
    """
    used = pipeline.scan.speed_of_sound_m_s
    return {
        "name": scan.name,
        "source": scan.source,
        "reader": scan.reader,
        "fingerprint": scan.fingerprint,
        "frames": scan.frames,
        "wavelengths_nm": list(scan.wavelengths_nm),
        "speed_of_sound_m_s": scan.geometry.speed_of_sound_m_s if used is None else used,
        "speed_of_sound_source": scan.speed_of_sound_source if used is None else "pipeline",
        "notes": list(scan.notes),
    }


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
    """Say of each wavelength whose solver did not keep its promise what it reported."""
    found = []
    for image in images.values():
        converged = image.diagnostics.get("converged", ())
        reasons = image.diagnostics.get("reason", ())
        for wavelength, fine, reason in zip(image.wavelengths_nm, converged, reasons, strict=False):
            if not fine:
                found.append(f"{step} at {wavelength:g} nm did not converge: {reason}")
    return tuple(found)


def _single(name: str, plugin: Any, images: dict[str, Image]) -> Iterator[dict[str, Image]]:
    """Yield the images of a step that has no iterates."""
    pressure = images["initial_pressure"]
    with blame(plugin):
        if name == "segment":
            made = {"boundary": plugin.segment(pressure)}
        else:
            made = dict(plugin.unmix(UnmixProblem(pressure, boundary=images.get("boundary"))))
    history = {"step": name, **plugin.model_dump()}
    for key, image in made.items():
        if not isinstance(image, Image) or image.grid != pressure.grid:
            kind = plugin.kind.replace("_", " ")
            raise PluginError(f"{kind} '{plugin.name}' returned no image on the grid as '{key}'")
        check_finite(plugin, key, image)
        made[key] = replace(image, history=(*pressure.history, history))
    yield made


def _images_of(event: Event) -> Mapping[str, Image]:
    return event.images if isinstance(event, StepDone) else {}
