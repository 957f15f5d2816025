"""The non-linear conjugate gradients of [Prakash2019]_ (Algorithm 1), repaired where the printed form cannot run.

Repaired: the outer test is inverted and compares a vector; log(alpha p / x) must read log(1 + alpha p / x); the new
gradient belongs into Phi_0; the step must keep x positive; the factor 2 of the data term. Kept: directions without a
preconditioner, beta of Hestenes and Stiefel (its numerator written as a product with the difference), and the step as
the root of the slope along the direction.
"""

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from oatkit.builtin.solvers.maxent_objective import EntropyObjective, EntropyPoint
from oatkit.vectors import inner


def conjugate_gradients(objective: EntropyObjective, start: np.ndarray) -> Generator[EntropyPoint, None, EntropyPoint]:
    """Yield points of falling P from z = `start`, one for each application of A^T A, until P falls no more."""
    point = objective.at(start)
    yield point
    direction = -point.gradient
    while True:
        slope = float((direction * point.gradient).sum())
        if slope >= 0:
            return point
        predicted = objective.problem.forward(direction)
        curved = objective.problem.adjoint(predicted)
        step = _step(point, direction, inner(predicted, predicted), slope)
        new = _moved(point, step, direction, predicted, curved)
        yield new
        if not new.value < point.value:
            return point
        change = new.gradient - point.gradient
        beta = max(0.0, float((new.gradient * change).sum() / (direction * change).sum()))
        direction = beta * direction - new.gradient
        if float((direction * new.gradient).sum()) >= 0:
            direction = -new.gradient
        point = new


def _step(point: EntropyPoint, direction: np.ndarray, curvature: float, slope: float) -> float:
    """Return the root of Phi(alpha), the slope of P along the direction; it rises throughout."""
    from scipy.optimize import brentq

    weight = point.objective.weight

    def phi(alpha: float) -> float:
        logs = np.log1p(alpha * direction / point.image)
        return slope + 2 * alpha * curvature + weight * float((direction * logs).sum())

    ratio = float((-direction / point.image).max())
    boundary = (1 - 1e-12) / ratio if ratio > 0 else np.inf
    # The entropy only adds to phi, so the root lies below that of the data part alone.
    highest = min(boundary, -slope / (2 * curvature)) if curvature > 0 else boundary
    return float(brentq(phi, 0, highest, xtol=1e-15 * highest, rtol=1e-12)) if phi(highest) > 0 else highest


def _moved(
    point: EntropyPoint, step: float, direction: np.ndarray, predicted: np.ndarray, curved: np.ndarray
) -> EntropyPoint:
    """Return the point at x + step p; everything but the logarithm is affine, so it costs no further product."""
    return replace(
        point,
        log_ratio=point.log_ratio + np.log1p(step * direction / point.image),
        image=point.image + step * direction,
        misfit=point.misfit + step * predicted,
        slope=point.slope + step * curved,
    )
