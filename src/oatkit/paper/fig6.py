"""Fig. 6: absorption by thresholded least squares and by maximum entropy, in space and in the Fourier domain."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from oatkit.data import Image
from oatkit.drawing.plot import Curve, Plot
from oatkit.drawing.sheet import Panel, sheet
from oatkit.metrics import sharpness
from oatkit.paper.chain import Mouse
from oatkit.paper.outcome import Beside, Outcome
from oatkit.paper.setting import Setting
from oatkit.result import Result

PRESETS = {"L2, thresholded": "lsqr-threshold-absorption", "MaxEnt": "maxent-absorption"}
LOW_PER_MM = 0.5
"""Frequencies below it count as low: structures above 2 mm."""

SETTING = Setting(field_of_view_mm=25.0)


def fig6(setting: Setting = SETTING) -> Iterator[str | Outcome]:
    """Yield lines on the progress, at last the outcome."""
    mouse = Mouse(setting)
    yield mouse.words()
    results = {}
    for name, preset in PRESETS.items():
        results[name] = mouse.corrected(preset)
        yield f"{name}: {100 * low_share(scaled(results[name])):.1f} % of the amplitude below {LOW_PER_MM:g} / mm"
    title = "Fig. 6: absorption in space and in the Fourier domain"
    spatial = [Panel(name, result["absorption"]) for name, result in results.items()]
    spectra = [
        Panel(f"{name}, Fourier magnitude", magnitude(scaled(result)), in_space=False)
        for name, result in results.items()
    ]
    plots = [_profile(results), _radial(results)]
    figure = sheet([spatial, spectra], plots, title, f"{mouse.words()} · Fourier magnitudes as log(1 + |F|)")
    yield Outcome("fig6", title, figure, tuple(_beside(results)), _table(results))


def scaled(result: Result) -> Image:
    """Return absorption over its maximum, 0 where it is not defined, as the paper shows it."""
    values = np.nan_to_num(result["absorption"].values)
    return replace(result["absorption"], values=values / values.max())


def magnitude(image: Image) -> Image:
    """Return log(1 + |F|) of a plane, zero frequency in the middle."""
    values = np.log1p(abs(np.fft.fftshift(np.fft.fft2(image.values[0]))))
    return replace(image, values=values, quantity="Fourier_magnitude", unit="", wavelengths_nm=())


def frequency_per_mm(image: Image) -> np.ndarray:
    """Return the length of the wave vector of each element of `numpy.fft.fft2`, cycles in a millimetre."""
    y, x = (np.fft.fftfreq(n, 1e3 * image.grid.pixel_size_m) for n in image.grid.shape)
    return np.hypot(y[:, None], x)


def low_share(image: Image) -> float:
    """Return the sum of |F| below `LOW_PER_MM`, without the zero frequency, over the whole."""
    amplitude, frequency = abs(np.fft.fft2(image.values[0])), frequency_per_mm(image)
    return float(amplitude[(frequency > 0) & (frequency < LOW_PER_MM)].sum() / amplitude[frequency > 0].sum())


def _radial(results: dict[str, Result]) -> Plot:
    curves = []
    for name, result in results.items():
        image = scaled(result)
        frequency = frequency_per_mm(image)
        edges = np.linspace(0, 0.5e-3 / image.grid.pixel_size_m, 40)
        bins, amplitude = np.digitize(frequency.ravel(), edges), abs(np.fft.fft2(image.values[0])).ravel()
        means = [amplitude[bins == i].mean() for i in range(1, len(edges))]
        curves.append(Curve(name, (edges[1:] + edges[:-1]) / 2, means))
    return Plot("mean Fourier magnitude by frequency", tuple(curves), "cycles per mm", "|F|", "y")


def _profile(results: dict[str, Result]) -> Plot:
    curves = []
    for name, result in results.items():
        image = scaled(result)
        curves.append(Curve(name, 1e3 * image.grid.x_m, image.values[0, image.grid.shape[0] // 2]))
    return Plot("along the middle row", tuple(curves), "x, mm", "absorption, relative to its maximum")


def _table(results: dict[str, Result]) -> tuple[Sequence[str], ...]:
    heading = ("method", f"amplitude below {LOW_PER_MM:g} / mm", "sharpness")
    rows = [
        (name, f"{low_share(scaled(r)):.3f}", f"{sharpness(scaled(r).values[0]):.4f}") for name, r in results.items()
    ]
    return (heading, *rows)


def _beside(results: dict[str, Result]) -> Iterator[Beside]:
    threshold, maxent = (low_share(scaled(result)) for result in results.values())
    yield Beside(
        "low frequencies, MaxEnt over thresholded L2",
        "more (shown, no number)",
        f"{maxent / threshold:.2f}",
        "it depends on the prior and on where least squares was stopped: run to the end it keeps low frequencies",
    )
