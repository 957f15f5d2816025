"""The numbers of regions in the images that are shown: a table that follows the eye, and all of it as a file."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from oatkit.data import Grid, Image
from oatkit.drawing.plot import Plot
from oatkit.errors import ValidationError
from oatkit.gui.images.layers import BOUNDARY, KEY, Layers
from oatkit.gui.images.stored_planes import StoredPlanes
from oatkit.gui.job import Job
from oatkit.hostile import printable
from oatkit.regions import MaskRegion, Region, RegionRow, region_rows, write_csv
from oatkit.regions.spectra import spectra
from oatkit.regions.table import by_image
from oatkit.result import Result

MOST_LETTERS = 60
"""Of a name in a plot, as `spectra` cuts it."""


@dataclass(frozen=True)
class Shown:
    """An image that can be seen."""

    key: str
    image: Image
    """Of the frame that is looked at."""
    result: Result | None
    """That it belongs to."""
    frames: StoredPlanes | None
    """All that it has, if there are several."""
    frame: int
    """That is looked at."""

    @property
    def count(self) -> int:
        """Number of frames."""
        return 1 if self.frames is None else self.frames.shape[0]

    def at(self, frame: int) -> "Shown | None":
        """Return the image at another frame, or None where that has none. Raises `ResultError`."""
        if frame == self.frame:
            return self
        if self.result is not None and frame in self.result.failed:
            return None
        stored: Any = None if self.result is None else self.result.stored
        assert self.frames is not None
        # A result is asked itself: what is damaged is an error in a file that claims to be whole.
        image = stored.image(frame, self.key.rpartition("/")[2]) if stored else self.frames.image(frame)
        return replace(self, frame=frame, image=image) if isinstance(image, Image) else None

    def place(self, row: RegionRow) -> RegionRow:
        """Return a row with the frame that it is of."""
        scan_frame, time_s = (self.frame, None) if self.result is None else self.result.when(self.frame)
        return replace(row, frame=self.frame, scan_frame=scan_frame, time_s=time_s)


def shown_images(layers: Layers) -> list[Shown]:
    """Return the images of all layers that are visible, the lowest first; outlines are none."""
    found = []
    for layer, key, image in layers.shown():
        if layer.visible and image.quantity != BOUNDARY:
            about = layer.metadata[KEY]
            one = Shown(key, image, about.get("result"), about.get("frames"), 0)
            found.append(replace(one, frame=min(layers.frame, one.count - 1)))
    return found


def live_rows(
    shown: Sequence[Shown], regions: Sequence[Region], background: str | None = None
) -> tuple[list[RegionRow], list[str]]:
    """Return the rows of all regions that can be measured in images, at all wavelengths, and sentences on the others.

    Rows come by image, wavelength and region, and equal those of `oatkit.regions.region_table`.
    """
    rows: list[RegionRow] = []
    notes: dict[str, None] = {}
    for one in shown:
        fitting, unfit = fit(regions, one.image.grid)
        notes |= dict.fromkeys(unfit)
        if fitting:
            rows += map(one.place, region_rows({one.key: one.image}, fitting, _known(background, fitting)))
    return rows, list(notes)


def at_plane(rows: Iterable[RegionRow], plane: int) -> list[RegionRow]:
    """Return the rows of one wavelength, by its number; an image of one plane has the same at every wavelength."""
    found: dict[tuple[str, str], list[RegionRow]] = {}
    for row in rows:
        found.setdefault((row.image, row.region), []).append(row)
    return [
        planes[plane if len(planes) > 1 else 0] for planes in found.values() if len(planes) == 1 or plane < len(planes)
    ]


def plots(rows: Sequence[RegionRow], colours: Mapping[str, int | None], wavelength_nm: float | None) -> list[Plot]:
    """Return a plot for each image of two wavelengths or more: the mean of each region, and its spread.

    `colours` are the numbers of the regions' colours, by name; the wavelength that is looked at is a line.
    """
    named = {printable(name, MOST_LETTERS): colour for name, colour in colours.items()}
    here = () if wavelength_nm is None else ((wavelength_nm, ""),)
    return [
        Plot(
            image.replace("_", " "), tuple(replace(curve, colour=named.get(curve.label)) for curve in curves),
            "wavelength (nm)", unit, verticals=here,
        )
        for of_image in by_image(rows).values()
        for image, unit, curves in spectra(of_image)
    ]  # fmt: skip


def fit(regions: Sequence[Region], grid: Grid) -> tuple[list[Region], list[str]]:
    """Return the regions that can be measured on a grid, and why others cannot."""
    fitting, notes = [], []
    for region in regions:
        if isinstance(region, MaskRegion) and region.grid != grid:
            notes.append(f"'{region.name}' belongs to the pixels of another image; move a corner to free it of them.")
        else:
            fitting.append(region)
    return fitting, notes


def write_table(
    shown: Sequence[Shown], regions: Sequence[Region], background: str | None, path: Path, all_frames: bool
) -> Job:
    """Start a job that writes the rows of all wavelengths as CSV, of one frame or of all that did not fail.

    It yields how many of how many frames are done, and the path at its end. A file that stands there is replaced when
    the new one is complete. Raises `ValidationError` where there is nothing to write.
    """
    if not shown or not regions:
        raise ValidationError("no regions in a visible image: draw one, and switch an image on")

    def work(job: Job) -> Iterator[Any]:
        yield (0, 1)
        write_csv(_all_rows(shown, regions, background, all_frames, job), path, overwrite=True)
        yield path

    return Job(work).start()


def _all_rows(
    shown: Sequence[Shown], regions: Sequence[Region], background: str | None, all_frames: bool, job: Job
) -> Iterator[RegionRow]:
    """Yield the rows frame by frame, as `oatkit.regions.region_rows` does of each result."""
    parts = [(images, frame) for images in _alike(shown) for frame in _frames(images[0], all_frames)]
    for done, (images, frame) in enumerate(parts, 1):
        job.check()
        now = [found for one in images if (found := one.at(frame)) is not None]
        yield from live_rows(now, regions, background)[0]
        job.show((done, len(parts)))


def _alike(shown: Sequence[Shown]) -> Iterable[list[Shown]]:
    """Return the images that share their frames together."""
    found: dict[tuple[int, int], list[Shown]] = {}
    for one in shown:
        found.setdefault((id(one.result), one.count), []).append(one)
    return found.values()


def _frames(one: Shown, all_frames: bool) -> Sequence[int]:
    failed = one.result.failed if one.result is not None else {}
    return [index for index in range(one.count) if index not in failed] if all_frames else [one.frame]


def _known(background: str | None, regions: Sequence[Region]) -> str | None:
    """Return the background if it is among the regions that fit."""
    return background if any(region.name == background for region in regions) else None
