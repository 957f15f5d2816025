"""Universal back-projection: no inversion, and everybody's baseline."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from oatkit.api import Geometry, Grid, Iterate, Problem, Solver, ValidationError, param
from oatkit.vectors import inner, norm


class Backprojection(Solver):
    r"""Sum over detectors of what each measured at the time of flight, interpolated and weighted by solid angle.

    .. math:: x(r) \propto \sum_d \Omega_d(r)
        \left[ 2 p_d(t) - 2 t \frac{\partial p_d}{\partial t} \right]_{t = |r - r_d| / c},
        \qquad \Omega_d = \frac{l_d \cos\theta_d}{|r - r_d|^2}

    divided by the sum of the solid angles [Xu2005]_. The sums run over the valid detectors whose record holds the time
    of flight. The length l of a detector is the mean distance to its two nearest valid neighbours, theta the angle to
    the line towards the middle of the valid array. The formula is exact for detectors on a closed surface around the
    body; in a plane it sharpens edges and loses what is smooth. So its scale is not given by theory here: the image is
    multiplied by the one number for which it predicts the data best. The image is signed.

    References:
        [Xu2005] Xu and Wang, Phys. Rev. E 71, 016706 (2005), 10.1103/PhysRevE.71.016706.
    """

    name: ClassVar[str] = "backprojection"
    block: int = param(32, "detectors summed between two reports of progress", at_least=1)

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield the sum so far after each block of detectors, and at last the scaled image."""
        geometry, grid = problem.geometry, problem.grid
        if geometry is None or grid is None:
            raise ValidationError(
                "backprojection: the problem must hold its geometry and its grid; oatkit.run sees to it"
            )
        valid = slice(None) if problem.valid is None else problem.valid
        terms = _terms(geometry, problem.data.reshape(geometry.shape))[valid]
        positions_m = geometry.detectors.positions_m[valid]
        lengths, normals = _elements(positions_m)
        total, weights = np.zeros(grid.shape), np.zeros(grid.shape)
        for d, position_m in enumerate(positions_m):
            value, weight = _one_detector(geometry, grid, position_m, terms[d], normals[d])
            total += lengths[d] * weight * value
            weights += lengths[d] * weight
            if (d + 1) % self.block == 0:
                yield Iterate(_mean(total, weights), d + 1)
        yield _scaled(problem, _mean(total, weights), len(positions_m))


def _terms(geometry: Geometry, signals: np.ndarray) -> np.ndarray:
    """Return 2 p - 2 t dp/dt for each sample."""
    if geometry.n_samples < 2:
        raise ValidationError("backprojection: a record needs two samples or more")
    slope = np.gradient(signals, axis=1) * geometry.sampling_rate_hz
    return 2 * signals - 2 * geometry.times_s * slope


def _mean(total: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return a weighted sum over its weights; 0 where no detector sees a pixel."""
    return total / np.where(weights > 0, weights, 1)


def _elements(positions_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the length of each detector, m, and the unit vector from it to the middle of the array."""
    if not len(positions_m):
        return np.zeros(0), np.zeros((0, 2))
    inwards = positions_m.mean(axis=0) - positions_m
    size = np.linalg.norm(inwards, axis=1, keepdims=True)
    normals = np.divide(inwards, size, out=np.zeros_like(inwards), where=size > 0)
    distances = np.linalg.norm(positions_m[:, None] - positions_m[None], axis=2)
    nearest = np.sort(distances, axis=1)[:, 1:3]
    lengths = nearest.mean(axis=1) if nearest.size else np.ones(len(positions_m))
    return np.where(lengths > 0, lengths, np.max(lengths) or 1.0), normals


def _one_detector(
    geometry: Geometry, grid: Grid, position_m: np.ndarray, term: np.ndarray, normal: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what one detector says of each pixel, and its solid angle there for a length of 1; 0 beyond its record."""
    y, x = position_m
    along_y, along_x = grid.y_m[:, None] - y, grid.x_m[None, :] - x
    distance = np.hypot(along_y, along_x)
    sample = (distance / geometry.speed_of_sound_m_s - geometry.start_time_s) * geometry.sampling_rate_hz
    last = geometry.n_samples - 1
    value = np.interp(sample, np.arange(last + 1), term)
    cosine = (along_y * normal[0] + along_x * normal[1]) / distance
    # A detector without a direction, the only one or one in the very middle, sees all around.
    cosine = np.maximum(cosine, 0) if normal.any() else np.ones_like(cosine)
    return value, np.where((sample >= 0) & (sample <= last), cosine / distance**2, 0)


def _scaled(problem: Problem, image: np.ndarray, summed: int) -> Iterate:
    """Return the end: the image times the number for which it predicts the data best."""
    predicted = problem.forward(image)
    energy = inner(predicted, predicted)
    scale = inner(predicted, problem.data) / energy if energy > 0 else 0.0
    residual = norm(scale * predicted - problem.data)
    return Iterate(
        scale * image,
        summed,
        objective=residual**2,
        residual_norm=residual,
        products=1,
        converged=True,
        reason="all valid detectors summed" if energy > 0 else "the data are zero, or no detector sees the grid",
        details={"scale": scale},
    )
