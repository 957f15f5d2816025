"""A sweep over the weight with all that it shows: the curve, the picks of the rules, the image of each point. No Qt."""

from bisect import insort
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from oatkit.api import Iterate, Problem, Solver
from oatkit.data import Image, Scan
from oatkit.engine.rules import frame_of_rules, remember_choice, with_speed
from oatkit.errors import ValidationError
from oatkit.events import Event, StepStarted
from oatkit.gui.job import Job
from oatkit.gui.session import Session
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.reconstruction import check_finite, history_of, preprocess, problems, strongest
from oatkit.vectors import norm
from oatkit.weights import CANDIDATES, Choice, CurvePoint, choose, weights_to_try, with_weight

LOWEST, HIGHEST, NUMBER = CANDIDATES[0], CANDIDATES[-1], len(CANDIDATES)
"""The weights that the rules try, of which a sweep tries the same unless others are asked for."""

NAMES = {"curvature": "corner", "chord": "chord", "prediction": "hold-out"}
"""What is written beside the picks of `oatkit.weights`."""

BEFORE = ("scan", "preprocess", "grid", "forward")
"""Tables of the pipeline that an image depends on beside its solver."""

NEAR_NM = 0.5
"""A wavelength of the scan this close is the one asked for."""


@dataclass(frozen=True, eq=False)
class Tried:
    """One weight, and the image that it gives."""

    point: CurvePoint
    image: Image
    """Of one wavelength; its diagnostics have the names of a reconstruction's."""


@dataclass(frozen=True)
class Begun:
    """What is swept, once it is known."""

    wavelength_nm: float
    is_strongest: bool
    """Whether it is the wavelength that the rules look at."""
    data_norm: float


@dataclass(frozen=True)
class Request:
    """What to sweep: `number` weights evenly on a logarithmic scale, at one wavelength of the frame."""

    low: float = LOWEST
    high: float = HIGHEST
    number: int = NUMBER
    wavelength_nm: float | None = None
    """The strongest where it is None."""
    hold_out: bool = False
    """Whether the weights are tried again without every seventh detector, for the rule "hold-out"."""

    def weights(self) -> tuple[float, ...]:
        """Return the weights, rising. Raises `ValidationError` for a range that is none."""
        if not 0 < self.low < self.high < np.inf:
            raise ValidationError(
                f"weights: expected a range from a number above 0 to a larger one, got {self.low:g} to {self.high:g}"
            )
        return tuple(float(weight) for weight in np.geomspace(self.low, self.high, self.number))


