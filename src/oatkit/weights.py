"""Choice of the regularization weight by a rule, for any solver that has one.

No rule is safe (their picks differ by decades on the same data), so a `Choice` keeps the whole curve, what the other
rules would have picked, and a note where they disagree.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from oatkit.api import Iterate, Problem, Solver
from oatkit.blame import blame
from oatkit.errors import ValidationError
from oatkit.events import Listener, StepStarted, ignore
from oatkit.masking import without_rows
from oatkit.vectors import norm

Rule = Literal["l-curve", "hold-out"]

CANDIDATES = tuple(float(weight) for weight in np.geomspace(1e-4, 1.0, 13))
"""Dimensionless weights that are tried unless others are given: three in each decade of 1e-4 .. 1.

The best weight of every built-in solver lay inside for simulated breast, star and vessel phantoms at 32 dB."""

HELD_OUT = 7
"""Every seventh detector is kept back by the rule "hold-out"."""

CHOOSING = "choosing the weight"
"""What listeners are told."""

DISAGREEMENT = 10.0
"""Picks of two rules that differ by more than this factor are worth a note."""


@dataclass(frozen=True)
class CurvePoint:
    """What one candidate gave."""

    weight: float
    residual_norm: float
    """|A x - b| over the detectors that were used."""
    penalty: float
    """The unweighted regularization term."""
    prediction_error: float = float("nan")
    """|A x - b| over the detectors that were kept back; NaN where none were."""
    converged: bool = True


@dataclass(frozen=True)
class Choice:
    """A weight, and how it was chosen."""

    rule: str
    weight: float
    curve: tuple[CurvePoint, ...]
    """All candidates, by rising weight."""
    picks: tuple[tuple[str, float], ...]
    """What each way to read the curve picks: ``curvature`` and ``chord`` of the L-curve, ``prediction``."""
    notes: tuple[str, ...] = ()
    """What to know before trusting it."""

    @property
    def index(self) -> int:
        """Where on the curve the chosen weight lies."""
        return [point.weight for point in self.curve].index(self.weight)

    @property
    def disagreement(self) -> float:
        """Largest factor between two picks."""
        weights = [weight for _, weight in self.picks]
        return max(weights) / min(weights)

    def table(self) -> dict[str, Any]:
        """Return everything as plain values, for a result's record."""
        return asdict(self) | {"picks": dict(self.picks), "disagreement": self.disagreement}


PointListener = Callable[[CurvePoint, Iterate], None]
"""Shown each point of a curve, with the last iterate of the solver there."""


def ignore_point(point: CurvePoint, last: Iterate) -> None:
    """Look at no point."""


def resolve(
    solver: Solver, problem: Problem, on_event: Listener = ignore, on_point: PointListener = ignore_point
) -> tuple[Solver, Choice | None]:
    """Return the solver with a number for its weight, and how that was chosen; None where it was a number already.

    Tells and raises what `choose` does.
    """
    rule = getattr(solver, "weight", None)
    if not isinstance(rule, str):
        return solver, None
    choice = choose(solver, problem, rule, None, on_event, on_point)
    return with_weight(solver, choice.weight), choice


def with_weight(solver: Solver, weight: float) -> Solver:
    """Return the same solver with another weight."""
    return solver.model_copy(update={"weight": float(weight)})


def choose(
    solver: Solver,
    problem: Problem,
    rule: str,
    candidates: Sequence[float] | None = None,
    on_event: Listener = ignore,
    on_point: PointListener = ignore_point,
) -> Choice:
    """Solve the problem at each candidate weight and pick one by `rule`.

    ``"l-curve"`` takes the corner of the L-curve, ``"hold-out"`` the weight whose image predicts the signals of every
    seventh detector best when it is made from the others. The candidates are one path, from the strongest to the
    weakest: a solver may begin near the image of the one before (`Problem.start`), and then its image at a weight is
    the one that it gives alone to within its tolerance. `on_event` is told before each candidate how many are done,
    `on_point` is shown each point. What the solver raises beside our errors becomes a `PluginError`. Raises
    `ValidationError` for an unknown rule, for fewer than five or non-positive candidates, for a solver without a
    weight, for a weight in absolute units without candidates of its own, for data that are zero, and for a hold-out
    without fourteen detectors.
    """
    if rule not in get_args(Rule):
        raise ValidationError(f"weight: no rule named '{rule}'; expected {' or '.join(get_args(Rule))}")
    weights = weights_to_try(solver, candidates)
    if not problem.data.any():
        raise ValidationError("weight: the data are zero, so that no rule can choose; take a number")
    fit, rows = (problem, None) if rule == "l-curve" else _keep_back(problem)
    curve = tuple(sweep(solver, fit, weights[::-1], problem, rows, on_event, on_point))[::-1]
    picks = _picks(curve)
    weight = picks["curvature" if rule == "l-curve" else "prediction"]
    return Choice(rule, weight, curve, tuple(picks.items()), tuple(_notes(weight, curve, picks)))


def weights_to_try(solver: Solver, candidates: Sequence[float] | None = None) -> list[float]:
    """Return the candidates (`CANDIDATES` unless others are given) by rising weight, each once.

    Raises the `ValidationError` of `choose` for a solver and candidates that do not go together.
    """
    if "weight" not in type(solver).model_fields:
        raise ValidationError(f"solver '{solver.name}' has no weight to choose")
    if candidates is None and getattr(solver, "scaling", "relative") == "absolute":
        raise ValidationError(
            "weight: a rule searches dimensionless weights; take scaling = 'relative', or call oatkit.weights.choose "
            "with candidates in the units of the formula"
        )
    weights = sorted({float(weight) for weight in (CANDIDATES if candidates is None else candidates)})
    if len(weights) < 5 or not all(0 < weight < np.inf for weight in weights):
        raise ValidationError(f"candidates: expected five or more different weights above 0, got {weights}")
    return weights


