"""The operator of the interpolated model matrix: line integrals of bilinear pixels, differences, impulse response."""

from math import ceil

import numpy as np
from scipy import fft, sparse

from oatkit.api import Geometry, Grid
from oatkit.builtin.forward.filters import Filter, Response
from oatkit.builtin.forward.windows import Windows, reached
from oatkit.threads import for_each


class ImmiOperator:
    """A = crop, filter, difference, matrix.

    The matrix gives I in one window per detector; the difference shortens the window by two samples at both ends.
    """

    def __init__(self, geometry: Geometry, grid: Grid, dtype: str) -> None:
        self.dtype = np.dtype(dtype)
        self.record_shape = geometry.shape
        self.shape = (geometry.shape[0] * geometry.shape[1], grid.shape[0] * grid.shape[1])
        self.step_m = geometry.speed_of_sound_m_s / geometry.sampling_rate_hz
        # A pixel reaches as far as the corners of its bilinear hat, and the difference two samples further.
        extent = ceil(2**0.5 * grid.pixel_size_m / self.step_m) + 2
        raw = reached(geometry, grid).widened(extent, extent)
        self.matrix = model_matrix(geometry, grid, raw, self.dtype)
        response = Response.of(geometry.impulse_response)
        self.windows = raw.widened(response.before - 2, response.after - 2)
        self.filter = None if geometry.impulse_response is None else _filter(response, raw.length - 4, self.dtype)

    def forward(self, image: np.ndarray) -> np.ndarray:
        """Return the raveled record of a raveled image."""
        integrals = (self.matrix @ image.astype(self.dtype, copy=False)).reshape(len(self.windows.first), -1)
        pressure = difference(integrals) / self.step_m
        record = np.zeros(self.record_shape, self.dtype)
        self.windows.place(self._all, self.filter.apply(pressure) if self.filter else pressure, record)
        return record.ravel()

    def adjoint(self, record: np.ndarray) -> np.ndarray:
        """Return the raveled image of a raveled record."""
        signals = record.reshape(self.record_shape).astype(self.dtype, copy=False)
        pressure = self.windows.cut(self._all, signals)
        if self.filter:
            pressure = self.filter.adjoint(pressure)
        # Transposed, a difference is that of the other sign over the zeros around.
        integrals = -difference(np.pad(pressure, ((0, 0), (4, 4)))) / self.step_m
        return self.matrix.T @ integrals.ravel()

    @property
    def nbytes(self) -> int:
        """Memory of the matrix."""
        return self.matrix.data.nbytes + self.matrix.indices.nbytes + self.matrix.indptr.nbytes

    @property
    def _all(self) -> np.ndarray:
        return np.arange(len(self.windows.first))


def difference(values: np.ndarray) -> np.ndarray:
    """Return the central difference of fourth order along the last axis, two samples shorter at both ends."""
    return (8 * (values[:, 3:-1] - values[:, 1:-3]) - (values[:, 4:] - values[:, :-4])) / 12


def _filter(response: Response, n_samples: int, dtype: np.dtype) -> Filter:
    n_out = n_samples + response.before + response.after
    length = fft.next_fast_len(n_out, real=True)
    spectrum = response.spectrum(length).astype(np.result_type(dtype, np.complex64))
    return Filter(spectrum, length, length, n_samples, n_out)


def model_matrix(geometry: Geometry, grid: Grid, windows: Windows, dtype: np.dtype) -> sparse.csr_array:
    """Return the CSR matrix from the raveled image to I, raveled (detector, sample of its window)."""
    parts: dict[int, sparse.csr_array] = {}

    def build(detector: int) -> None:
        parts[detector] = _one_detector(geometry, grid, windows, detector, dtype)

    detectors = range(len(windows.first))
    for_each(build, detectors)
    return sparse.vstack([parts[detector] for detector in detectors], format="csr")


def _one_detector(geometry: Geometry, grid: Grid, windows: Windows, detector: int, dtype: np.dtype) -> sparse.csr_array:
    step_m, h = geometry.speed_of_sound_m_s / geometry.sampling_rate_hz, grid.pixel_size_m
    y, x = geometry.detectors.positions_m[detector]
    along_y, along_x = (v.ravel() for v in np.broadcast_arrays(grid.y_m[:, None] - y, grid.x_m - x))
    distance = np.hypot(along_y, along_x)
    a, b = h * np.abs(along_x) / distance, h * np.abs(along_y) / distance
    origin_m = step_m * (geometry.start_time_s * geometry.sampling_rate_hz + windows.first[detector])
    first = np.ceil((distance - (a + b) - origin_m) / step_m).astype(np.int32)
    candidates = np.arange(ceil(2 * 2**0.5 * h / step_m) + 1, dtype=np.int32)
    values = np.empty((distance.size, candidates.size), dtype)
    for candidate in candidates:
        arc = origin_m + step_m * (first + candidate)
        integral = hat_line_integral(arc - distance, a, b, h)
        values[:, candidate] = np.where(arc > 0, integral, 0) / np.where(arc > 0, arc, 1)
    chosen = values > 0
    ends = np.concatenate(([0], np.cumsum(chosen.sum(axis=1)))).astype(np.int32)
    samples = (first[:, None] + candidates)[chosen]
    return sparse.csc_array((values[chosen], samples, ends), shape=(windows.length, distance.size)).tocsr()


def hat_line_integral(u: np.ndarray, a: np.ndarray, b: np.ndarray, h: float) -> np.ndarray:
    """Return the integral of a bilinear pixel of side `h` along a line at the distance `u` from its centre.

    The normal of the line has the components `a` and `b` along the axes of the grid, times `h`. Convolving two
    triangles gives nine cubic terms; on the side of -abs(u) all but four of them vanish, and nothing cancels.
    """
    u = np.abs(u)
    a, b = np.maximum(a, b), np.minimum(a, b)
    terms = _cubed(a + b - u) - 2 * _cubed(a - u) - 2 * _cubed(b - u) + _cubed(a - b - u)
    # Along a row of pixels the second triangle shrinks to a point.
    oblique = b >= 1e-3 * h
    triangle = h**2 / a * np.maximum(1 - u / a, 0)
    return np.where(oblique, h**2 / (6 * a**2 * np.maximum(b, 1e-3 * h) ** 2) * terms, triangle)


def _cubed(v: np.ndarray) -> np.ndarray:
    v = np.maximum(v, 0)
    return v * v * v
