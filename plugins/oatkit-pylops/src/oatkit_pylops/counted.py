"""The operator of a problem as PyLops takes it."""

from typing import Any

import numpy as np

from oatkit.api import Problem


class Counted:
    """A, divided by a number, for PyLops; it counts how often it is applied."""

    def __init__(self, problem: Problem, divisor: float = 1.0) -> None:
        self._problem, self._divisor = problem, divisor
        self._forwards = self._adjoints = 0

    @property
    def products(self) -> int:
        """Applications of A and A^T so far, counted together."""
        return max(self._forwards, self._adjoints)

    def operator(self) -> Any:
        """Return a PyLops ``LinearOperator``."""
        from pylops import FunctionOperator

        rows, columns = self._problem.operator.shape
        return FunctionOperator(self._forward, self._adjoint, rows, columns, dtype="float64")

    def _forward(self, image: np.ndarray) -> np.ndarray:
        self._forwards += 1
        return self._problem.forward(image) / self._divisor

    def _adjoint(self, data: np.ndarray) -> np.ndarray:
        self._adjoints += 1
        return self._problem.adjoint(data).ravel() / self._divisor