@dataclass
class WeightSweep:
    """A sweep over a session's pipeline, as far as it has come; one without a pipeline stands for none."""

    session: Session
    request: Request = Request()
    scan: Scan | None = None
    frame: int = 0
    pipeline: Pipeline | None = None
    """As it stood when the sweep began; scan and frame likewise."""
    begun: Begun | None = None
    tried: list[Tried] = field(default_factory=list)
    """By rising weight."""
    held_out: list[CurvePoint] = field(default_factory=list)
    """What each weight gives without every seventh detector."""
    choices: dict[str, Choice] = field(default_factory=dict)
    """By rule, once all weights are tried."""
    step: str = ""
    """What is at work before the first weight, in words."""

    def take(self, item: Any) -> None:
        """Take note of what the job has yielded."""
        if isinstance(item, StepStarted):
            self.step = item.step
        elif isinstance(item, Begun):
            self.begun = item
        elif isinstance(item, Tried):
            insort(self.tried, item, key=lambda tried: tried.point.weight)
        elif isinstance(item, CurvePoint):
            self.held_out.append(item)
        elif isinstance(item, Choice):
            self.choices[item.rule] = item

    @property
    def progress(self) -> str:
        """How far it is: ``"7 of 13"``."""
        if self.begun is None:
            return self.step or "preprocessing"
        done = len(self.held_out) if "l-curve" in self.choices else len(self.tried)
        return ("hold-out, " if "l-curve" in self.choices else "") + f"{done} of {self.request.number}"

    @property
    def picks(self) -> dict[str, float]:
        """The weight that each rule picks, by the name of the rule in words; none until all weights are tried."""
        found = {name: weight for choice in self.choices.values() for name, weight in choice.picks}
        # Both sweeps have a curve of residuals; the L-curve's rules are those of the one with all detectors.
        found |= dict(self.choices["l-curve"].picks) if "l-curve" in self.choices else {}
        return {NAMES[name]: weight for name, weight in found.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know before trusting the picks, each with the rule that it is about."""
        return tuple(f"{rule}: {note}" for rule, choice in self.choices.items() for note in choice.notes)

    def stale(self) -> str:
        """Say why the points are not what the session's pipeline gives now; nothing where they are, or are none."""
        then, now = self.pipeline, self.session.pipeline
        if then is None:
            return ""
        if self.session.scan is not self.scan or self.session.frame != self.frame:
            return "another scan or frame has been opened since this sweep: sweep again"
        changed = [name for name in BEFORE if getattr(now, name) != getattr(then, name)]
        if _without_weight(now.reconstruct) != _without_weight(then.reconstruct):
            changed.append("reconstruct")
        return f"{_tables(changed)} changed since this sweep: sweep again" if changed else ""

    def take_weight(self, index: int) -> None:
        """Write a weight that was tried into the pipeline. Raises `ValidationError` where the sweep is stale."""
        if sentence := self.stale():
            raise ValidationError(sentence)
        self.session.document.set("reconstruct", "weight", self.tried[index].point.weight)

    def take_rule(self, rule: str) -> None:
        """Let the pipeline choose its weight by a rule. Raises `ValidationError` for a solver without a weight."""
        weights_to_try(self.session.pipeline.reconstruct)
        self.session.document.set("reconstruct", "weight", rule)


def begin(session: Session, request: Request) -> tuple[WeightSweep, Job]:
    """Start a sweep and return it with the job that yields what its `take` takes.

    The image of a weight is the one of a run, bit by bit; but where `maxent-nlcg` begins near the weight or the
    wavelength before, the two agree within their certificates. Raises `ValidationError` where there is no scan, the
    solver has no weight or one that is not dimensionless, and the weights are too few or no range.
    """
    scan, frame, pipeline = session.scan, session.frame, session.pipeline
    if scan is None:
        raise ValidationError("no scan is open: drag one into the window, or open the sample")
    candidates = _checked(pipeline.reconstruct, request)
    work = partial(_sweep, request, candidates, pipeline, scan, frame, session.memo)
    return WeightSweep(session, request, scan, frame, pipeline), Job(work).start()


def _checked(solver: Solver, request: Request) -> list[float]:
    if getattr(solver, "scaling", "relative") == "absolute":
        raise ValidationError("weight: a sweep tries dimensionless weights; set scaling to 'relative' in Reconstruct")
    return weights_to_try(solver, request.weights())


def _sweep(
    request: Request, candidates: list[float], asked: Pipeline, scan: Scan, frame: int, memo: Memo, job: Job
) -> Iterator[Any]:
    """Yield what is swept, each weight with its image, and the choices."""

    def tell(event: Event) -> None:
        job.check()
        job.show(event)

    def show(point: CurvePoint, last: Iterate) -> None:
        job.show(Tried(point, _image(pipeline, begun.wavelength_nm, last, point)))

    rules_frame = frame_of_rules(asked, frame)
    pipeline, _ = with_speed(asked, scan, rules_frame, memo, tell)
    begun, problem = _problem(pipeline, preprocess(pipeline, scan, frame, memo), request.wavelength_nm, memo)
    yield begun
    for rule in ("l-curve", "hold-out")[: 1 + request.hold_out]:
        look = show if rule == "l-curve" else lambda point, last: job.show(point)
        choice = choose(pipeline.reconstruct, problem, rule, candidates, tell, look)
        if begun.is_strongest and frame == rules_frame and tuple(candidates) == CANDIDATES:
            remember_choice(choice, pipeline, scan, frame, memo)
        yield choice


def _problem(pipeline: Pipeline, clean: Scan, wavelength_nm: float | None, memo: Memo) -> tuple[Begun, Problem]:
    """Return the problem at a wavelength, or at the strongest."""
    one = strongest(clean)
    top = one.wavelengths_nm[0]
    wanted = top if wavelength_nm is None else wavelength_nm
    if abs(wanted - top) < NEAR_NM:
        clean = one
    for found, problem in problems(pipeline, clean, pipeline.grid.grid(), memo):
        if abs(found - wanted) < NEAR_NM:
            return Begun(found, clean is one, norm(problem.data)), problem
    raise ValidationError(f"{wanted:g} nm: the pipeline uses no such wavelength of the scan")


def _image(pipeline: Pipeline, wavelength_nm: float, last: Iterate, point: CurvePoint) -> Image:
    """Return the image of a weight as a run of the pipeline makes it."""
    solver = with_weight(pipeline.reconstruct, point.weight)
    with np.errstate(over="ignore"):
        values = np.asarray(last.image)[None].astype(np.float32)
    names = ("iteration", "objective", "residual_norm", "penalty", "relative_gap", "converged", "reason")
    diagnostics = {name: (getattr(last, name),) for name in names}
    history = history_of(pipeline.with_solver(solver))
    made = Image(values, "initial_pressure", "a.u.", pipeline.grid.grid(), (wavelength_nm,), history, diagnostics)
    check_finite(f"solver '{solver.name}'", "initial_pressure", made)
    return made


def _without_weight(solver: Solver) -> Solver:
    return with_weight(solver, 1.0) if "weight" in type(solver).model_fields else solver


def _tables(names: list[str]) -> str:
    return " and ".join(f"[{name}]" for name in names) + (" has" if len(names) == 1 else " have")
