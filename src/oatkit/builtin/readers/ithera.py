"""Scans of iThera MSOT instruments."""

from pathlib import Path
from typing import ClassVar, Literal

from oatkit.api import Reader, ReadError, Scan, ValidationError, param
from oatkit.builtin.readers.ithera_header import Header, read_header
from oatkit.builtin.readers.ithera_signals import raw_signals
from oatkit.hostile import inside


class IThera(Reader):
    """Reads an iThera scan: the header ``.msot``, or the folder that holds it, with ``.bin`` and ``.irf`` beside it.

    The three files share one name; in a folder, the header is the one named as the folder, or the only one. Signals
    stay in the file, uint16 with the offset of the instrument. Data versions 2.2 to 2.4 and the older arc geometry.
    """

    name: ClassVar[str] = "ithera"
    impulse_response: bool = param(True, "whether the impulse response of the instrument is part of the geometry")
    polarity: Literal[1, -1] = param(1, "-1 where compression is stored as falling values; signals are then inverted")

    def can_read(self, path: Path) -> bool:
        """Claim a file that ends in ``.msot`` and a folder that holds one to choose."""
        try:
            return path.suffix.lower() == ".msot" if path.is_file() else _header_in(path) is not None
        except (OSError, ValueError):
            return False

    def read(self, path: Path) -> Scan:
        """Return the scan. Raises `ReadError`."""
        msot = _header_in(path) if path.is_dir() else path
        if msot is None:
            raise ReadError(f"{path}: expected a folder with one .msot header, or one named as the folder")
        try:
            return self._scan(msot, read_header(msot, self.impulse_response))
        except ValidationError as error:
            raise ReadError(f"{msot}: {error}") from None

    def _scan(self, msot: Path, header: Header) -> Scan:
        pulses = header.pulses
        binary = inside(msot.parent, f"{msot.stem}.bin")
        polarity = "Signals were inverted (polarity -1)." if self.polarity < 0 else "Polarity +1: signals as stored."
        return Scan(
            raw_signals(binary, pulses.offsets, header.geometry.shape, self.polarity < 0, header.digest),
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
            notes=(*header.notes, polarity),
        )


def _header_in(folder: Path) -> Path | None:
    """Return the header of a scan folder: the one named as the folder, or the only one; None where there is none."""
    headers = sorted(p for p in folder.glob("*") if p.suffix.lower() == ".msot")
    named = [p for p in headers if p.stem == folder.resolve().name]
    chosen = named or headers
    return chosen[0] if len(chosen) == 1 else None
