"""The operator of the arc model: scatter onto fine time axes, filter, crop; and the same backwards."""

from math import ceil

import numpy as np
from scipy import fft

from oatkit.api import Geometry, Grid
from oatkit.builtin.forward import arc_kernels
from oatkit.builtin.forward.filters import Filter, Response
from oatkit.builtin.forward.windows import reached
from oatkit.errors import ValidationError
from oatkit.threads import for_each

BLOCKS, SMALLEST = 16, 2**18
"""Most pieces of work, and the least pairs of pixel and detector in each: handing over smaller ones takes longer than
the work. Both are fixed, so that sums are taken in one order whatever the number of threads."""

TAIL_PIXELS = 16
"""How far the ringing of a band-limited pixel is followed: cutting it there changes the signals of one pixel, of white
noise and of a full square by less than 6e-4 of their norm."""

OVERSAMPLING = 7.0
"""Least rate of the fine time axis over the highest frequency of a pixel. With it the images of the spline's spectrum
cost less than 6e-4 of the pressure of a Gaussian; with 4.2 they cost 8e-3."""

FARTHEST_STEPS = {"float32": 2**17, "float64": 2**40}
"""Distances, in steps of the fine axis, beyond which a number no longer tells the place within a step to 1/128."""


class ArcOperator:
    """A = crop, filter, scatter.

    Pixels are scattered by cubic B-splines onto a time axis fine enough that the images of the spline's spectrum are
    faint in the pixels' band. One filter per record holds the derivative, the pixel's spectrum, the inverse of the
    spline's and the impulse response. Tables hold the four moments of the offsets in each bin instead of four spline
    weights, so that a pixel touches one aligned place.
    """

    def __init__(self, geometry: Geometry, grid: Grid, dtype: str) -> None:
        self.dtype = np.dtype(dtype)
        self.grid_shape, self.record_shape = grid.shape, geometry.shape
        self.shape = (geometry.shape[0] * geometry.shape[1], grid.shape[0] * grid.shape[1])
        step_m = geometry.speed_of_sound_m_s / geometry.sampling_rate_hz
        reach = reached(geometry, grid)
        response = Response.of(geometry.impulse_response).trimmed(
            before=max(0, int(reach.first.max()) + reach.length),
            after=max(0, geometry.n_samples - int(reach.first.min())),
        )
        response = response.padded(ceil(TAIL_PIXELS * grid.pixel_size_m / step_m))
        self.windows = reach.widened(response.before, response.after)
        self.filter = pixel_filter(geometry, grid, response, reach.length, self.dtype)
        self._measure_in_steps_of_the_fine_axis(geometry, grid, reach.first)
        count = len(reach.first)
        pieces = min(BLOCKS, count, max(2, count * self.shape[1] // SMALLEST))
        self.blocks = np.array_split(np.arange(count), pieces)

    def _measure_in_steps_of_the_fine_axis(self, geometry: Geometry, grid: Grid, first: np.ndarray) -> None:
        finer = self.filter.fft_in / self.filter.fft_out
        step_m = geometry.speed_of_sound_m_s / geometry.sampling_rate_hz / finer
        self.y, self.x = grid.y_m / step_m, grid.x_m / step_m
        self.detectors = geometry.detectors.positions_m / step_m
        self.origins = finer * (geometry.start_time_s * geometry.sampling_rate_hz + first)
        nodes = self.origins[:, None] + np.arange(self.filter.n_in)
        if not np.max(nodes) <= FARTHEST_STEPS[self.dtype.name]:
            raise ValidationError(
                f"arc: the farthest pixel is {np.max(nodes):.3g} time steps from a detector, more than the "
                f'{FARTHEST_STEPS[self.dtype.name]} that {self.dtype.name} can resolve; set precision = "double", '
                "or check the sampling rate (the unit is Hz)"
            )
        self.inverse_distance = (1 / (step_m * np.maximum(nodes, 1))).astype(self.dtype)

    def forward(self, image: np.ndarray) -> np.ndarray:
        """Return the raveled record of a raveled image."""
        rows = np.ascontiguousarray(image.reshape(self.grid_shape), dtype=self.dtype)
        columns = np.ascontiguousarray(rows.T)
        record = np.zeros(self.record_shape, self.dtype)

        def work(block: np.ndarray) -> None:
            nodes = np.empty((len(block), self.filter.n_in), self.dtype)
            arc_kernels.scatter(rows, columns, self.y, self.x, self.detectors[block], self.origins[block], nodes)
            nodes *= self.inverse_distance[block]
            self.windows.place(block, self.filter.apply(nodes), record)

        for_each(work, self.blocks)
        return record.ravel()

    def adjoint(self, record: np.ndarray) -> np.ndarray:
        """Return the raveled image of a raveled record."""
        signals = record.reshape(self.record_shape).astype(self.dtype, copy=False)
        images = np.zeros((len(self.blocks), *self.grid_shape), self.dtype)

        def work(index: int) -> None:
            block = self.blocks[index]
            nodes = self.filter.adjoint(self.windows.cut(block, signals)) * self.inverse_distance[block]
            arc_kernels.gather(nodes, self.y, self.x, self.detectors[block], self.origins[block], images[index])

        for_each(work, range(len(self.blocks)))
        return images.sum(axis=0).ravel()


def pixel_filter(geometry: Geometry, grid: Grid, response: Response, n_samples: int, dtype: np.dtype) -> Filter:
    """Return the filter from spline coefficients over `n_samples` to pressure, longer by the `response`."""
    c, rate = geometry.speed_of_sound_m_s, geometry.sampling_rate_hz
    start, stop = pixel_band(geometry, grid)
    n_out = n_samples + response.before + response.after
    fft_out = fft.next_fast_len(n_out, real=True)
    fft_in = fft.next_fast_len(ceil(fft_out * max(1, OVERSAMPLING * stop / rate)), real=True)
    fine_rate = rate * fft_in / fft_out
    frequencies = fft.rfftfreq(fft_out, 1 / rate)
    frequencies = frequencies[frequencies < stop]
    derivative = 2j * np.pi * frequencies / c
    # A pixel scattered with weight 1 is an area of pixel_size^2 in one bin; the FFT back divides by its own length.
    scale = grid.pixel_size_m**2 * fine_rate / c * (fft_out / fft_in)
    spline = np.sinc(frequencies / fine_rate) ** 4
    pixel = cosine_taper(frequencies, start, stop)
    spectrum = scale * derivative * pixel / spline * response.spectrum(fft_out)[: len(frequencies)]
    n_in = ceil(n_samples * fft_in / fft_out)
    return Filter(spectrum.astype(np.result_type(dtype, np.complex64)), fft_in, fft_out, n_in, n_out)


def pixel_band(geometry: Geometry, grid: Grid) -> tuple[float, float]:
    """Return where the spectrum of a pixel begins to fall and where it ends, Hz."""
    per_pixel = geometry.speed_of_sound_m_s / grid.pixel_size_m
    stop = min(0.6 * per_pixel, 0.5 * geometry.sampling_rate_hz)
    return min(0.4 * per_pixel, 0.8 * stop), stop


def cosine_taper(frequencies: np.ndarray, start: float, stop: float) -> np.ndarray:
    """Return 1 below `start`, 0 above `stop`, half a cosine between."""
    progress = np.clip((frequencies - start) / (stop - start), 0, 1)
    return 0.5 * (1 + np.cos(np.pi * progress))
