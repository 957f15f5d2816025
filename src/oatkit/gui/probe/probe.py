"""What the visible images show at some places: spectra, values, and what they look like. No Qt."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from oatkit.data import Grid, Image
from oatkit.drawing.plot import Curve, Plot
from oatkit.errors import OatkitError
from oatkit.gui.images.layers import BOUNDARY, KEY, Layers, image_of
from oatkit.gui.probe.chromophore_fit import ChromophoreFit, fit_spectrum
from oatkit.regions import MaskRegion, Region, RegionRow, region_table
from oatkit.regions.spectra import spectra
from oatkit.regions.table import by_image

LIVE = "probe"
"""Name of the place that moves with the mouse; pinned ones have numbers."""
FITTED = ("absorption", "initial_pressure")
"""Quantities in which chromophores add up."""
NOTHING_TO_FIT = "Chromophores are fitted to spectra of absorption or initial pressure; no such spectrum is visible."
COLOURED = "Initial pressure is coloured by the light that reaches a place, and so is what is fitted to it."
LINES = ("o-", "o:", "o-.")
"""Of several images in one plot, in turn; fits are dashed."""


@dataclass(frozen=True)
class Seen:
    """An image that is looked at."""

    key: str
    title: str
    image: Image
    frame: int
    """Counted within its result."""
    scan_frame: int
    time_s: float | None

    @property
    def axis(self) -> tuple[str, str]:
        """What an axis of a plot must be the same in: the unit or, where that says nothing, the quantity."""
        image = self.image
        return (image.unit, "" if image.unit not in ("", "a.u.") else image.quantity)

    @property
    def label(self) -> str:
        """The text of such an axis."""
        quantity = self.image.quantity.replace("_", " ")
        return f"{quantity} ({self.image.unit})" if self.image.unit else quantity


def seen(layers: Layers) -> Iterator[Seen]:
    """Yield the visible images, of many frames the one looked at; the outline of the body is no image here."""
    for layer in list(layers.viewer.layers):
        about = layer.metadata.get(KEY)
        if about is None or not layer.visible or about["image"].quantity == BOUNDARY:
            continue
        image = image_of(layer, layers.frame)
        if isinstance(image, Image):
            yield Seen(about["key"], layer.name, image, *_when(about, layers.frame))


def _when(about: Mapping[str, Any], frame: int) -> tuple[int, int, float | None]:
    """Return the frame of the result, that of the scan, and its time, s."""
    if "result" not in about:
        return 0, 0, None
    result = about["result"]
    if "frames" not in about:
        return 0, result.frame_index, result.time_s
    frame = min(frame, result.frames - 1)
    return (frame, *result.stored.when(frame))


class Probe:
    """Measures places in images; what has not changed since the last time is not measured again."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[Region, list[Image], list[RegionRow]]] = {}

    def rows(self, images: Sequence[Seen], places: Sequence[Region]) -> list[RegionRow]:
        """Return the rows of `oatkit.regions.region_table`, by place, image and wavelength."""
        self._known = {place.name: self._measured(images, place) for place in places}
        return [row for *_, rows in self._known.values() for row in rows]

    def _measured(self, images: Sequence[Seen], place: Region) -> tuple[Region, list[Image], list[RegionRow]]:
        now = [one.image for one in images]
        known = self._known.get(place.name)
        if known is not None and known[0] == place and [*map(id, known[1])] == [*map(id, now)]:
            return known
        return place, now, list(_measure(images, place))


def _measure(images: Sequence[Seen], place: Region) -> Iterator[RegionRow]:
    parts: dict[Grid, tuple[MaskRegion, tuple[slice, slice]]] = {}
    for one in images:
        grid = one.image.grid
        if grid not in parts:
            parts[grid] = _part(place, grid)
        region, window = parts[grid]
        values = one.image.values[:, *window]
        cut = Image(values, one.image.quantity, one.image.unit, region.grid, one.image.wavelengths_nm)
        for row in region_table({one.key: cut}, [region]):
            yield replace(row, frame=one.frame, scan_frame=one.scan_frame, time_s=one.time_s)


def _part(place: Region, grid: Grid) -> tuple[MaskRegion, tuple[slice, slice]]:
    """Return the pixels of a place on a grid that reaches no further than they do, and which part of the grid it is."""
    mask = place.mask(grid)
    rows, columns = np.nonzero(mask)
    window = (_span(rows), _span(columns))
    y, x = grid.y_m[window[0]], grid.x_m[window[1]]
    near = Grid((len(y), len(x)), grid.pixel_size_m, ((y[0] + y[-1]) / 2, (x[0] + x[-1]) / 2))
    return MaskRegion(place.name, mask[window], near), window


