"""Regions of interest in files: our own TOML, pictures of labels, and whatever an installed reader knows of."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from oatkit.atomic import write_file
from oatkit.data import Grid
from oatkit.errors import ReadError, ValidationError
from oatkit.label_files import LABEL_FILES, PICTURES, read_labels
from oatkit.reading import read_regions
from oatkit.regions.toml_file import regions_of, toml_of
from oatkit.shapes import MaskRegion, Region

MOST_LABELS = 1000
"""Of one picture: more are a photograph, or a mask with soft edges."""


def load_regions(path: str | Path, grid: Grid | None = None) -> tuple[Region, ...]:
    """Return the regions in a file, at least one.

    A ``.toml`` is our own (see `oatkit.regions.toml_file`); a ``.npy``, ``.png``, ``.tif`` or ``.tiff`` holds one
    region for each label above 0, pixel for pixel on `grid`, row 0 at the bottom in ``.npy`` and at the top in the
    others; any other file is handed to the installed readers.

    Raises `ReadError` for a file that is missing, damaged, known to no reader or without any region, and
    `ValidationError`, with all that is wrong, for a TOML file of which something is, and for labels that do not fit
    the grid.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        found = tuple(regions_of(path))
    elif suffix in LABEL_FILES:
        found = tuple(_of_labels(path, grid))
    else:
        found = read_regions(path)
    if not found:
        raise ReadError(f"{path}: there is no region of interest in it")
    return found


def save_regions(regions: Sequence[Region], path: str | Path, overwrite: bool = False) -> None:
    """Write regions to a TOML file; `load_regions` gives back equal ones, to the last bit.

    Raises `ValidationError` for a region of pixels, which has no shape to be written (save its array instead), and
    `ResultError` where the file exists and `overwrite` is not asked for, or cannot be written.
    """
    write_file(Path(path), toml_of(regions).encode(), overwrite)


def _of_labels(path: Path, grid: Grid | None) -> Iterator[Region]:
    """Yield a region for each label above 0, named after the file; numbered where there are several."""
    labels = read_labels(path)
    if grid is None:
        raise ValidationError(f"{path}: labels belong to pixels; say on which grid they lie, load_regions(path, grid)")
    if labels.shape != grid.shape:
        raise ValidationError(
            f"{path}: the labels have {labels.shape[0]} x {labels.shape[1]} pixels, the image has "
            f"{grid.shape[0]} x {grid.shape[1]}; draw them on the image"
        )
    if not (np.isfinite(labels).all() and (labels >= 0).all() and (labels == np.floor(labels)).all()):
        raise ValidationError(f"{path}: labels are whole numbers from 0; found others")
    upright = labels[::-1] if path.suffix.lower() in PICTURES else labels
    known = np.unique(upright[upright > 0])
    if len(known) > MOST_LABELS:
        raise ValidationError(f"{path}: {len(known)} labels; at most {MOST_LABELS} are taken")
    for label in known:
        yield MaskRegion(path.stem if len(known) == 1 else f"{path.stem} {label:g}", upright == label, grid)
