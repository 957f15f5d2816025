"""How `l1` and `tv` descend: by proximal gradients, `tv` first on a stand-in for A^T A as far as that leads."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from oatkit.builtin.solvers.proximal_gradient import Step, judged, proximal_gradient
from oatkit.builtin.solvers.quasi_newton import quasi_newton
from oatkit.builtin.solvers.sparse_objective import SparsePoint
from oatkit.builtin.solvers.stand_in import Model

CHEAP_STEPS = 60
"""Most proximal gradient steps on the stand-in between two products."""

CHEAP_SHARE = 0.1
"""They end where they have become this part of the first one."""

CHEAP_TOLERANCE = 1e-3
"""How finely their proximal points are sought, relative to the image."""


def descent(start: SparsePoint, tolerance: float, on_stand_in: bool) -> Iterator[Step]:
    """Yield steps towards the minimum of P, each after one application of A^T A, without end."""
    step = None
    if on_stand_in:
        for step in _on_stand_in(start, tolerance):
            yield step
    yield from proximal_gradient(step.point if step else start, tolerance, step.dual if step else None)


def _on_stand_in(start: SparsePoint, tolerance: float) -> Iterator[Step]:
    dual: np.ndarray | None = None

    def minimise(model: Model, curvature: float, point: SparsePoint) -> np.ndarray:
        here = replace(point.objective, problem=model, rate=curvature).at(point.image)
        first = None
        for cheap in islice(proximal_gradient(here, CHEAP_TOLERANCE, dual), CHEAP_STEPS):
            first = cheap.move if first is None else first
            if cheap.move <= CHEAP_SHARE * first:
                break
        return cheap.point.image

    for point in quasi_newton(start, minimise):
        step = judged(point, tolerance, dual)
        dual = step.dual
        yield step
