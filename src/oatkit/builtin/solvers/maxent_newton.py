"""Newton's method for maximum entropy.

Three things make it quick from a cold start at weak weights, where plain Newton in x or in log x crawls:

- It steps in the coordinate v = x + t log(x / m), t = w / (2 |A|^2), of which x is the proximal map. There v is x where
  a pixel is bright and the data rule, and t log x where it is dark and the entropy rules, so that a pixel can be put
  out or lit in one step.
- After each Newton step come accelerated proximal gradient steps, which light the pixels that were put out wrongly.
- The weight falls from a strong one to the one that is asked for; at weak weights Newton steps are left early, and more
  of the others follow, since conjugate gradients slow down there more than they do.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from oatkit.builtin.regularizers.entropy import log_prox
from oatkit.builtin.solvers.maxent_objective import EntropyObjective, EntropyPoint

FIRST_TAU = 2e-3
"""Where the dimensionless weight starts if it is asked to be weaker."""

DECAY = 0.5
"""How much it falls with each Newton step."""

FIRST_STEPS = 10
"""Accelerated steps before the first Newton step."""


@dataclass(frozen=True)
class Pace:
    """How far the parts of a step go."""

    inner: int
    """Largest number of conjugate gradient steps in a Newton step."""
    between: int
    """Accelerated steps after each Newton step; ten at least where it found no descent."""


STRONG, WEAK = Pace(inner=60, between=2), Pace(inner=20, between=6)

Steps = Generator[EntropyPoint, None, EntropyPoint]
"""Yields the newest point after every application of A^T A, and returns the last one."""


def newton(objective: EntropyObjective, start: np.ndarray, near: bool = False) -> Steps:
    """Yield points from z = `start` towards the optimum, without end.

    A start that is `near` is the optimum of a neighbour, from where the weight need not fall.
    """
    problem, target = objective.problem, objective.weight
    strong = max(target, FIRST_TAU * problem.norm**2 * problem.reference.level)
    pace = WEAK if strong > target else STRONG
    weight = target if near else strong
    point = objective.at(start)
    yield point
    point = yield from _accelerated(_reweighted(point, weight), FIRST_STEPS)
    curvature = _mean_curvature(objective)
    first = _size(point)
    while True:
        forcing = min(0.5, np.sqrt(_size(point) / first)) if first else 0.5
        point = yield from _newton_step(point, forcing, curvature, pace)
        if weight > target:
            weight = max(target, DECAY * weight)
            point = _reweighted(point, weight)
            first = _size(point)


def _newton_step(point: EntropyPoint, forcing: float, curvature: float, pace: Pace) -> Steps:
    """Take a Newton step as far as P falls, then accelerated ones."""
    change = yield from _direction(point, forcing, curvature, pace.inner)
    new = yield from _line_search(point, change)
    if new is None:
        return (yield from _accelerated(point, max(10, pace.between)))
    return (yield from _accelerated(new, pace.between))


def _accelerated(point: EntropyPoint, steps: int) -> Steps:
    """Take proximal gradient steps with momentum [Beck2009]_, which is dropped where P rises."""
    previous, momentum = point, 1.0
    for _ in range(steps):
        following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        beta = (momentum - 1) / following
        new = point.objective.advance(
            point.image + beta * (point.image - previous.image), point.slope + beta * (point.slope - previous.slope)
        )
        yield new
        rises = new.value > point.value
        previous, point, momentum = (new, new, 1.0) if rises else (point, new, following)
    return point


def _direction(
    point: EntropyPoint, forcing: float, curvature: float, most_steps: int
) -> Generator[EntropyPoint, None, np.ndarray]:
    """Return the change of z that solves (w + 2 A^T A X) dz = -gradient, to a relative accuracy `forcing`.

    By conjugate gradients in the inner product <u, X v>, X = diag(x), in which that matrix is symmetric: nothing is
    divided by a pixel, however small. Preconditioned by w + 2 x times the mean `curvature` of A^T A.
    """
    objective, image, weight = point.objective, point.image, point.objective.weight
    change = np.zeros_like(image)
    residual = -point.gradient
    metric = image / (weight + 2 * curvature * image)
    energy = first = float((metric * residual**2).sum())
    direction = residual / (weight + 2 * curvature * image)
    for _ in range(most_steps):
        if energy <= forcing**2 * first:
            break
        curved = weight * direction + 2 * objective.hessian(image * direction)
        yield point
        step = energy / float((image * direction * curved).sum())
        change = change + step * direction
        residual = residual - step * curved
        previous, energy = energy, float((metric * residual**2).sum())
        direction = residual / (weight + 2 * curvature * image) + (energy / previous) * direction
    return change


def _line_search(point: EntropyPoint, change: np.ndarray) -> Generator[EntropyPoint, None, EntropyPoint | None]:
    """Return a point along the Newton direction where P has fallen enough (Armijo), or None.

    The direction is taken in v = x + t z; see the top of this module.
    """
    objective = point.objective
    t = objective.weight / (2 * objective.rate)
    start, direction = point.image + t * point.log_ratio, (point.image + t) * change
    slope = float((point.gradient * point.image * change).sum())
    for step in (1.0, 0.25, 0.0625, 0.015625):
        new = objective.at(log_prox(start + step * direction, t, objective.prior))
        if new.value <= point.value + 1e-4 * step * slope:
            yield new
            return new
        yield point
    return None


def _size(point: EntropyPoint) -> float:
    """How far from the optimum, in the norm that counts dark pixels for little."""
    return float(np.sqrt((point.image * point.gradient**2).sum()))


def _mean_curvature(objective: EntropyObjective) -> float:
    """Estimate the mean of the diagonal of A^T A by one seeded probe of random signs [Hutchinson1990]_."""
    probe = np.random.default_rng(0).choice([-1.0, 1.0], objective.problem.shape)
    return float((objective.problem.forward(probe) ** 2).sum()) / probe.size


def _reweighted(point: EntropyPoint, weight: float) -> EntropyPoint:
    """Return the same image as a point of the problem with another weight."""
    return replace(point, objective=replace(point.objective, weight=weight))
