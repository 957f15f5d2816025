"""Numbers of regions of interest: one row for each region, image, wavelength and frame, and the table as a CSV file."""

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.atomic import new_file
from oatkit.csv_cell import cell
from oatkit.data import Grid, Image
from oatkit.errors import ValidationError
from oatkit.metrics import cnr
from oatkit.names import did_you_mean
from oatkit.result import Result
from oatkit.shapes import Region

RegionOf = Region | Callable[[Mapping[str, Image]], Region]
"""A region, or what makes one of the images of a frame: ``lambda images: rim(images["boundary"], 1e-3)``."""


@dataclass(frozen=True, slots=True)
class RegionRow:
    """Numbers of one region at one wavelength of one image; one that does not exist is None.

    Pixels without a value are counted and otherwise left out. `mean` to `max` have the row's `unit`.
    """

    frame: int
    """Counted within the result."""
    scan_frame: int
    """Counted within the scan."""
    time_s: float | None
    image: str
    unit: str
    wavelength_nm: float | None
    region: str
    pixels: int
    area_mm2: float
    """Of the pixels whose centres lie in the region."""
    undefined_share: float | None
    """Share of the pixels that have no value (NaN)."""
    mean: float | None
    std: float | None
    """Population standard deviation."""
    median: float | None
    min: float | None
    max: float | None
    negative_share: float | None
    """Share of the pixels with a value at which it is below zero."""
    cnr: float | None
    """Against the background, see `oatkit.metrics.cnr`: infinite over a constant one."""
    note: str


COLUMNS = tuple(entry.name for entry in fields(RegionRow))


def statistics(values: np.ndarray) -> dict[str, Any]:
    """Return the numbers of the values of some pixels, shape ``(n,)``, by the names that they have in `RegionRow`.

    >>> statistics(np.array([-1.0, 2.0, np.nan, 5.0]))["mean"]
    2.0
    """
    known = values[np.isfinite(values)].astype(float)
    found: dict[str, Any] = dict.fromkeys(("mean", "std", "median", "min", "max", "negative_share"))
    if len(known):
        found = {name: float(getattr(np, name)(known)) for name in ("mean", "std", "median", "min", "max")}
        found["negative_share"] = float(np.mean(known < 0))
    undefined = 1 - len(known) / len(values) if len(values) else None
    return {"pixels": len(values), "undefined_share": undefined, **found}


def region_table(
    images: Mapping[str, Image],
    regions: Sequence[RegionOf],
    background: str | None = None,
    frames: Iterable[int] | None = None,
) -> list[RegionRow]:
    """Return a row for each frame, region, image and wavelength.

    `images` is a `Result`, of which all frames that did not fail are read one after another unless `frames` names
    some, or plain images by name. `background` is the name of the region against which the CNR of the others is taken.

    Raises `ValidationError` where two regions have one name, none has the background's, or a mask belongs to another
    grid, and what reading a frame raises.
    """
    return list(region_rows(images, regions, background, frames))


def region_rows(
    images: Mapping[str, Image],
    regions: Sequence[RegionOf],
    background: str | None = None,
    frames: Iterable[int] | None = None,
) -> Iterator[RegionRow]:
    """Yield the rows of `region_table`; one frame is in memory at a time."""
    for index, shown in _frames(images, frames):
        placed = _Placed([region if isinstance(region, Region) else region(shown) for region in regions], background)
        scan_frame, time_s = (shown.frame_index, shown.time_s) if isinstance(shown, Result) else (index, None)
        for name, image in shown.items():
            for plane in range(len(image.values)):
                yield from _rows(image, plane, placed, (index, scan_frame, time_s, name))


def write_csv(rows: Iterable[RegionRow], path: str | Path, overwrite: bool = False) -> None:
    """Write rows as CSV after RFC 4180, in UTF-8; the first line names the columns, what does not exist is empty.

    Texts come from files: one that a spreadsheet would run as a formula gets ``'`` before it. Raises `ResultError`
    where the file exists and `overwrite` is not asked for, or cannot be written.
    """
    with new_file(Path(path), overwrite) as hidden, hidden.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows([cell(getattr(row, name)) for name in COLUMNS] for row in rows)


def by_image(rows: Iterable[RegionRow]) -> dict[str, list[RegionRow]]:
    """Return the rows of each image, by its name."""
    found: dict[str, list[RegionRow]] = {}
    for row in rows:
        found.setdefault(row.image, []).append(row)
    return found


class _Placed:
    """Regions of one frame, and which pixels of a grid they hold."""

    def __init__(self, regions: Sequence[Region], background: str | None) -> None:
        self.regions = {region.name: region for region in regions}
        self._masks: dict[Grid, dict[str, np.ndarray]] = {}
        if len(self.regions) < len(regions):
            names = [region.name for region in regions]
            twice = next(name for name in names if names.count(name) > 1)
            raise ValidationError(f"two regions have the name '{twice}'; rename one of them")
        if background is not None and background not in self.regions:
            raise ValidationError(f"no region named '{background}'{did_you_mean(background, self.regions)}")
        self.background = background

    def masks(self, grid: Grid) -> Mapping[str, np.ndarray]:
        """Return the mask of each region."""
        if grid not in self._masks:
            self._masks[grid] = {name: region.mask(grid) for name, region in self.regions.items()}
        return self._masks[grid]


def _frames(images: Mapping[str, Image], frames: Iterable[int] | None) -> Iterator[tuple[int, Mapping[str, Image]]]:
    if isinstance(images, Result):
        chosen = (i for i in range(images.frames) if i not in images.failed) if frames is None else frames
        yield from ((index, images.frame(index)) for index in chosen)
    else:
        yield 0, images


def _rows(image: Image, index: int, placed: _Placed, head: tuple[int, int, float | None, str]) -> Iterator[RegionRow]:
    """Yield the rows of one plane of an image."""
    plane, masks = image.values[index], placed.masks(image.grid)
    wavelength = image.wavelengths_nm[index] if image.wavelengths_nm else None
    outside = masks[placed.background] if placed.background is not None else None
    for name, mask in masks.items():
        found = statistics(plane[mask])
        area = float(mask.sum() * (1e3 * image.grid.pixel_size_m) ** 2)
        contrast = None if outside is None or name == placed.background else _contrast(plane, mask, outside)
        yield RegionRow(*head, image.unit, wavelength, name, area_mm2=area, cnr=contrast, note=_note(found), **found)


def _contrast(plane: np.ndarray, target: np.ndarray, background: np.ndarray) -> float | None:
    """Return the CNR of what has a value; None where either side has nothing."""
    known = np.isfinite(plane)
    target, background = target & known, background & known
    return cnr(np.where(known, plane, 0), target, background) if target.any() and background.any() else None


def _note(found: Mapping[str, Any]) -> str:
    if found["pixels"] == 0:
        return "no pixel of the image has its centre in the region"
    return "no pixel of the region has a value" if found["mean"] is None else ""
