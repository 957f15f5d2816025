"""A coarse image of what the pipeline would give, in time to follow a slider. No Qt, no napari."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from oatkit.api import Iterate, Solver
from oatkit.blame import blame
from oatkit.checkpoint import checkpoint
from oatkit.data import Image, Scan
from oatkit.errors import PluginError, ValidationError
from oatkit.gui.images.caption import PREVIEW
from oatkit.gui.job import PATIENCE_S, Failure, Job
from oatkit.gui.preview.coarse import coarsened
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.problem import Problem
from oatkit.reconstruction import check_finite, frame_key, preprocess, problems
from oatkit.result import Result
from oatkit.scale import remember_norm
from oatkit.weights import with_weight

PIXELS = 64
BUDGET_S = 0.06
"""From the data to the first picture, whatever the solver."""
REST_S = 1.0
"""How long a picture is made better while nothing moves."""
MIDDLE_WEIGHT = 1e-2
"""Where a slider begins while the weight is still the name of a rule."""
NODE_M_S = 100.0
"""Between the three speeds of sound at which the norm of the operator is found."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """What to look at."""

    scan: Scan
    frame: int
    wavelength: int
    """Index into those of the scan."""
    pipeline: Pipeline
    """With numbers in place of rules; see `settled`."""

    def gives_what(self, other: "Wanted | None") -> bool:
        """Say whether both ask for initial pressure from the same data in the same way, at whatever wavelength."""
        return (
            other is not None
            and self.scan is other.scan
            and self.frame == other.frame
            and _steps(self.pipeline) == _steps(other.pipeline)
        )

    def equals(self, other: "Wanted | None") -> bool:
        """Say whether both give the same picture."""
        return other is not None and self.wavelength == other.wavelength and self.gives_what(other)


def _steps(pipeline: Pipeline) -> tuple[Any, ...]:
    return (pipeline.scan, pipeline.grid, pipeline.preprocess, pipeline.forward, pipeline.reconstruct)


def settled(pipeline: Pipeline, scan: Scan, result: Result | None = None) -> Pipeline:
    """Return the pipeline with numbers for speed of sound and weight.

    A rule stands for what it chose in the last run, or else for the speed of the scan and `MIDDLE_WEIGHT`.
    """
    speed, solver = pipeline.scan.speed_of_sound_m_s, pipeline.reconstruct
    if not isinstance(speed, float | int):
        focused = speed == "focus" and result is not None and result.speed_choice
        speed = result.scan["speed_of_sound_m_s"] if result and focused else scan.geometry.speed_of_sound_m_s
    if isinstance(getattr(solver, "weight", None), str):
        solver = with_weight(solver, result.weight_choice.get("weight", MIDDLE_WEIGHT) if result else MIDDLE_WEIGHT)
    return with_speed(pipeline, float(speed)).with_solver(solver)


def with_speed(pipeline: Pipeline, speed_of_sound_m_s: float | None) -> Pipeline:
    """Return the pipeline with another speed of sound."""
    table = pipeline.scan.model_copy(update={"speed_of_sound_m_s": speed_of_sound_m_s})
    return pipeline.model_copy(update={"scan": table})


def speed_of(pipeline: Pipeline) -> float:
    """Return the speed of sound of a pipeline that `settled` has returned, m/s."""
    speed = pipeline.scan.speed_of_sound_m_s
    assert isinstance(speed, float)
    return speed


def has_weight(solver: Solver) -> bool:
    """Say whether a solver has a dimensionless weight."""
    return "weight" in type(solver).model_fields and getattr(solver, "scaling", "relative") == "relative"


class CoarseImages:
    """Makes coarse images by the pipeline's own steps, and keeps what one has in common with the next.

    Signals depend neither on the speed of sound nor on the weight, the operator not on the weight. Nothing of it enters
    the memo of a session: a coarse image is no result.
    """

    def __init__(self) -> None:
        self._memo, self._newest = Memo(64_000_000), Memo()

    def looks(self, wanted: Wanted) -> Iterator[Image]:
        """Yield a picture within `BUDGET_S` of having the data, and a better one where the solver goes on.

        Of a solver that takes longer its newest iterate is taken. Raises what running the pipeline raises, and
        `ValidationError` for a weight in absolute units.
        """
        solver = wanted.pipeline.reconstruct
        # A weight carries over since it is dimensionless: |A|^2 and x_ref are those of the coarse problem, which has
        # fewer data, larger pixels and a lower band, and all of these change them as they change |A x - b|^2.
        if getattr(solver, "scaling", "relative") != "relative":
            raise ValidationError('no preview with scaling = "absolute": that weight holds for the full image only')
        coarse = wanted.pipeline.model_copy(update={"grid": _coarse_grid(wanted.pipeline)})
        key, data = self._data(wanted, coarse)
        start = perf_counter()
        problem = self._problem(key, data, coarse)
        with blame(solver):
            state = None
            for state in _in_time(solver.iterate(problem), start):
                yield _image(solver, state, problem, data)
        if state is None:
            raise PluginError(f"solver '{solver.name}' ended without yielding an image")

    def _data(self, wanted: Wanted, coarse: Pipeline) -> tuple[Any, Scan]:
        """Return the coarse signals at the scan's own speed of sound, and what they depend on."""
        own = with_speed(coarse, None)
        table = own.scan.model_copy(update={"wavelengths_nm": ()})
        key = (*frame_key(wanted.scan, wanted.frame), wanted.wavelength, table, own.preprocess, own.grid)

        def make() -> Scan:
            one = _one_plane(wanted.scan, wanted.frame, wanted.wavelength)
            clean = preprocess(own.model_copy(update={"scan": table}), one, 0)
            return coarsened(clean, own.grid.grid())

        return key, self._memo.get(key, make, lambda made: int(np.asarray(made.signals).nbytes))

    def _problem(self, key: Any, data: Scan, coarse: Pipeline) -> Problem:
        speed = speed_of(coarse)

        def make() -> Problem:
            problem = _problem_at(speed, data, coarse)
            own = data.geometry.speed_of_sound_m_s
            if abs(speed - own) <= NODE_M_S:
                acoustics = (data.geometry, coarse.grid, coarse.forward, data.valid.tobytes())
                norms = self._memo.get(acoustics, lambda: _norms(data, coarse), lambda found: 24)
                remember_norm(problem.operator, (_parabola((speed - own) / NODE_M_S, norms), 0))
            return problem

        return self._newest.keep((key, coarse.forward, speed), make)


