"""The steps of a pipeline over one frame, as events.

A step is computed again only where the scan, the frame or a step up to it has changed (`oatkit.memo.Memo`).
"""

import re
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from oatkit.data import Image, Scan
from oatkit.events import Event, StepDone, StepIterate, StepStarted
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.quantification import following, quantify
from oatkit.reconstruction import preprocess, raw_key, reconstruct
from oatkit.slips import arrival_notes

NUMBER = re.compile(r"[0-9.]+(e[+-]?[0-9]+)?")


def steps(pipeline: Pipeline, scan: Scan, frame: int = 0, memo: Memo | None = None) -> Iterator[Event]:
    """Yield the events of running `pipeline` over one frame; close the generator to cancel.

    Raises `ValidationError` where the weight is still the name of a rule (`oatkit.engine.rules.resolve` replaces it) or
    a step lacks one that it builds on, `PluginError` where a plugin fails or returns what it may not.
    """
    memo = Memo() if memo is None else memo
    pipeline.check_order()
    yield StepStarted("preprocess")
    start = time.perf_counter()
    clean, grid = preprocess(pipeline, scan, frame, memo), pipeline.grid.grid()
    notes = (*clean.notes[len(scan.notes) :], *arrival_notes(clean, grid))
    yield StepDone("preprocess", time.perf_counter() - start, {}, notes)

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
    """Say what a step found worth saying, and where its solver did not keep its promise why.

    Wavelengths whose reasons differ in their numbers only share a sentence, with the reason of the first.
    """
    found = []
    for name, image in images.items():
        found += [f"{name}: {note}" for note in image.diagnostics.get("notes", ())]
        converged = image.diagnostics.get("converged", ())
        reasons = image.diagnostics.get("reason", ())
        alike: dict[str, list[tuple[float, str]]] = {}
        for wavelength, fine, reason in zip(image.wavelengths_nm, converged, reasons, strict=False):
            if not fine:
                alike.setdefault(NUMBER.sub("", str(reason)), []).append((wavelength, reason))
        found += [_unconverged(step, cases) for cases in alike.values()]
    return tuple(found)


def _unconverged(step: str, cases: Sequence[tuple[float, str]]) -> str:
    (wavelength, reason), further = cases[0], len(cases) - 1
    more = f" and at {further} further wavelength{'s' * (further > 1)}" if further else ""
    return f"{step} at {wavelength:g} nm{more} did not converge: {reason}"


def _once(name: str, pipeline: Pipeline, images: Mapping[str, Image]) -> Iterator[dict[str, Image]]:
    """Yield the images of a step that has no iterates."""
    yield quantify(name, pipeline, images)


def _images_of(event: Event) -> Mapping[str, Image]:
    return event.images if isinstance(event, StepDone) else {}
