"""The five-point Laplacian."""

import numpy as np


def laplacian(image: np.ndarray) -> np.ndarray:
    """Apply the 5-point Laplacian in pixel units with Neumann edges; it is symmetric, so it is its own adjoint.

    >>> laplacian(np.array([[0.0, 1.0, 0.0]]))
    array([[ 1., -2.,  1.]])
    """
    out = np.zeros_like(image, dtype=float)
    down, across = np.diff(image, axis=0), np.diff(image, axis=1)
    out[:-1] += down
    out[1:] -= down
    out[:, :-1] += across
    out[:, 1:] -= across
    return out
