"""One frame from raw signals to initial pressure: what the engine does in its first two steps."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from oatkit.api import Iterate, Plugin, Problem, Solver
from oatkit.blame import blame
from oatkit.checkpoint import checkpoint
from oatkit.data import Grid, Image, Scan
from oatkit.errors import PluginError, SolverError
from oatkit.events import StepIterate
from oatkit.masking import without_rows
from oatkit.memo import Memo
from oatkit.metrics import negative_pixels
from oatkit.pipeline import Pipeline
from oatkit.vectors import norm

DEFINED_EVERYWHERE = ("initial_pressure", "boundary", "fluence")
"""Images without undefined pixels."""


def preprocess(pipeline: Pipeline, scan: Scan, frame: int, memo: Memo | None = None) -> Scan:
    """Return one frame after all steps of ``preprocess``, checked to be finite and seen by the grid."""
    memo = Memo() if memo is None else memo
    one = partial(_preprocess, pipeline, scan, frame)
    clean = memo.get(raw_key(pipeline, scan, frame), one, lambda made: int(np.asarray(made.signals).nbytes))
    clean.geometry.check_grid(pipeline.grid.grid())
    return clean


def strongest(clean: Scan) -> Scan:
    """Return a preprocessed frame with one wavelength only: that of the largest signals of valid detectors."""
    pairs = zip(clean.signals[0], clean.valid[0], strict=True)
    best = int(np.argmax([norm(np.asarray(record[valid], dtype=float)) for record, valid in pairs]))
    one = slice(best, best + 1)
    return Scan(
        clean.signals[:1, one], clean.geometry, clean.wavelengths_nm[one], clean.valid[:1, one], name=clean.name
    )


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


def reconstruct(pipeline: Pipeline, clean: Scan, grid: Grid, memo: Memo) -> Iterator[Any]:
    """Yield an iterate for each step of the solver at each wavelength, then the image of initial pressure."""
    solver = pipeline.reconstruct
    last: list[Iterate] = []
    norms: list[float] = []
    for wavelength, alone in problems(pipeline, clean, grid, memo):
        problem = alone.near(last[-1].image) if last else alone
        state = None
        with blame(solver):
            for state in solver.iterate(problem):
                checkpoint()
                if not isinstance(state, Iterate):
                    raise PluginError(f"solver '{solver.name}' yielded a {type(state).__name__}, not an Iterate")
                yield StepIterate("reconstruct", wavelength, state)
        last.append(_checked_iterate(solver, state, problem))
        norms.append(norm(problem.data))
    with np.errstate(over="ignore"):
        values = np.stack([state.image for state in last]).astype(np.float32)
    made = Image(values, "initial_pressure", "a.u.", grid, clean.wavelengths_nm, history_of(pipeline))
    check_finite(f"solver '{solver.name}'", "initial_pressure", made)
    yield {"initial_pressure": replace(made, diagnostics=_diagnose(values, last, norms))}


def _checked_iterate(solver: Solver, state: Iterate | None, problem: Problem) -> Iterate:
    if state is None:
        raise PluginError(f"solver '{solver.name}' ended without yielding an image")
    shape = np.shape(state.image)
    if shape != problem.shape:
        raise PluginError(f"solver '{solver.name}' returned an image of shape {shape}, not {problem.shape}")
    kind = np.asarray(state.image).dtype
    if kind.kind not in "iuf":
        raise PluginError(f"solver '{solver.name}' returned an image of {kind}, not of real numbers")
    return state


def check_finite(who: str, name: str, image: Image) -> None:
    """Raise `SolverError` for infinite pixels, and for NaN in an image that has a value everywhere."""
    wrong = ~np.isfinite(image.values) if name in DEFINED_EVERYWHERE else np.isinf(image.values)
    if wrong.any():
        raise SolverError(f"{who} returned {wrong.sum()} pixels of '{name}' that are not finite")


def _diagnose(values: np.ndarray, last: list[Iterate], norms: list[float]) -> dict[str, Any]:
    """Return what is worth knowing of a reconstruction, one entry for each wavelength."""
    names = ("iteration", "products", "objective", "residual_norm", "penalty", "relative_gap", "converged", "reason")
    table: dict[str, Any] = {name: tuple(getattr(state, name) for state in last) for name in names}
    table["data_norm"] = tuple(norms)
    table["negative_pixels"] = tuple(negative_pixels(plane).count for plane in values)
    table["details"] = tuple(dict(state.details) for state in last)
    return table


def history_of(pipeline: Pipeline) -> tuple[dict[str, Any], ...]:
    """Return the steps up to the reconstruction as plain tables, each with the name of its slot."""
    chain: list[tuple[str, Plugin]] = [("preprocess", p) for p in pipeline.preprocess]
    chain += [("forward", pipeline.forward), ("reconstruct", pipeline.reconstruct)]
    return tuple({"step": slot, **plugin.model_dump()} for slot, plugin in chain)


def frame_key(scan: Scan, frame: int) -> tuple[Any, ...]:
    """Return what all keys of a frame begin with in the memo."""
    return (scan.fingerprint, scan.notes, frame)


def raw_key(pipeline: Pipeline, scan: Scan, frame: int) -> tuple[Any, ...]:
    """Return all that a preprocessed frame depends on."""
    return (*frame_key(scan, frame), pipeline.scan, pipeline.preprocess)


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
