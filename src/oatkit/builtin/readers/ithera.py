"""Scans of iThera MSOT instruments."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar, Literal

from oatkit.api import Image, Reader, ReadError, Region, Scan, ValidationError, param
from oatkit.builtin.readers.ithera_annotation import read_annotation
from oatkit.builtin.readers.ithera_header import Header, read_header, root_of
from oatkit.builtin.readers.ithera_images import images
from oatkit.builtin.readers.ithera_signals import odd_size, raw_signals
from oatkit.hostile import MAX_XML_BYTES, inside, read_at_most

ANNOTATION = ".iannotation"


class IThera(Reader):
    """Reads an iThera scan: the header ``.msot``, or the folder that holds it, with ``.bin`` and ``.irf`` beside it.

    The three files share one name; in a folder, the header is the one named as the folder, or the only one. Signals
    stay in the file, uint16 with the offset of the instrument. Data versions 2.2 to 2.4 and the older arc geometry.

    Images are what the vendor's software stored in the folders ``RECONs`` and ``MSPs``, and ultrasound in ``.us``.
    Regions are those of iLabs in ``.iannotation``, which may also be read by itself.
    """

    name: ClassVar[str] = "ithera"
    impulse_response: bool = param(True, "whether the impulse response of the instrument is part of the geometry")
    polarity: Literal[1, -1] = param(1, "-1 where compression is stored as falling values; signals are then inverted")

    def can_read(self, path: Path) -> bool:
        """Claim a file that ends in ``.msot`` or ``.iannotation`` and a folder that holds one header to choose."""
        try:
            if path.is_file():
                return path.suffix.lower() in (".msot", ANNOTATION)
            return _header_in(path) is not None
        except (OSError, ValueError):
            return False

    def read(self, path: Path) -> Scan:
        """Return the scan. Raises `ReadError`."""
        msot = _msot(path)
        try:
            return self._scan(msot, read_header(msot, self.impulse_response))
        except ValidationError as error:
            raise ReadError(f"{msot}: {error}") from None

    def images(self, path: Path) -> Mapping[str, Sequence[Image]]:
        """Return what the vendor's software stored beside the scan, and ultrasound. Raises `ReadError`."""
        if path.suffix.lower() == ANNOTATION:
            return {}
        msot = _msot(path)
        return images(root_of(read_at_most(msot, MAX_XML_BYTES), msot), msot)

    def regions(self, path: Path) -> tuple[Region, ...]:
        """Return the regions of the file ``.iannotation``: `path`, or the one named as the scan. Raises `ReadError`."""
        if path.suffix.lower() != ANNOTATION:
            msot = _msot(path)
            path = inside(msot.parent, f"{msot.stem}{ANNOTATION}")
        return read_annotation(path) if path.exists() else ()

    def _scan(self, msot: Path, header: Header) -> Scan:
        pulses = header.pulses
        binary = inside(msot.parent, f"{msot.stem}.bin")
        polarity = "Signals were inverted (polarity -1)." if self.polarity < 0 else "Polarity +1: signals as stored."
        shape = header.geometry.shape
        signals = raw_signals(binary, pulses.offsets, shape, self.polarity < 0, header.digest)
        return Scan(
            signals,
            header.geometry,
            pulses.wavelengths_nm,
            pulse_energy=pulses.energy,
            temperature_c=pulses.temperature_c,
            timestamps_s=pulses.timestamps_s,
            position_m=pulses.position_m,
            name=header.name,
            source=str(msot),
            reader=self.name,
            speed_of_sound_source=header.speed_of_sound_source,
            notes=(*header.notes, polarity, *filter(None, [odd_size(binary, shape)])),
        )


def _msot(path: Path) -> Path:
    """Return the header of a scan, given as the header or as its folder. Raises `ReadError` where there is none."""
    if path.suffix.lower() == ANNOTATION:
        raise ReadError(f"{path}: regions of interest, not a scan; read {path.stem}.msot, or take read_regions")
    msot = _header_in(path) if path.is_dir() else path
    if msot is None:
        raise ReadError(f"{path}: expected a folder with one .msot header, or one named as the folder")
    return msot


def _header_in(folder: Path) -> Path | None:
    """Return the header of a scan folder: the one named as the folder, or the only one; None where there is none."""
    headers = sorted(p for p in folder.glob("*") if p.suffix.lower() == ".msot")
    named = [p for p in headers if p.stem == folder.resolve().name]
    chosen = named or headers
    return chosen[0] if len(chosen) == 1 else None