def _norms(data: Scan, coarse: Pipeline) -> tuple[float, ...]:
    """Return the norms of the operator at three speeds of sound about that of the scan.

    It takes more products to find a norm than a picture has time for; between the three it follows a parabola.
    """
    own = data.geometry.speed_of_sound_m_s
    found = []
    for speed in (own - NODE_M_S, own, own + NODE_M_S):
        problem = _problem_at(speed, data, coarse)
        for _ in problem.settle_norm():
            checkpoint()
        found.append(problem.norm)
    return tuple(found)


def _parabola(at: float, values: tuple[float, ...]) -> float:
    """Return the parabola through `values` at -1, 0 and 1."""
    below, middle, above = values
    return middle + at * (above - below) / 2 + at * at * ((above + below) / 2 - middle)


def _problem_at(speed: float, data: Scan, coarse: Pipeline) -> Problem:
    _, problem = next(problems(coarse, data.with_speed_of_sound(speed, "preview"), coarse.grid.grid(), Memo()))
    return problem


def _one_plane(scan: Scan, frame: int, wavelength: int) -> Scan:
    """Return one wavelength of one frame: steps on raw signals treat each for itself."""
    whole = scan.frame(frame)
    one = slice(wavelength, wavelength + 1)
    names = ("valid", "pulse_energy", "temperature_c", "timestamps_s", "position_m")
    parts = {name: values[:, one] for name in names if (values := getattr(whole, name)) is not None}
    return replace(whole, signals=np.asarray(whole.signals)[:, one], wavelengths_nm=scan.wavelengths_nm[one], **parts)


def _coarse_grid(pipeline: Pipeline) -> Any:
    return pipeline.grid.model_copy(update={"pixels": min(PIXELS, pipeline.grid.pixels)})


def _in_time(states: Iterator[Iterate], start: float) -> Iterator[Iterate]:
    """Yield the newest state when `BUDGET_S` have gone since `start`, and the last one before `REST_S`."""
    last = shown = None
    for last in states:
        checkpoint()
        if not (last.iteration or np.any(last.image)):
            continue  # the scale is being set
        gone = perf_counter() - start
        if shown is None and gone > BUDGET_S:
            shown = last
            yield shown
        if gone > REST_S:
            break
    if last is not None and last is not shown:
        yield last


def _image(solver: Solver, state: Iterate, problem: Problem, data: Scan) -> Image:
    if np.shape(state.image) != problem.shape:
        raise PluginError(f"solver '{solver.name}' returned an image of shape {np.shape(state.image)}")
    assert problem.grid is not None
    values = np.asarray(state.image, dtype=np.float32)
    rows, columns = problem.shape
    about = {
        PREVIEW: f"preview of {columns} x {rows} pixels",
        "iteration": state.iteration,
        "converged": state.converged,
    }
    made = Image(values, "initial_pressure", "a.u.", problem.grid, data.wavelengths_nm, diagnostics=about)
    check_finite(f"solver '{solver.name}'", "initial_pressure", made)
    return made


class Preview:
    """One pass at a time; only what was asked for last is ever handed out."""

    def __init__(self, looks: Callable[[Wanted], Iterator[Image]] | None = None) -> None:
        self._looks = looks or CoarseImages().looks
        self._job: Job | None = None
        self._next: Wanted | None = None
        self.waiting = False
        """Whether nothing has come yet of what was asked for last."""

    def ask(self, wanted: Wanted) -> None:
        """Ask for a picture; the pass before ends at its next checkpoint, and its pictures are dropped."""
        self.drop()
        self._next, self.waiting = wanted, True
        if self._job is None:
            self._begin()

    def drop(self) -> None:
        """Ask for nothing any more."""
        self._next, self.waiting = None, False
        if self._job is not None:
            self._job.cancel()

    @property
    def busy(self) -> bool:
        """Whether a pass is under way: `poll` has to be called again."""
        return self._job is not None

    def poll(self) -> Image | Failure | None:
        """Return what is new of what was asked for last, and begin its pass where the one before has ended."""
        job = self._job
        if job is None:
            return None
        done = job.done  # asked first: what is yielded between the two questions is not lost
        items = job.drain()
        if done:
            self._job = None
            self._begin()
        if job.cancelled:
            return None
        if done or items:
            self.waiting = False
        return items[-1] if items else job.failure

    def stop(self, seconds: float = PATIENCE_S) -> None:
        """End the pass and wait for its thread."""
        self.drop()
        if self._job is not None:
            self._job.wait(seconds)
            self._job = None

    def _begin(self) -> None:
        wanted, self._next = self._next, None
        if wanted is not None:
            self._job = Job(lambda job: self._looks(wanted)).start()
