"""The visible images along a line: as plots, as a table, with the width of their highest peak. No Qt."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.csv_cell import cell
from oatkit.drawing.plot import Curve, Plot
from oatkit.gui.probe.probe import Seen
from oatkit.regions.profile import STEPS_PER_PIXEL, Peak, Point, highest_peak, line_profile


@dataclass(frozen=True, eq=False)
class Trace:
    """One image along a line."""

    source: Seen
    wavelength_nm: float | None
    distance_m: np.ndarray
    values: np.ndarray
    """NaN where the image has no value, shape ``(n,)``."""

    @property
    def peak(self) -> Peak | None:
        """The highest peak, if it falls to its half on both sides."""
        return highest_peak(self.distance_m, self.values)


def traces(images: Sequence[Seen], line_m: tuple[Point, Point], plane: int) -> list[Trace]:
    """Return the images along a line at the wavelength looked at, all at the same points.

    They are half a pixel apart, of the image with the smallest pixels. An image that has no such wavelength is left
    out, one of a single plane is there at every wavelength. Raises `ValidationError` for a line of no length.
    """
    here = [(one, plane if len(one.image.values) > 1 else 0) for one in images]
    here = [(one, index) for one, index in here if index < len(one.image.values)]
    step = min((one.image.grid.pixel_size_m for one, _ in here), default=0.0) / STEPS_PER_PIXEL
    found = []
    for one, index in here:
        profile = line_profile(one.image, *line_m, step)
        wavelengths = one.image.wavelengths_nm
        found.append(Trace(one, wavelengths[index] if wavelengths else None, profile.distance_m, profile.values[index]))
    return found


def profile_plots(found: Sequence[Trace]) -> list[Plot]:
    """Return a plot for each unit, with a curve for each image."""
    groups: dict[tuple[str, str], list[Trace]] = {}
    for trace in found:
        groups.setdefault(trace.source.axis, []).append(trace)
    return [_plot(group) for group in groups.values()]


def peak_lines(found: Sequence[Trace]) -> list[str]:
    """Return the full width at half maximum of the highest peak of each trace that has one, as lines."""
    peaks = [(trace.source.title, trace.peak) for trace in found]
    return [
        f"{title}: FWHM {1e3 * peak.width_m:.3g} mm, peak {peak.height:.4g} at {1e3 * peak.at_m:.3g} mm"
        for title, peak in peaks
        if peak is not None
    ]


def profile_csv(found: Sequence[Trace]) -> str:
    """Return traces as CSV: the distance in mm, and a column for each image; what has no value is empty."""
    file = io.StringIO()
    writer = csv.writer(file)
    writer.writerow(["distance_mm", *(cell(_heading(trace)) for trace in found)])
    if found:
        columns = [1e3 * found[0].distance_m, *(trace.values for trace in found)]
        for row in zip(*columns, strict=True):
            writer.writerow([float(value) if np.isfinite(value) else "" for value in row])
    return file.getvalue()


def _plot(group: Sequence[Trace]) -> Plot:
    several = len(group) > 1
    curves = tuple(Curve(t.source.title if several else "", 1e3 * t.distance_m, t.values) for t in group)
    at = dict.fromkeys(f"{t.wavelength_nm:g} nm" for t in group if t.wavelength_nm is not None)
    title = ", ".join(filter(None, ["" if several else group[0].source.title, *at]))
    return Plot(title, curves, "distance (mm)", group[0].source.label)


def _heading(trace: Trace) -> str:
    image = trace.source.image
    at = [] if trace.wavelength_nm is None else [f"{trace.wavelength_nm:g} nm"]
    return " ".join([trace.source.key, *at, *([f"({image.unit})"] if image.unit else [])])
