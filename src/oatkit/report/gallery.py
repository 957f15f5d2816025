"""The images of a report: cards with one picture for each wavelength, in groups that share their wavelengths."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.data import Grid, Image
from oatkit.drawing.sheet import scale_of
from oatkit.regions import Region
from oatkit.report.facts import plane_name, spaced, titled
from oatkit.report.pictures import UNITS, Bar, Overlay, bar_of, overlay, plane_src
from oatkit.report.ticks import plain
from oatkit.report.verdict import negative_count, share_words
from oatkit.result import Result
from oatkit.words import FRACTIONS, counts_negatives, plane_words


@dataclass(frozen=True)
class Painting:
    """A plane in the colours of a scale, and what they mean."""

    src: str
    bar: Bar


@dataclass(frozen=True)
class Plane:
    """One plane of an image."""

    name: str
    alt: str
    lines: tuple[str, ...]
    common: Painting
    """In the colours that all planes of the image share."""
    own: Painting | None
    """In colours for this plane alone; None where they are the same."""


@dataclass(frozen=True)
class Card:
    """An image."""

    title: str
    planes: tuple[Plane, ...]
    overlay: Overlay


@dataclass(frozen=True)
class Group:
    """Images whose planes belong to the same wavelengths, or have one plane each."""

    wavelengths: tuple[str, ...]
    """In nm, one for each plane; none where the images have one plane each."""
    cards: tuple[Card, ...]


def groups(result: Result, regions: Sequence[Region]) -> tuple[Group, ...]:
    """Return all images of a result in their order, those of several wavelengths first."""
    overlays = _overlays(result, regions)
    by_wavelengths: dict[tuple[float, ...], list[Card]] = {}
    for name, image in sorted(result.items(), key=lambda item: len(item[1].values) == 1):
        key = image.wavelengths_nm if len(image.values) > 1 else ()
        by_wavelengths.setdefault(key, []).append(_card(name, image, overlays[image.grid]))
    return tuple(Group(tuple(f"{w:g}" for w in key), tuple(cards)) for key, cards in by_wavelengths.items())


def _overlays(result: Result, regions: Sequence[Region]) -> dict[Grid, Overlay]:
    grids = list(dict.fromkeys(image.grid for image in result.values()))
    return {grid: overlay(f"lines-{i}", grid, result.get("boundary"), regions) for i, grid in enumerate(grids)}


def _card(name: str, image: Image, lines: Overlay) -> Card:
    scale = scale_of(image, image.values)
    bar = bar_of(image, scale)
    planes = []
    for i, plane in enumerate(image.values):
        own = None
        if len(image.values) > 1 and image.quantity not in FRACTIONS:
            mine = scale_of(image, plane)
            own = Painting(plane_src(image, i, mine), bar_of(image, mine))
        said = tuple(_lines(image, i))
        where = f" at {plane_name(image, i)}" if image.wavelengths_nm else ""
        alt = f"{spaced(name)}{where}: {'; '.join(said)}"
        planes.append(Plane(plane_name(image, i), alt, said, Painting(plane_src(image, i, scale), bar), own))
    return Card(titled(name), tuple(planes), lines)


def _lines(image: Image, index: int) -> Iterator[str]:
    """Yield what is worth saying of a plane: negative and undefined pixels, and its values."""
    plane = image.values[index]
    defined = plane[np.isfinite(plane)].astype(float)
    if counts_negatives(image):
        count, total = negative_count(image, index)
        plural = "s" if count != 1 else ""
        yield f"{count:,} negative pixel{plural} ({share_words(count, total)})" if count else "no negative pixels"
    if image.quantity in FRACTIONS and (defined > 1).any():
        yield f"{(defined > 1).sum():,} pixels above 1"
    yield from plane_words(image, index)
    if defined.size:
        unit, factor = UNITS.get(image.unit, (image.unit, 1.0))
        low, middle, high = (plain(factor * v, 3) for v in (defined.min(), np.median(defined), defined.max()))
        yield f"{low} to {high} {unit}".rstrip() + f", median {middle}"
    if defined.size < plane.size:
        yield f"undefined in {share_words(plane.size - defined.size, plane.size)} of the picture"