def _span(at: np.ndarray) -> slice:
    return slice(int(at.min()), int(at.max()) + 1) if at.size else slice(0, 1)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The mean of one image at one place, against the wavelength."""

    source: Seen
    place: str
    curve: Curve
    fit: ChromophoreFit | None = None
    why: str = ""
    """There is no fit although one is asked for."""


def spectra_of(rows: Sequence[RegionRow], images: Sequence[Seen], chromophores: Sequence[str] = ()) -> list[Spectrum]:
    """Return the spectra of rows, with chromophores fitted to those in which they add up."""
    known = {one.key: one for one in images}
    found = []
    # Images of results may be at different frames, which belong to one moment here.
    for key, _, curves in spectra([replace(row, frame=0) for row in rows]):
        found += [_fitted(Spectrum(known[key], curve.label, curve), chromophores) for curve in curves]
    return found


def _fitted(spectrum: Spectrum, chromophores: Sequence[str]) -> Spectrum:
    image, curve = spectrum.source.image, spectrum.curve
    if not chromophores or image.quantity not in FITTED or not np.isfinite(curve.y).any():
        return spectrum
    try:
        return replace(spectrum, fit=fit_spectrum(curve.x, np.asarray(curve.y), chromophores, image.unit))
    except OatkitError as error:
        return replace(spectrum, why=str(error))


def plots_of(found: Sequence[Spectrum], wavelength_nm: float | None, colours: Mapping[str, int]) -> list[Plot]:
    """Return a plot for each unit, with a line at the wavelength looked at; `colours` are those of the places."""
    lines = () if wavelength_nm is None else ((wavelength_nm, ""),)
    return [_plot(group, lines, colours) for group in _grouped(found)]


def _plot(group: Sequence[Spectrum], lines: tuple[tuple[float, str], ...], colours: Mapping[str, int]) -> Plot:
    """Return the plot of spectra in one unit: places differ in colour, or images, if there is one place only."""
    titles = list(dict.fromkeys(one.source.title for one in group))
    places = {one.place for one in group}
    curves: list[Curve] = []
    for one in group:
        image = titles.index(one.source.title)
        colour = colours[one.place] if len(places) > 1 else image
        words = [one.source.title] * (len(titles) > 1) + [one.place] * (len(places) > 1)
        style = LINES[image % len(LINES)]
        curves.append(replace(one.curve, label=" · ".join(words), style=style, colour=colour))
        if one.fit is not None:
            curves.append(Curve("", one.fit.wavelengths_nm, one.fit.fitted, "--", colour=colour))
    title = titles[0] if len(titles) == 1 else ""
    return Plot(title, tuple(curves), "wavelength (nm)", group[0].source.label, verticals=lines)


def fit_lines(found: Sequence[Spectrum], chromophores: Sequence[str]) -> list[str]:
    """Return what was fitted as lines, or why nothing was."""
    if chromophores and not any(one.source.image.quantity in FITTED for one in found):
        return [NOTHING_TO_FIT]
    several = len({(one.source.key, one.place) for one in found}) > 1
    asked = [one for one in found if one.fit is not None or one.why]
    lines = []
    for one in asked:
        start = f"{one.source.title} · {one.place}: " if several else ""
        lines.append(start + (one.fit.text if one.fit else one.why))
    if any(one.fit and one.source.image.quantity == "initial_pressure" for one in asked):
        lines.append(COLOURED)
    return lines


@dataclass(frozen=True)
class Value:
    """The mean of an image without a spectrum at one place."""

    image: str
    place: str
    text: str


def values_of(rows: Sequence[RegionRow], images: Sequence[Seen]) -> list[Value]:
    """Return the values at each place of images of one wavelength, or none."""
    titles = {one.key: one.title for one in images}
    found = []
    for key, group in by_image(rows).items():
        if len({row.wavelength_nm for row in group}) == 1:
            found += [Value(titles[key], row.region, _text(row)) for row in group]
    return found


def _text(row: RegionRow) -> str:
    if row.mean is None or row.std is None:
        return "no value"
    return f"{row.mean:.4g} ± {row.std:.2g} {row.unit}".rstrip()


def nothing_there(rows: Iterable[RegionRow]) -> str:
    """Return a sentence where the live place has no value in any image."""
    live = [row for row in rows if row.region == LIVE]
    if not live or any(row.mean is not None for row in live):
        return ""
    outside = all(row.pixels == 0 for row in live)
    return "No pixel of a visible image lies there." if outside else "No visible image has a value there."


def _grouped(found: Sequence[Spectrum]) -> list[list[Spectrum]]:
    groups: dict[tuple[str, str], list[Spectrum]] = {}
    for one in found:
        groups.setdefault(one.source.axis, []).append(one)
    return list(groups.values())
