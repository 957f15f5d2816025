"""Statistics of arrays that come one after another, each element by itself; values that are NaN do not count."""

from collections.abc import Mapping

import numpy as np


class Moments:
    """Count, mean and variance [Welford1962]_ of each element.

    .. [Welford1962] B. P. Welford, "Note on a method for calculating corrected sums of squares and products",
       Technometrics 4, 419 (1962)
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.count = np.zeros(shape, int)
        self._mean = np.zeros(shape)
        self._squares = np.zeros(shape)

    def add(self, values: np.ndarray) -> None:
        """Count `values`, of the shape of all the others."""
        defined = np.isfinite(values)
        self.count += defined
        before = np.where(defined, values - self._mean, 0.0)
        self._mean += before / np.maximum(self.count, 1)
        self._squares += before * np.where(defined, values - self._mean, 0.0)

    @property
    def mean(self) -> np.ndarray:
        """Mean of what was defined, NaN where nothing was."""
        return np.where(self.count > 0, self._mean, np.nan)

    @property
    def variance_of_mean(self) -> np.ndarray:
        """Unbiased variance of the mean of independent values; NaN where less than two were defined."""
        n = self.count
        return np.where(n > 1, self._squares / np.maximum(n * (n - 1), 1), np.nan)


class Response:
    r"""What follows an event at time 0, at which the change is 0: d(t), in the order of time.

    - ``peak``: the largest d.
    - ``time_to_peak``: when it is first reached.
    - ``auc``: the area under the curve from 0 to the last defined value, by the trapezoidal rule, so that gaps are
      bridged by straight lines.
    - ``wash_in``: the slope of the straight line of least squares through (0, 0) and all values up to the peak,

      .. math:: \frac{n \sum t d - \sum t \sum d}{n \sum t^2 - (\sum t)^2}

    All are NaN for an element that is nowhere defined.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._last_time, self._last = np.zeros(shape), np.zeros(shape)
        self._peak, self._time_to_peak = np.full(shape, -np.inf), np.zeros(shape)
        self._auc, self._slope = np.zeros(shape), np.zeros(shape)
        # n, sum of t, of t^2, of d and of t d; the event itself is the first point.
        self._sums = np.zeros((5, *shape))
        self._sums[0] = 1

    def add(self, time: float, change: np.ndarray) -> None:
        """Count the change at a time after all that were counted before."""
        defined = np.isfinite(change)
        d = np.where(defined, change, 0.0)
        self._auc += np.where(defined, (d + self._last) / 2 * (time - self._last_time), 0.0)
        self._last[defined], self._last_time[defined] = d[defined], time
        self._sums += defined * np.stack([np.broadcast_to(x, d.shape) for x in (1.0, time, time**2, d, time * d)])
        higher = defined & (d > self._peak)
        self._peak[higher], self._time_to_peak[higher] = d[higher], time
        self._slope[higher] = self._line()[higher]

    def images(self) -> Mapping[str, np.ndarray]:
        """Return the four by name."""
        known = np.isfinite(self._peak)
        found = {"peak": self._peak, "time_to_peak": self._time_to_peak, "auc": self._auc, "wash_in": self._slope}
        return {name: np.where(known, values, np.nan) for name, values in found.items()}

    def _line(self) -> np.ndarray:
        n, t, tt, d, td = self._sums
        below = n * tt - t**2
        return np.divide(n * td - t * d, below, out=np.full_like(below, np.nan), where=below > 0)
