"""Inner products of images and signals.

By numpy's own loops, not by its BLAS: that spreads half a million numbers over threads which wait for each other longer
than they add, and the last digits of its sums depend on how many threads there are.
"""

import numpy as np


def inner(a: np.ndarray, b: np.ndarray) -> float:
    """Return the sum of a * b over all elements of two arrays of one shape.

    >>> inner(np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]]))
    11.0
    """
    return float(np.einsum("i,i->", np.ravel(a), np.ravel(b)))


def norm(a: np.ndarray) -> float:
    """Return the Euclidean norm over all elements of an array.

    >>> norm(np.array([[3.0, 4.0]]))
    5.0
    """
    return float(np.sqrt(inner(a, a)))
