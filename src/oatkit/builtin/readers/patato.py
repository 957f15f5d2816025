"""Scans, results and regions of interest in the HDF5 files of PATATO."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from oatkit.api import Detectors, Geometry, Image, Reader, ReadError, Region, Scan, ValidationError, param
from oatkit.builtin.readers.hdf5_signals import hdf5_signals
from oatkit.builtin.readers.ithera_response import centred
from oatkit.builtin.readers.patato_images import images
from oatkit.builtin.readers.patato_layout import RAW_DATA, has, has_layout, number, text
from oatkit.builtin.readers.patato_pulses import optional, pulses, scan_wavelengths
from oatkit.builtin.readers.patato_regions import regions
from oatkit.builtin.readers.patato_speed import speed_of_sound
from oatkit.builtin.readers.plane import flat_axes, seen_along
from oatkit.hostile import hdf5_dataset, open_hdf5
from oatkit.scanfile import MAX_ARRAY_BYTES


class Patato(Reader):
    """Reads an HDF5 file of PATATO: raw data, finished images by the names of their datasets, regions of interest.

    Signals stay in the file, as they are. Images of all groups known to PATATO are read, those that are volumes or
    have oblong pixels raise `ReadError` when they are asked for. Regions are the polygons in ``rois``.
    """

    name: ClassVar[str] = "patato"
    impulse_response: bool = param(True, "whether the impulse response in the file is part of the geometry")

    def can_read(self, path: Path) -> bool:
        """Claim an HDF5 file with the groups and datasets of PATATO."""
        try:
            return has_layout(path)
        except Exception:  # whatever h5py makes of a damaged file
            return False

    def read(self, path: Path) -> Scan:
        """Return the scan. Raises `ReadError`."""
        with open_hdf5(path) as file:
            if not has(file, RAW_DATA):
                raise ReadError(
                    f"{path}: results of PATATO without raw data, so that there is no scan to read; "
                    "read_images and read_regions return what is in the file"
                )
            try:
                return self._scan(file, path)
            except ValidationError as error:
                raise ReadError(f"{path}: {error}") from None

    def images(self, path: Path) -> Mapping[str, Sequence[Image]]:
        """Return the results in the file by the names of their datasets. Raises `ReadError`."""
        with open_hdf5(path) as file:
            return images(file, path)

    def regions(self, path: Path) -> tuple[Region, ...]:
        """Return the polygons in ``rois``. Raises `ReadError`."""
        with open_hdf5(path) as file:
            return regions(file, path)

    def _scan(self, file: Any, path: Path) -> Scan:
        signals = hdf5_signals(file, path, RAW_DATA)
        wavelengths = scan_wavelengths(file)
        if wavelengths is None:
            raise ReadError(f"{path} 'wavelengths': expected the wavelengths, nm, found nothing")
        frames, n_wavelengths, _, n_samples = signals.shape
        taken = pulses(file, (frames, n_wavelengths))
        speed, source, speed_note = speed_of_sound(file, taken.temperature_c)
        notes = [*taken.notes, speed_note]
        response = self._response(file, n_samples, notes)
        geometry = Geometry(_detectors(file, path), _sampling_rate_hz(file, path), n_samples, 0.0, speed, response)
        return Scan(
            signals,
            geometry,
            tuple(wavelengths.tolist()),
            pulse_energy=taken.energy,
            temperature_c=taken.temperature_c,
            timestamps_s=taken.timestamps_s,
            position_m=taken.position_m,
            name=_first_of(text, file, "name") or path.stem,
            source=str(path),
            reader=self.name,
            speed_of_sound_source=source,
            notes=tuple(filter(None, notes)),
        )

    def _response(self, file: Any, n_samples: int, notes: list[str]) -> np.ndarray | None:
        if not self.impulse_response:
            notes.append("The impulse response was not asked for: signals are taken as the ideal ones.")
            return None
        values = optional(file, "irf", notes, (n_samples,))
        if values is None or not np.nan_to_num(values).any():
            notes.append("There is no impulse response in the file: signals are taken as the ideal ones.")
            return None
        response, note = centred(values.astype(float), f"{file.filename} 'irf'")
        notes.append(note)
        return response


def _detectors(file: Any, path: Path) -> Detectors:
    """Return ``GEOMETRY``, (x, y, z) or (x, y), in the plane in which the detectors lie."""
    points = np.asarray(hdf5_dataset(file, "GEOMETRY", "iuf", 2, MAX_ARRAY_BYTES)[()], float)
    if points.shape[1] == 2:
        return Detectors(points[:, ::-1])
    if points.shape[1] != 3 or not len(points):
        raise ReadError(f"{path} 'GEOMETRY': expected detectors as (x, y, z), found the shape {points.shape}")
    return seen_along(points, flat_axes(points, f"{path} 'GEOMETRY'")[0])


def _sampling_rate_hz(file: Any, path: Path) -> float:
    rate = _first_of(number, file, "fs")
    if not rate:
        raise ReadError(f"{path}: expected the sampling rate in the attribute 'fs' of '{RAW_DATA}', found no number")
    return float(rate)


def _first_of(read: Any, file: Any, name: str) -> Any:
    """Return an attribute of the raw data, or of the file where they have none."""
    return read(file[RAW_DATA], name) or read(file, name)
