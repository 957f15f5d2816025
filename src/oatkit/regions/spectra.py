"""Spectra of regions: the mean of each against the wavelength, with the spread of its pixels."""

from collections.abc import Iterator, Sequence

import numpy as np

from oatkit.drawing.page import Figure
from oatkit.drawing.plot import Curve, Plot
from oatkit.drawing.sheet import sheet
from oatkit.errors import ValidationError
from oatkit.hostile import printable
from oatkit.regions.table import RegionRow, by_image


def spectra(rows: Sequence[RegionRow]) -> Iterator[tuple[str, str, tuple[Curve, ...]]]:
    """Yield name, unit and curves of each image of two wavelengths or more: a curve for each region.

    Wavelengths are sorted; one that was taken twice has two points. A region without values in one image has its colour
    and no curve there. Raises `ValidationError` for rows of several frames.
    """
    if len({row.frame for row in rows}) > 1:
        raise ValidationError("spectra: the rows are of several frames; choose one")
    for image, found in by_image(rows).items():
        if len({row.wavelength_nm for row in found}) > 1:
            regions = dict.fromkeys(row.region for row in found)
            yield image, found[0].unit, tuple(_curve(r, [row for row in found if row.region == r]) for r in regions)


def spectra_figure(rows: Sequence[RegionRow], title: str = "Spectra of the regions") -> Figure:
    """Draw a plot for each of the `spectra`. Raises `ValidationError` as that does, and where there is none."""
    plots = tuple(_plot(image, unit, curves) for image, unit, curves in spectra(rows))
    if not plots:
        raise ValidationError("spectra: no image has two wavelengths or more")
    return sheet((), plots, title, "mean ± standard deviation of the pixels that have a value")


def _plot(image: str, unit: str, curves: tuple[Curve, ...]) -> Plot:
    words = image.replace("_", " ")
    return Plot(words, curves, "wavelength (nm)", f"{words} ({unit})" if unit else words)


def _curve(region: str, rows: Sequence[RegionRow]) -> Curve:
    wavelengths, mean, std = np.array([(row.wavelength_nm, row.mean, row.std) for row in rows], dtype=float).T
    order = np.argsort(wavelengths, kind="stable")
    return Curve(printable(region, 60), wavelengths[order], mean[order], "o-", std[order])
