"""Scans in the HDF5 file of the photoacoustic standardisation consortium (IPASC)."""

from pathlib import Path
from typing import Any, ClassVar

from oatkit.api import Reader, ReadError, Region, Scan, ValidationError, param
from oatkit.builtin.readers.hdf5_signals import Hdf5Signals, hdf5_signals
from oatkit.builtin.readers.ipasc_acquisition import (
    WAVELENGTHS,
    oddities,
    read_geometry,
    stored_notes,
    valid,
    wavelengths_nm,
)
from oatkit.builtin.readers.ipasc_axes import find_axes
from oatkit.builtin.readers.ipasc_detectors import MAX_MEMBERS, read_detectors
from oatkit.builtin.readers.ipasc_fields import Fields
from oatkit.builtin.readers.ipasc_pulses import read_pulses
from oatkit.builtin.readers.ipasc_regions import read_regions
from oatkit.hostile import hdf5_dataset, hdf5_group, open_hdf5
from oatkit.ipasc import ACQUISITION, DEVICE, SIGNALS, is_ipasc_file


class Ipasc(Reader):
    """Reads an IPASC file, by whatever program it was written; signals stay in the file.

    Axes in the order of the layout or of MATLAB; detectors in the natural order of their names, in a plane of constant
    x, y or z, whose later axis points up. What the file leaves open is assumed, and noted in the scan.
    """

    name: ClassVar[str] = "ipasc"
    wavelength: float = param(
        800.0, "wavelength of a file that does not name its only one", unit="nm", at_least=100, at_most=20_000
    )

    def can_read(self, path: Path) -> bool:
        """Claim an HDF5 file with the three roots of the layout."""
        return is_ipasc_file(path)

    def read(self, path: Path) -> Scan:
        """Return the scan. Raises `ReadError`."""
        with open_hdf5(path) as file:
            try:
                return self._scan(file, path)
            except ValidationError as error:
                raise ReadError(f"{path}: {error}") from None

    def regions(self, path: Path) -> tuple[Region, ...]:
        """Return the regions of interest in the file. Raises `ReadError`."""
        with open_hdf5(path) as file:
            detectors, across, _ = read_detectors(hdf5_group(file, DEVICE, MAX_MEMBERS))
            fields = Fields(hdf5_group(file, ACQUISITION, MAX_MEMBERS))
            wavelengths, _ = wavelengths_nm(fields, self.wavelength)
            _, fields = _signals(file, path, fields, detectors.count, len(wavelengths))
            return read_regions(fields, across)

    def _scan(self, file: Any, path: Path) -> Scan:
        device = hdf5_group(file, DEVICE, MAX_MEMBERS)
        group = hdf5_group(file, ACQUISITION, MAX_MEMBERS)
        detectors, across, where = read_detectors(device)
        wavelengths, which = wavelengths_nm(Fields(group), self.wavelength)
        signals, fields = _signals(file, path, Fields(group), detectors.count, len(wavelengths))
        geometry, speed_source, when = read_geometry(fields, detectors, signals.shape[3])
        pulses, unclear = read_pulses(fields, signals.shape[:2], across)
        return Scan(
            signals,
            geometry,
            wavelengths,
            valid(fields, signals.shape[:3]),
            **pulses,
            name=fields.text("oatkit_name") or path.stem,
            source=str(path),
            reader=self.name,
            speed_of_sound_source=speed_source,
            notes=(*stored_notes(fields), *which, *where, *when, *unclear, *oddities(fields, signals.shape)),
        )


def _signals(file: Any, path: Path, fields: Fields, detectors: int, wavelengths: int) -> tuple[Hdf5Signals, Fields]:
    """Return the signals, and the fields with their axes turned as those of the signals are."""
    shape = hdf5_dataset(file, SIGNALS, "iuf", (2, 3, 4)).shape
    named = fields.has(WAVELENGTHS)
    found = find_axes(shape, detectors, wavelengths)
    # A third axis may be frames or wavelengths: without their names, nobody can tell.
    if found is None or (not named and len(shape) == 3 and 1 not in shape):
        named_ones = f"{wavelengths} {WAVELENGTHS}" if named else f"one wavelength, since {WAVELENGTHS} is missing"
        raise ReadError(
            f"{path} '{SIGNALS}': expected the axes detector, sample, wavelength and frame with {detectors} detectors "
            f"and {named_ones}, found the shape {shape}"
        )
    axes, turned = found
    return hdf5_signals(file, path, SIGNALS, axes), Fields(fields.group, turned)
