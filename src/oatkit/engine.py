"""The one engine: it runs a pipeline over one frame, step by step.

Script, command line and window all drain the same generator, `steps`; so the same pipeline gives the same numbers
everywhere. A step is computed again only where the scan, the frame or a step up to it has changed (`Memo`).
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from oatkit import weights
from oatkit.api import Iterate, Plugin, Problem, Solver, UnmixProblem
from oatkit.blame import blame
from oatkit.data import Grid, Image, Scan
from oatkit.errors import PluginError, SolverError
from oatkit.masking import without_rows
from oatkit.memo import Memo
from oatkit.metrics import negative_pixels
from oatkit.pipeline import Pipeline
from oatkit.provenance import versions
from oatkit.result import Result
from oatkit.vectors import norm


@dataclass(frozen=True)
class StepStarted:
    """A step begins."""

    step: str


@dataclass(frozen=True)
class StepIterate:
    """A solver has taken a step."""

    step: str
    wavelength_nm: float
    iterate: Iterate


@dataclass(frozen=True)
class StepDone:
    """A step has ended; `images` holds what it made, by name."""

    step: str
    seconds: float
    images: Mapping[str, Image]
    notes: tuple[str, ...] = ()


Event = StepStarted | StepIterate | StepDone
Listener = Callable[[Event], None]


def ignore(event: Event) -> None:
    """Listen to nothing."""


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

    chain = (*_raw_key(pipeline, scan, frame), pipeline.grid, pipeline.forward, pipeline.reconstruct)
    images: dict[str, Image] = {}
    for event in _memoised(memo, chain, "reconstruct", _reconstruct(pipeline, clean, grid, memo)):
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


def preprocess(pipeline: Pipeline, scan: Scan, frame: int, memo: Memo | None = None) -> Scan:
    """Return one frame after all steps of ``preprocess``, checked to be finite and seen by the grid."""
    memo = Memo() if memo is None else memo
    one = partial(_preprocess, pipeline, scan, frame)
    clean = memo.get(_raw_key(pipeline, scan, frame), one, lambda made: int(np.asarray(made.signals).nbytes))
    clean.geometry.check_grid(pipeline.grid.grid())
    return clean


def problems(pipeline: Pipeline, clean: Scan, grid: Grid, memo: Memo) -> Iterator[tuple[float, Problem]]:
    """Yield wavelength (nm) and problem for each wavelength of a preprocessed frame."""
    key = (clean.geometry, grid, pipeline.forward)
    operator = memo.keep(key, partial(_operator, pipeline, clean, grid))
    for wavelength, record, valid in zip(clean.wavelengths_nm, clean.signals[0], clean.valid[0], strict=True):
        rows = np.repeat(valid, clean.geometry.n_samples)
        used = operator
        if not valid.all():
            used = memo.get(
                (key, valid.tobytes()), partial(without_rows, operator, rows), lambda made: made.rows.nbytes
            )
        data = np.where(rows, np.ravel(record), 0)
        yield wavelength, Problem(used, data, grid.shape, clean.geometry, grid, valid)


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


def history_of(pipeline: Pipeline) -> tuple[dict[str, Any], ...]:
    """Return the steps up to the reconstruction as plain tables, each with the name of its slot."""
    chain: list[tuple[str, Plugin]] = [("preprocess", p) for p in pipeline.preprocess]
    chain += [("forward", pipeline.forward), ("reconstruct", pipeline.reconstruct)]
    return tuple({"step": slot, **plugin.model_dump()} for slot, plugin in chain)


def _raw_key(pipeline: Pipeline, scan: Scan, frame: int) -> tuple[Any, ...]:
    return (scan.fingerprint, scan.notes, frame, pipeline.scan, pipeline.preprocess)


def _preprocess(pipeline: Pipeline, scan: Scan, frame: int) -> Scan:
    one = pipeline.scan.apply(scan.frame(frame))
    for plugin in pipeline.preprocess:
        before = one.signals.shape[:3]
        with blame(plugin):
            one = plugin.process(one)
        if not isinstance(one, Scan) or one.signals.shape[:3] != before:
            raise PluginError(
                f"preprocessor '{plugin.name}' returned no scan of (frame, wavelength, detector) {before}"
            )
    used = np.asarray(one.signals)[one.valid]
    if not np.isfinite(used).all():
        raise SolverError(f"frame {frame}: {(~np.isfinite(used)).sum()} samples of valid channels are not finite")
    return one


def _operator(pipeline: Pipeline, clean: Scan, grid: Grid) -> Any:
    with blame(pipeline.forward):
        operator = pipeline.forward.operator(clean.geometry, grid)
    expected = (clean.geometry.detectors.count * clean.geometry.n_samples, grid.shape[0] * grid.shape[1])
    if tuple(operator.shape) != expected:
        name = pipeline.forward.name
        raise PluginError(f"forward model '{name}': operator of shape {tuple(operator.shape)}, not {expected}")
    return operator


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


def _reconstruct(pipeline: Pipeline, clean: Scan, grid: Grid, memo: Memo) -> Iterator[Any]:
    """Yield an iterate for each step of the solver at each wavelength, then the image of initial pressure."""
    solver = pipeline.reconstruct
    last: list[Iterate] = []
    norms: list[float] = []
    for wavelength, problem in problems(pipeline, clean, grid, memo):
        state = None
        with blame(solver):
            for state in solver.iterate(problem):
                yield StepIterate("reconstruct", wavelength, state)
        last.append(_checked_iterate(solver, state, problem))
        norms.append(norm(problem.data))
    with np.errstate(over="ignore"):
        values = np.stack([state.image for state in last]).astype(np.float32)
    made = Image(values, "initial_pressure", "a.u.", grid, clean.wavelengths_nm, history_of(pipeline))
    _check_finite(solver, "initial_pressure", made)
    yield {"initial_pressure": replace(made, diagnostics=_diagnose(values, last, norms))}


def _checked_iterate(solver: Solver, state: Iterate | None, problem: Problem) -> Iterate:
    if state is None:
        raise PluginError(f"solver '{solver.name}' ended without yielding an image")
    shape = np.shape(state.image)
    if shape != problem.shape:
        raise PluginError(f"solver '{solver.name}' returned an image of shape {shape}, not {problem.shape}")
    return state


def _check_finite(plugin: Plugin, name: str, image: Image) -> None:
    """Raise `SolverError` for infinite pixels, and for NaN where every pixel has a value: in the initial pressure."""
    wrong = ~np.isfinite(image.values) if name == "initial_pressure" else np.isinf(image.values)
    if wrong.any():
        kind = plugin.kind.replace("_", " ")
        raise SolverError(f"{kind} '{plugin.name}' returned {wrong.sum()} pixels of '{name}' that are not finite")


def _diagnose(values: np.ndarray, last: list[Iterate], norms: list[float]) -> dict[str, Any]:
    """Return what is worth knowing of a reconstruction, one entry for each wavelength."""
    names = ("iteration", "products", "objective", "residual_norm", "penalty", "relative_gap", "converged", "reason")
    table: dict[str, Any] = {name: tuple(getattr(state, name) for state in last) for name in names}
    table["data_norm"] = tuple(norms)
    table["negative_pixels"] = tuple(negative_pixels(plane).count for plane in values)
    table["details"] = tuple(dict(state.details) for state in last)
    return table


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
        _check_finite(plugin, key, image)
        made[key] = replace(image, history=(*pressure.history, history))
    yield made


def _images_of(event: Event) -> Mapping[str, Image]:
    return event.images if isinstance(event, StepDone) else {}
