"""Results in an HDF5 file of PATATO: reconstructions, unmixed components, oxygen saturation and more."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.builtin.readers.patato_layout import RESULTS, members, number, numbers, text, texts
from oatkit.builtin.readers.patato_pulses import scan_wavelengths
from oatkit.builtin.readers.stored_images import StoredImages, component_name, refuse
from oatkit.data import Grid, Image
from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import hdf5_dataset, open_hdf5, printable
from oatkit.scanfile import MAX_ARRAY_BYTES

SQUARE_TOLERANCE = 1e-4
FIELD_OF_VIEW = ("RECONSTRUCTION_FIELD_OF_VIEW_Z", "RECONSTRUCTION_FIELD_OF_VIEW_Y", "RECONSTRUCTION_FIELD_OF_VIEW_X")
OLD_FIELD_OF_VIEW = "RECON_FOV"
MAX_COMPONENTS = 64
RECORDED = {"algorithm": "RECONSTRUCTION_ALGORITHM", "preprocessing": "PREPROCESSING_ALGORITHM"}
"""Texts of the file that go into the history of an image."""


@dataclass(frozen=True)
class _Stored:
    """One dataset of images: ``(frame, wavelength or component, z, y, x)`` or less."""

    path: Path
    name: str
    shape: tuple[int, ...]
    component: int | None
    """Which index of the second axis is the image; None where all of them are its wavelengths."""
    quantity: str
    unit: str
    grid: Grid
    wavelengths_nm: tuple[float, ...]
    history: tuple[Mapping[str, Any], ...]

    def image(self, frame: int) -> Image:
        """Return the image of a frame."""
        with open_hdf5(self.path) as file:
            stored = _dataset(file, self.name)
            if stored.shape != self.shape:
                raise ReadError(f"{self.path} '{self.name}': the file has changed since it was looked at")
            values = stored[frame] if stored.ndim > 3 else stored[()]
        planes = values.reshape(-1, *self.grid.shape)
        planes = planes if self.component is None else planes[[self.component]]
        kept = planes if planes.dtype in (np.float32, np.float64) else planes.astype(float)
        return Image(kept, self.quantity, self.unit, self.grid, self.wavelengths_nm, self.history)


def images(file: Any, path: Path) -> dict[str, Sequence[Image]]:
    """Return the images in an open file by the names of their datasets, components by one name more.

    An entry that is no stack of planes on square pixels raises `ReadError` when it is read, saying why.
    """
    return {
        called: entry
        for group in RESULTS
        for name in members(file, group)
        for called, entry in _entries(file, path, name, *RESULTS[group])
    }


def _entries(file: Any, path: Path, name: str, quantity: str, unit: str) -> Iterator[tuple[str, StoredImages]]:
    stored = _dataset(file, name)
    called = printable(name, 200)
    frames = stored.shape[0] if stored.ndim > 3 else 1
    try:
        grid = _grid(stored)
        parts = _parts(file, stored, called, quantity)
    except ValidationError as error:
        yield called, StoredImages(frames, partial(refuse, f"{path} '{called}': {error}"))
        return
    for key, (component, shown, wavelengths) in parts.items():
        entry = _Stored(path, name, stored.shape, component, shown, unit, grid, wavelengths, _history(stored))
        yield key, StoredImages(frames, entry.image)


def _dataset(file: Any, name: str) -> Any:
    return hdf5_dataset(file, name, "biufc", range(33))


def _parts(file: Any, stored: Any, called: str, quantity: str) -> dict[str, tuple[int | None, str, tuple[float, ...]]]:
    """Return what is in a dataset by name: which index of its second axis, its quantity, its wavelengths."""
    if stored.ndim == 3:
        return {called: (0, quantity or "component", ())}
    if called.startswith("recons/"):
        return {called: (None, quantity, _wavelengths(file, stored))}
    if quantity and stored.shape[1] == 1:
        return {called: (0, quantity, ())}
    names = _components(stored)
    return {f"{called}/{name}": (index, quantity or name, ()) for index, name in enumerate(names)}


def _components(stored: Any) -> list[str]:
    """Return a name for each index of the second axis: that of its spectrum where the file tells."""
    count = stored.shape[1]
    if count > MAX_COMPONENTS:
        raise ValidationError(f"{count} components; at most {MAX_COMPONENTS} are told apart")
    names = [component_name(name).replace("/", "_") for name in texts(stored, "SPECTRA")]
    return names if len(names) == len(set(names)) == count and all(names) else [f"component {i}" for i in range(count)]


def _wavelengths(file: Any, stored: Any) -> tuple[float, ...]:
    """Return the wavelengths of a reconstruction: its own, or else those of the scan."""
    own = next((w for key in ("wavelengths", "WAVELENGTHS") if (w := numbers(stored, key)) is not None), None)
    found = scan_wavelengths(file) if own is None or own.size != stored.shape[1] else own
    if found is None or found.size != stored.shape[1]:
        raise ValidationError(f"the wavelengths of the {stored.shape[1]} images in each frame are not known")
    return tuple(found.tolist())


def _history(stored: Any) -> tuple[Mapping[str, Any], ...]:
    speed = number(stored, "speedofsound")
    return (
        {
            "step": "stored",
            "reader": "patato",
            "dataset": printable(stored.name, 200),
            **{key: found for key, name in RECORDED.items() if (found := text(stored, name))},
            **({} if speed is None else {"speedofsound": speed}),
        },
    )


def _grid(stored: Any) -> Grid:
    """Return the grid of a dataset, whose outermost pixels have their centres on the edge of the field of view."""
    if not 3 <= stored.ndim <= 5 or 0 in stored.shape:
        raise ValidationError(f"expected the axes (frame, wavelength, z, y, x), found the shape {stored.shape}")
    if stored.dtype.kind == "c":
        raise ValidationError("expected real numbers, found complex ones")
    if prod(stored.shape[-4:]) * stored.dtype.itemsize > MAX_ARRAY_BYTES:
        raise ValidationError(f"the shape {stored.shape} declares more than {MAX_ARRAY_BYTES} bytes in a frame")
    space = (1, *stored.shape[-2:]) if stored.ndim == 4 else stored.shape[-3:]
    if 1 not in space:
        raise ValidationError(f"a volume of {space} pixels (z, y, x) is no image of a plane")
    rows, columns = (axis for axis in range(3) if axis != space.index(1))
    shape = (space[rows], space[columns])
    spans = (_span(stored, rows), _span(stored, columns))
    pitches = [(end - start) / (n - 1) for n, (start, end) in zip(shape, spans, strict=True) if n > 1]
    if not pitches or not np.ptp(pitches) <= SQUARE_TOLERANCE * max(pitches):
        raise ValidationError(f"expected square pixels, found {' x '.join(f'{1e3 * p:.5g}' for p in pitches)} mm")
    return Grid(shape, pitches[0], (sum(spans[0]) / 2, sum(spans[1]) / 2))


def _span(stored: Any, axis: int) -> tuple[float, float]:
    """Return where the field of view begins and ends along an axis, m; about the origin where only its size is told."""
    names = (FIELD_OF_VIEW[axis], OLD_FIELD_OF_VIEW)
    found = next((values for name in names if (values := numbers(stored, name)) is not None), np.array([]))
    if found.size == 2:
        return float(found[0]), float(found[1])
    if found.size == 1:
        return -float(found[0]) / 2, float(found[0]) / 2
    raise ValidationError(f"expected the field of view in the attribute {names[0]}, found nothing")
