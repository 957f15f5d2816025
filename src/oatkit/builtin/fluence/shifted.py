"""Many equations that differ by a multiple of one diagonal, solved with a single factorization."""

from typing import Any

import numpy as np

from oatkit.builtin.fluence.diffusion import factorized

TOLERANCE = 1e-11
"""Largest residual of any of the equations, relative to the right side."""
FIRST, MOST = 8, 80
"""Size of the basis at which residuals are first looked at, and the largest one."""


def shifted(matrix: Any, diagonal: np.ndarray, source: np.ndarray, shifts: np.ndarray, least: float) -> np.ndarray:
    r"""Return the solutions of (A + s D) x = b for all shifts s >= 0, shape ``(shift, unknown)``.

    A is symmetric and positive definite, D a positive diagonal, `least` about the smallest eigenvalue of
    :math:`D^{-1} A`. The solutions are the best, in energy, in the space of

    .. math:: v, \; (A + \sigma D)^{-1} D v, \; ((A + \sigma D)^{-1} D)^2 v, \ldots, \qquad v = (A + \sigma D)^{-1} b,

    one solve for each dimension, which grows until the residual of every equation is at most `TOLERANCE`; should it
    not, each is factorized. The shift of the factorization balances the smallest and the largest one, whose ratio alone
    tells how many dimensions it takes: about 20 for the light of a band, on any grid. See Y. Saad, "Numerical Methods
    for Large Eigenvalue Problems" (SIAM, 2011), ch. 8, on shift-and-invert Lanczos.
    """
    pole = float(np.sqrt(least * (least + shifts.max())) - least)
    solve = factorized(_plus(matrix, pole * diagonal))
    basis, images, vector = np.zeros((0, len(source))), np.zeros((0, len(source))), solve(source)
    size = np.linalg.norm(source)
    while len(basis) < MOST:
        vector = _orthonormal(vector, basis, diagonal)
        basis, images = np.vstack([basis, vector]), np.vstack([images, matrix @ vector])
        if len(basis) >= FIRST and len(basis) % 2 == 0:
            found = _galerkin(basis, images, source, shifts)
            residuals = found @ images + shifts[:, None] * (found @ basis) * diagonal - source
            if np.linalg.norm(residuals, axis=1).max() <= TOLERANCE * size:
                return np.asarray(found @ basis)
        vector = solve(diagonal * vector)
    return np.stack([factorized(_plus(matrix, shift * diagonal))(source) for shift in shifts])


def _plus(matrix: Any, diagonal: np.ndarray) -> Any:
    from scipy.sparse import diags_array

    return (matrix + diags_array(diagonal)).tocsc()


def _orthonormal(vector: np.ndarray, basis: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """Return the part of a vector that the basis lacks, of length one, where lengths are measured by the diagonal."""
    for _ in range(2):  # the second time removes what rounding left
        vector = vector - (basis @ (diagonal * vector)) @ basis
    return np.asarray(vector / np.sqrt(vector @ (diagonal * vector)))


def _galerkin(basis: np.ndarray, images: np.ndarray, source: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Return the coefficients of the solutions in the basis, shape ``(shift, coefficient)``."""
    small, right = basis @ images.T, basis @ source
    values, vectors = np.linalg.eigh((small + small.T) / 2)
    return np.asarray((vectors.T @ right / (values + shifts[:, None])) @ vectors.T)
