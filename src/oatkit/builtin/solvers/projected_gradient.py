"""Accelerated projected gradients, restarted where they stop descending."""

from collections.abc import Iterator

import numpy as np

from oatkit.builtin.solvers.quadratic_objective import QuadraticPoint
from oatkit.vectors import inner


def projected_gradient(start: QuadraticPoint) -> Iterator[QuadraticPoint]:
    """Yield the points of FISTA [Beck2009]_ towards the least objective over x >= 0, without end.

    Momentum is dropped where it points uphill [ODonoghue2015]_. One application of A^T A in a step: A^T A x of the
    extrapolated point is extrapolated with it.
    """
    previous = point = start
    momentum, rate = 1.0, start.objective.rate
    while True:
        following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        beta = (momentum - 1) / following
        ahead = point.image + beta * (point.image - previous.image)
        gradient = point.gradient + beta * (point.gradient - previous.gradient)
        new = start.objective.at(np.maximum(ahead - gradient / rate, 0))
        uphill = inner(ahead - new.image, new.image - point.image) > 0
        previous, point, momentum = point, new, 1.0 if uphill else following
        yield point
