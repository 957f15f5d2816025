"""The mean of an image over regions, frame by frame, and the kinetics of its change."""

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.csv_cell import cell
from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.hostile import printable
from oatkit.kinetics.course import course_of, image_of, values_of
from oatkit.kinetics.statistics import Moments, Response
from oatkit.result import Result
from oatkit.shapes import Region


@dataclass(frozen=True, eq=False)
class RegionCurve:
    """The mean of an image over a region, frame by frame."""

    region: str
    wavelength_nm: float | None
    """None for an image that belongs to no wavelength."""
    frames: np.ndarray
    """Frames of the result, in the order of time, shape ``(n,)``."""
    times: np.ndarray
    """After the last baseline frame, in `time_unit`, shape ``(n,)``."""
    time_unit: str
    """``"s"``, or ``"frames"`` where times are not known."""
    mean: np.ndarray
    """Over the pixels that are defined, shape ``(n,)``; NaN where none is."""
    pixels: np.ndarray
    """How many these are, shape ``(n,)``."""
    change: np.ndarray
    """The mean minus its mean over the baseline, shape ``(n,)``."""
    kinetics: Mapping[str, float]
    """``peak``, ``time_to_peak``, ``auc`` and ``wash_in`` of the change, as in `oatkit.kinetics.contrast_kinetics`."""


def region_curves(
    result: Result, image: str, baseline: Iterable[int], regions: Sequence[Region]
) -> tuple[RegionCurve, ...]:
    """Return the curve of each region at each wavelength of `image`, with the kinetics of its change.

    Raises as `oatkit.kinetics.contrast_kinetics` does, and `ValidationError` for a region without a pixel.
    """
    course = course_of(result, baseline)
    first = image_of(result.frame(course.baseline[0]), image)
    masks = [_mask(region, first) for region in regions]
    frames, times = zip(*course.all, strict=True)
    means, pixels = (np.stack(x) for x in zip(*_over_regions(result, frames, image, first, masks), strict=True))
    before, response = Moments(means.shape[1:]), Response(means.shape[1:])
    for mean, frame in zip(means, frames, strict=True):
        if frame in course.baseline:
            before.add(mean)
    change = means - before.mean
    for frame, time in course.later:
        response.add(time, change[frames.index(frame)])
    kinetics = response.images()
    return tuple(
        RegionCurve(
            region.name,
            first.wavelengths_nm[w] if first.wavelengths_nm else None,
            np.array(frames),
            np.array(times),
            course.unit,
            means[:, r, w],
            pixels[:, r, w],
            change[:, r, w],
            {name: float(values[r, w]) for name, values in kinetics.items()},
        )
        for r, region in enumerate(regions)
        for w in range(len(first.values))
    )


def curves_csv(curves: Sequence[RegionCurve]) -> str:
    """Return curves as CSV, a row for each region, wavelength and frame; times are after the last baseline frame.

    A name that a spreadsheet would run as a formula gets ``'`` before it.
    """
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    unit = curves[0].time_unit if curves else "s"
    writer.writerow(["region", "wavelength_nm", "frame", f"time_{unit}", "mean", "change", "pixels"])
    for curve in curves:
        wavelength = "" if curve.wavelength_nm is None else f"{curve.wavelength_nm:g}"
        columns = (curve.frames, curve.times, curve.mean, curve.change, curve.pixels)
        for frame, time, mean, change, pixels in zip(*columns, strict=True):
            writer.writerow(
                [cell(curve.region), wavelength, frame, f"{time:.9g}", f"{mean:.9g}", f"{change:.9g}", pixels]
            )
    return file.getvalue()


def curve_text(curve: RegionCurve) -> str:
    """Return the kinetics of one curve as a line."""
    at = "" if curve.wavelength_nm is None else f" at {curve.wavelength_nm:g} nm"
    found, unit = curve.kinetics, curve.time_unit
    unit = "frame" if unit == "frames" and found["time_to_peak"] == 1 else unit
    return (
        f"{printable(curve.region)}{at}: peak {found['peak']:.4g} after {found['time_to_peak']:.4g} {unit}, "
        f"area {found['auc']:.4g}, wash-in {found['wash_in']:.4g}"
    )


def _mask(region: Region, image: Image) -> np.ndarray:
    mask = region.mask(image.grid)
    if not mask.any():
        raise ValidationError(f"region '{region.name}': no pixel of the image lies in it")
    return mask


def _over_regions(
    result: Result, frames: Iterable[int], name: str, first: Image, masks: Sequence[np.ndarray]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield for each frame the mean of what is defined, and how many pixels are: shape ``(region, wavelength)``."""
    for frame in frames:
        values = values_of(result, frame, name, first)
        inside = [values[:, mask] for mask in masks]
        count = np.array([np.isfinite(part).sum(axis=1) for part in inside])
        total = np.array([np.nansum(part, axis=1) for part in inside])
        yield np.where(count > 0, total / np.maximum(count, 1), np.nan), count
