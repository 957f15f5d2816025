"""The figure of spectra: the mean of each region against the wavelength, with the spread of its pixels."""

from collections.abc import Sequence

import numpy as np

from oatkit.errors import ValidationError
from oatkit.hostile import printable
from oatkit.page import Figure
from oatkit.plot import Curve, Plot
from oatkit.region_table import RegionRow
from oatkit.sheet import sheet


def spectra_figure(rows: Sequence[RegionRow], title: str = "Spectra of the regions") -> Figure:
    """Draw a plot for each image of two wavelengths or more: a curve for each region, from rows of one frame.

    Wavelengths are sorted; one that was taken twice has two points. A region without values in one image has its colour
    and no curve there. Raises `ValidationError` for rows of several frames, and where no image has two wavelengths.
    """
    if len({row.frame for row in rows}) > 1:
        raise ValidationError("spectra: the rows are of several frames; choose one")
    plots = tuple(_plot(image, found) for image, found in _by_image(rows).items() if _is_spectrum(found))
    if not plots:
        raise ValidationError("spectra: no image has two wavelengths or more")
    return sheet((), plots, title, "mean ± standard deviation of the pixels that have a value")


def _by_image(rows: Sequence[RegionRow]) -> dict[str, list[RegionRow]]:
    """Return the rows of each image that has wavelengths."""
    found: dict[str, list[RegionRow]] = {}
    for row in rows:
        if row.wavelength_nm is not None:
            found.setdefault(row.image, []).append(row)
    return found


def _is_spectrum(rows: Sequence[RegionRow]) -> bool:
    return len({row.wavelength_nm for row in rows}) > 1


def _plot(image: str, rows: Sequence[RegionRow]) -> Plot:
    regions = dict.fromkeys(row.region for row in rows)
    unit = f" ({rows[0].unit})" if rows[0].unit else ""
    words = image.replace("_", " ")
    return Plot(
        words,
        tuple(_curve(region, [row for row in rows if row.region == region]) for region in regions),
        x_label="wavelength (nm)",
        y_label=f"{words}{unit}",
    )


def _curve(region: str, rows: Sequence[RegionRow]) -> Curve:
    wavelengths, mean, std = np.array([(row.wavelength_nm, row.mean, row.std) for row in rows], dtype=float).T
    order = np.argsort(wavelengths, kind="stable")
    return Curve(_literal(region), wavelengths[order], mean[order], "o-", std[order])


def _literal(name: str) -> str:
    """Return a name from a file as matplotlib shows it: no formula, and no line that it would keep to itself."""
    return printable(name, 60).replace("$", r"\$").lstrip("_")
