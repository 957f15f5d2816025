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


def run(
    pipeline: Pipeline,
    scan: Scan,
    frame: int = 0,
    memo: Memo | None = None,
    on_event: Callable[[Event], None] = lambda event: None,
) -> Result:
    """Run `pipeline` over one frame of `scan` and return its images, with how they came about.

    A weight that is still the name of a rule is chosen first, on the scan's first frame. `on_event` is shown every
    event. Raises an `OatkitError`.
    """
    memo = Memo() if memo is None else memo
    resolved, choice = resolve(pipeline, scan, memo)
    return run_resolved(resolved, pipeline, choice, scan, frame, memo, on_event)


def run_resolved(
    resolved: Pipeline,
    requested: Pipeline,
    choice: weights.Choice | None,
    scan: Scan,
    frame: int,
    memo: Memo,
    on_event: Callable[[Event], None],
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
    if choice:
        pressure = images["initial_pressure"]
        diagnostics = {**pressure.diagnostics, "weight_choice": choice.table()}
        images["initial_pressure"] = replace(pressure, diagnostics=diagnostics)
    return Result(
        images=images,
        pipeline=resolved.model_dump(),
        requested=requested.model_dump(),
        versions=versions(resolved),
        scan=describe_scan(resolved.scan.apply(scan)),
        seconds=seconds,
        warnings=tuple(dict.fromkeys(notes)),
        frame_index=frame,
    )


def steps(pipeline: Pipeline, scan: Scan, frame: int = 0, memo: Memo | None = None) -> Iterator[Event]:
    """Yield the events of running `pipeline` over one frame; close the generator to cancel.

    Raises `ValidationError` where the weight is still the name of a rule (`resolve` chooses it), `PluginError` where
    a plugin returns what it may not.
    """
    memo = Memo() if memo is None else memo
    scan = pipeline.scan.apply(scan)
    grid = pipeline.grid.grid()
    scan.geometry.check_grid(grid)
    chain: tuple[Any, ...] = (scan.fingerprint, frame, grid)

    yield StepStarted("preprocess")
    start = time.perf_counter()
    chain = (*chain, pipeline.preprocess)
    clean = memo.get(chain, lambda: preprocess(pipeline, scan.frame(frame)), _scan_bytes)
    added = clean.notes[len(scan.notes) :]
    yield StepDone("preprocess", time.perf_counter() - start, {}, added)

    chain = (*chain, pipeline.forward, pipeline.reconstruct)
    images: dict[str, Image] = {}
    first = _memoised(memo, chain, "reconstruct", _reconstruct(pipeline, clean, grid, memo))
    for event in first:
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


def preprocess(pipeline: Pipeline, scan: Scan) -> Scan:
    """Return a scan of one frame after all steps of ``preprocess``, checked to be finite."""
    for plugin in pipeline.preprocess:
        before = scan.signals.shape
        scan = plugin.process(scan)
        if not isinstance(scan, Scan) or scan.signals.shape != before:
            raise PluginError(f"preprocessor '{plugin.name}' returned no scan of shape {before}")
    used = np.asarray(scan.signals)[scan.valid]
    if not np.isfinite(used).all():
        raise SolverError(f"frame: {(~np.isfinite(used)).sum()} samples of valid channels are not finite")
    return scan


def problems(pipeline: Pipeline, clean: Scan, grid: Grid, memo: Memo) -> Iterator[tuple[float, Problem]]:
    """Yield wavelength (nm) and problem for each wavelength of a preprocessed frame."""
    key = (clean.geometry, grid, pipeline.forward)
    operator = memo.get(key, lambda: pipeline.forward.operator(clean.geometry, grid), _operator_bytes)
    expected = (clean.geometry.detectors.count * clean.geometry.n_samples, grid.shape[0] * grid.shape[1])
    if tuple(operator.shape) != expected:
        raise PluginError(
            f"forward model '{pipeline.forward.name}': operator of shape {operator.shape}, not {expected}"
        )
    signals = np.asarray(clean.signals)[0]
    for wavelength, record, valid in zip(clean.wavelengths_nm, signals, clean.valid[0], strict=True):
        rows = np.repeat(valid, clean.geometry.n_samples)
        masked = memo.get((key, rows.tobytes()), partial(without_rows, operator, rows), _operator_bytes)
        data = np.where(rows, record.ravel(), 0)
        yield wavelength, Problem(masked, data, grid.shape, clean.geometry, grid)


def resolve(pipeline: Pipeline, scan: Scan, memo: Memo | None = None) -> tuple[Pipeline, weights.Choice | None]:
    """Return the pipeline with its weight chosen, and how it was chosen.

    The rule runs once, on the scan's first frame and its strongest wavelength (the one of the largest signals),
    whatever part of the scan is asked for. A weight that is a number is left alone.
    """
    if not isinstance(getattr(pipeline.reconstruct, "weight", None), str):
        return pipeline, None
    memo = Memo() if memo is None else memo
    scan = pipeline.scan.apply(scan)
    clean = preprocess(pipeline, scan.frame(0))
    _, strongest = max(problems(pipeline, clean, pipeline.grid.grid(), memo), key=lambda pair: norm(pair[1].data))
    solver, choice = weights.resolve(pipeline.reconstruct, strongest)
    return pipeline.with_solver(solver), choice


def describe_scan(scan: Scan) -> dict[str, Any]:
    """Return what a result keeps of the scan that it was made from, as plain values."""
    return {
        "name": scan.name,
        "source": scan.source,
        "reader": scan.reader,
        "fingerprint": scan.fingerprint,
        "frames": scan.frames,
        "wavelengths_nm": list(scan.wavelengths_nm),
        "speed_of_sound_m_s": scan.geometry.speed_of_sound_m_s,
        "speed_of_sound_source": scan.speed_of_sound_source,
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


def _reconstruct(pipeline: Pipeline, clean: Scan, grid: Grid, memo: Memo) -> Iterator[Any]:
    """Yield an iterate for each step of the solver at each wavelength, then the image of initial pressure."""
    solver = pipeline.reconstruct
    last: list[Iterate] = []
    norms: list[float] = []
    for wavelength, problem in problems(pipeline, clean, grid, memo):
        state = None
        for state in solver.iterate(problem):
            yield StepIterate("reconstruct", wavelength, state)
        last.append(_checked_iterate(solver, state, problem))
        norms.append(norm(problem.data))
    values = np.stack([state.image for state in last]).astype(np.float32)
    image = Image(
        values,
        "initial_pressure",
        "a.u.",
        grid,
        clean.wavelengths_nm,
        history_of(pipeline),
        _diagnose(values, last, norms),
    )
    yield {"initial_pressure": image}


def history_of(pipeline: Pipeline) -> tuple[dict[str, Any], ...]:
    """Return the steps up to the reconstruction as plain tables, each with the name of its slot."""
    chain: list[tuple[str, Plugin]] = [("preprocess", p) for p in pipeline.preprocess]
    chain += [("forward", pipeline.forward), ("reconstruct", pipeline.reconstruct)]
    return tuple({"step": slot, **plugin.model_dump()} for slot, plugin in chain)


def _checked_iterate(solver: Solver, state: Iterate | None, problem: Problem) -> Iterate:
    if state is None:
        raise PluginError(f"solver '{solver.name}' ended without yielding an image")
    image = np.asarray(state.image)
    if image.shape != problem.shape:
        raise PluginError(f"solver '{solver.name}' returned an image of shape {image.shape}, not {problem.shape}")
    if not np.isfinite(image).all():
        raise SolverError(f"solver '{solver.name}' returned {(~np.isfinite(image)).sum()} pixels that are not finite")
    return state


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
    if name == "segment":
        made = {"boundary": plugin.segment(pressure)}
    else:
        made = dict(plugin.unmix(UnmixProblem(pressure, boundary=images.get("boundary"))))
    history = {"step": name, **plugin.model_dump()}
    for key, image in made.items():
        if not isinstance(image, Image) or image.grid != pressure.grid:
            raise PluginError(
                f"{plugin.kind.replace('_', ' ')} '{plugin.name}' returned no image on the grid as '{key}'"
            )
        made[key] = replace(image, history=(*pressure.history, history))
    yield made


def _images_of(event: Event) -> Mapping[str, Image]:
    return event.images if isinstance(event, StepDone) else {}


def _scan_bytes(scan: Scan) -> int:
    return int(np.asarray(scan.signals).nbytes)


def _operator_bytes(operator: Any) -> int:
    """Tell the memory that an operator says it holds; one without a matrix holds little and need not say."""
    return int(getattr(operator, "nbytes", 0))
