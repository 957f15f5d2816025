"""A strip across the wall: points on lines that lead inwards, and the path along it that follows the wall."""

from dataclasses import dataclass
from math import ceil

import numpy as np

from oatkit.builtin.segmenters.closed_path import cheapest_closed_path
from oatkit.builtin.segmenters.walls import Walls


@dataclass(frozen=True, eq=False)
class Strip:
    """Straight lines side by side around the body; each leads inwards at equal steps."""

    start_m: np.ndarray
    """Outer ends of the lines, shape ``(along, 2)``, each ``(y, x)``, m."""
    inward: np.ndarray
    """Their directions, unit vectors of the same shape."""
    step_m: float
    n_steps: int
    spacing_m: float
    """Distance of neighbouring lines where the wall is expected, m."""

    def at(self, steps: np.ndarray) -> np.ndarray:
        """Return points at (fractions of) steps of shape ``(along, n)``, shape ``(along, n, 2)``."""
        return self.start_m[:, None] + self.step_m * steps[..., None] * self.inward[:, None]

    def wall(self, walls: Walls, bending: float, max_slope: float, pressure: float = 0.0) -> np.ndarray:
        r"""Return where the wall crosses each line, points of shape ``(along, 2)``, m.

        The path is the cheapest closed one for the evidence e of a wall, as a function of the way s inwards and of the
        length l along the strip, with a slope ds/dl of at most `max_slope`:

        .. math:: \min \int -e(s) + \frac{1}{w}\int_0^{s - w} e\,ds' - \frac{p}{w} s + b\left(\frac{ds}{dl}\right)^2 dl

        Passing over one full edge of width w costs as much as lying on one gains: of two walls the outer wins. The
        pressure p draws the path inwards where there is no wall. Since e levels off at the top of an edge, each point
        is then moved to the steepest point of its own line uphill.
        """
        rise = walls.rise(self.at(np.arange(self.n_steps)[None, :]), self.inward[:, None])
        width = walls.edge_width_m / self.step_m
        cost = _cost(walls.evidence(rise), width) - pressure / width * np.arange(self.n_steps)
        max_step = max(1, round(max_slope * self.spacing_m / self.step_m))
        path = cheapest_closed_path(cost, bending * (self.step_m / self.spacing_m) ** 2, max_step)
        # Further than this the next peak may be another edge, such as that of a vessel below the skin.
        path = _uphill(rise, path, ceil(0.5 * width))
        return self.at((path + _peak_offset(rise, path))[:, None])[:, 0]


def _cost(evidence: np.ndarray, width: float) -> np.ndarray:
    """Return the cost of each point of a strip: minus its evidence, plus what lies further out than an edge's width."""
    delay = min(ceil(width), evidence.shape[1] - 1)
    passed = np.cumsum(np.maximum(2 * evidence - 1, 0.0), axis=1)[:, :-delay] / width
    return np.pad(passed, ((0, 0), (delay, 0))) - evidence


def _uphill(values: np.ndarray, path: np.ndarray, most: int) -> np.ndarray:
    """Return the column of the next peak uphill from each point of a path, at most `most` columns away."""
    row = np.arange(len(path))
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    for _ in range(most):
        here, before, after = (padded[row, path + d] for d in (1, 0, 2))
        path = path + np.array([0, -1, 1])[np.argmax([here, before, after], axis=0)]
    return path


def _peak_offset(values: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Return where, within half a step, the parabola through each path's point and its neighbours has its peak."""
    row = np.arange(len(path))
    at = np.clip(path, 1, values.shape[1] - 2)
    before, here, after = (values[row, at + d] for d in (-1, 0, 1))
    curvature = before - 2 * here + after
    peaked = (curvature < 0) & (at == path)
    offset = 0.5 * (before - after) / np.where(peaked, curvature, -1.0)
    return np.where(peaked & (abs(offset) <= 0.5), offset, 0.0)
