"""Channels that are not to be trusted, taken out of data and operator alike."""

from typing import Any

import numpy as np


class MaskedOperator:
    """An operator whose rows are zero where `rows` is False: it neither predicts nor uses those data."""

    def __init__(self, operator: Any, rows: np.ndarray) -> None:
        self.operator = operator
        self.rows = rows
        self.shape = operator.shape
        self.dtype = getattr(operator, "dtype", np.dtype(float))

    def matvec(self, image: np.ndarray) -> np.ndarray:
        """Return the predicted data of the rows that count, zero in the others."""
        return np.where(self.rows, np.ravel(self.operator.matvec(image)), 0)

    def rmatvec(self, data: np.ndarray) -> np.ndarray:
        """Return the adjoint applied to the data of the rows that count."""
        return self.operator.rmatvec(np.where(self.rows, np.ravel(data), 0))


def without_rows(operator: Any, rows: np.ndarray) -> Any:
    """Return `operator` with only those `rows` (a boolean array, raveled) in use; itself where all are."""
    return operator if rows.all() else MaskedOperator(operator, rows)