def sweep(
    solver: Solver,
    fit: Problem,
    weights: Sequence[float],
    whole: Problem,
    held_out: np.ndarray | None,
    on_event: Listener = ignore,
    on_point: PointListener = ignore_point,
) -> Iterator[CurvePoint]:
    """Yield what each weight gives on the problem `fit`, and how well it predicts the rows `held_out` of `whole`.

    Each begins near the image of the weight before.
    """
    here = fit
    for done, weight in enumerate(weights):
        on_event(StepStarted(f"{CHOOSING}, {done} of {len(weights)} done"))
        with blame(solver):
            last = with_weight(solver, weight).solve(here)
            point = _point(solver, weight, last)
            if held_out is not None:
                misfit = (whole.forward(last.image) - whole.data)[held_out]
                point = replace(point, prediction_error=norm(misfit))
            here = fit.near(last.image)
        on_point(point, last)
        yield point


def _point(solver: Solver, weight: float, last: Iterate) -> CurvePoint:
    if not (np.isfinite(last.residual_norm) and np.isfinite(last.penalty)):
        raise ValidationError(
            f"solver '{solver.name}' reports no residual norm or no penalty: its weight must be a number"
        )
    return CurvePoint(weight, last.residual_norm, last.penalty, converged=last.converged)


def l_curve_corner(weights: Sequence[float], residual_norms: Sequence[float], penalties: Sequence[float]) -> int:
    """Return the index of the L-curve's corner: the largest curvature of the circle through three neighbours.

    The curve is log |A x - b| against half the log of the penalty, so that both axes scale alike; only bends towards
    the origin count. `weights` must rise or fall throughout. Raises `ValidationError` for fewer than three points.
    """
    x, y = _l_curve(weights, residual_norms, penalties)
    x21, y21, x32, y32 = x[1:-1] - x[:-2], y[1:-1] - y[:-2], x[2:] - x[1:-1], y[2:] - y[1:-1]
    sides = np.hypot(x21, y21) * np.hypot(x32, y32) * np.hypot(x21 + x32, y21 + y32)
    turn = 2 * (x21 * y32 - x32 * y21)
    curvature = np.divide(turn, sides, out=np.full_like(sides, -np.inf), where=sides > 0)
    return 1 + int(np.argmax(curvature))


def l_curve_chord(weights: Sequence[float], residual_norms: Sequence[float], penalties: Sequence[float]) -> int:
    """Return the index of the point furthest below the chord between the ends of the L-curve."""
    x, y = _l_curve(weights, residual_norms, penalties)
    below = (x - x[0]) * (y[-1] - y[0]) - (y - y[0]) * (x[-1] - x[0])
    return int(np.argmax(below))


def _l_curve(weights: Sequence[float], residual_norms: Sequence[float], penalties: Sequence[float]) -> np.ndarray:
    """Return log residual and half the log penalty, the bend towards the origin a left turn whatever the order."""
    w, residual, penalty = (np.asarray(values, dtype=float) for values in (weights, residual_norms, penalties))
    if not (w.shape == residual.shape == penalty.shape and w.ndim == 1 and w.size >= 3):
        raise ValidationError(
            f"L-curve: expected three or more points, got {w.shape}, {residual.shape}, {penalty.shape}"
        )
    if not (all(np.diff(w) > 0) or all(np.diff(w) < 0)):
        raise ValidationError("L-curve: the weights must rise or fall throughout")
    tiny = np.finfo(float).tiny
    curve = np.log(np.maximum([residual, penalty], tiny)) * [[1.0], [0.5]]
    return curve if w[0] < w[-1] else curve[::-1]


def _keep_back(problem: Problem) -> tuple[Problem, np.ndarray]:
    """Return the problem without every seventh detector, and which rows those are."""
    count = problem.geometry.detectors.count if problem.geometry else 0
    if problem.geometry is None or count < 2 * HELD_OUT:
        raise ValidationError(
            f"weight: 'hold-out' needs a geometry of {2 * HELD_OUT} or more detectors, got {count or 'none'}; "
            "take 'l-curve' or a number"
        )
    detectors = np.arange(count) % HELD_OUT == HELD_OUT // 2
    rows = np.repeat(detectors, problem.geometry.n_samples)
    fit = replace(
        problem,
        operator=without_rows(problem.operator, ~rows),
        data=np.where(rows, 0, problem.data),
        valid=~detectors if problem.valid is None else problem.valid & ~detectors,
    )
    return fit, rows


def _picks(curve: tuple[CurvePoint, ...]) -> dict[str, float]:
    axes = [[getattr(point, name) for point in curve] for name in ("weight", "residual_norm", "penalty")]
    picks = {"curvature": curve[l_curve_corner(*axes)].weight, "chord": curve[l_curve_chord(*axes)].weight}
    if np.isfinite(curve[0].prediction_error):
        picks["prediction"] = min(curve, key=lambda point: point.prediction_error).weight
    return picks


def _notes(weight: float, curve: tuple[CurvePoint, ...], picks: dict[str, float]) -> Iterator[str]:
    """Yield a sentence for each reason to doubt the choice."""
    if max(picks.values()) > DISAGREEMENT * min(picks.values()):
        said = ", ".join(f"{name} {value:.3g}" for name, value in picks.items())
        yield f"weight {weight:.3g}: the rules disagree ({said}); look at images on both sides of it"
    if weight in (curve[0].weight, curve[-1].weight):
        yield f"weight {weight:.3g} is at the end of the range that was tried; a better one may lie beyond"
    lost = sum(not point.converged for point in curve)
    if lost:
        yield f"weight {weight:.3g}: {lost} of {len(curve)} trial images had not converged"
