"""The tables of a pipeline file that are no plugins: scan, motion, grid, optics, absorption."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from oatkit.data import Grid, Optics, Scan
from oatkit.parameters import Parameters, param
from oatkit.slips import scan_notes
from oatkit.spectra import TISSUES, tissue_optics
from oatkit.spectra.optics import read_optics
from oatkit.wavelengths import choose_wavelengths, wavelength_notes


class ScanTable(Parameters):
    """The table ``[scan]``: what is known better than the file says."""

    speed_of_sound_m_s: float | Literal["focus"] | None = param(
        None,
        'speed of sound, in place of the file\'s; "focus" takes the one that gives the sharpest image',
        unit="m/s",
        at_least=300,
        at_most=7000,
    )
    start_time_us: float | None = param(
        None,
        "time of the first sample after the light pulse, in place of the file's",
        unit="us",
        at_least=-10_000,
        at_most=10_000,
    )
    rules: Literal["scan", "frame"] = param(
        "scan",
        "whether words that stand for numbers (weight, speed of sound, calibration) are replaced once for the scan, on "
        "its first frame, or anew on each frame",
    )
    wavelengths_nm: tuple[float, ...] = param(
        (),
        "those to use, within 0.5 nm, in the order of the scan; all where none is named",
        unit="nm",
        at_least=100,
        at_most=20_000,
    )

    def apply(self, scan: Scan) -> Scan:
        """Return the scan with its values overridden; a speed of sound that is still a rule is left alone.

        The order of wavelengths is that of the scan: repeated ones stay repeated, unsorted ones unsorted, and a note
        says so. Signals in a file stay there. Raises `ValidationError` for a wavelength that the scan does not have.
        """
        if self.wavelengths_nm:
            scan = choose_wavelengths(scan, self.wavelengths_nm)
        if isinstance(self.speed_of_sound_m_s, float | int):
            scan = scan.with_speed_of_sound(self.speed_of_sound_m_s, "pipeline")
        if self.start_time_us is not None:
            scan = scan.with_start_time(self.start_time_us * 1e-6)
        found = (*wavelength_notes(scan.wavelengths_nm), *scan_notes(scan))
        return replace(scan, notes=(*scan.notes, *(note for note in found if note not in scan.notes)))


class MotionTable(Parameters):
    """The table ``[motion]``: frames with a pulse out of place are found before anything is reconstructed."""

    threshold: float = param(
        6.0, "how far below the typical correlation a pulse is out of place, in robust standard deviations", above=0
    )
    least_drop: float = param(
        0.1, "least drop below the typical correlation that counts, relative to it", above=0, below=1
    )
    leave_out: bool = param(False, "whether frames with a pulse out of place are left out of a run over many frames")


class GridTable(Parameters):
    """The table ``[grid]``: the square image to reconstruct."""

    pixels: int = param(200, "pixels along each side", at_least=2, at_most=8192)
    field_of_view_mm: float = param(25.0, "length of each side", unit="mm", above=0, at_most=1000)
    centre_mm: tuple[float, float] = param(
        (0.0, 0.0), "middle of the image, (y, x)", unit="mm", at_least=-1000, at_most=1000
    )

    def grid(self) -> Grid:
        """Return the grid in SI units. Raises `ValidationError` for pixels of an impossible size."""
        y, x = self.centre_mm
        return Grid((self.pixels, self.pixels), self.field_of_view_mm * 1e-3 / self.pixels, (y * 1e-3, x * 1e-3))


class OpticsTable(Parameters):
    """The table ``[optics]``: how the body absorbs and scatters light, as the fluence model is told.

    A number holds at every wavelength and takes the place of the tissue's or the file's value.
    """

    tissue: Literal[tuple(TISSUES)] = param("soft-tissue", "preset of the tissue")  # type: ignore[valid-type]
    table: Path | None = param(
        None,
        "CSV file in place of a preset, with the columns wavelength_nm, absorption_per_cm, reduced_scattering_per_cm",
    )
    absorption_per_cm: float | None = param(
        None, "mu_a of the body at every wavelength", unit="1/cm", above=0, at_most=100_000
    )
    reduced_scattering_per_cm: float | None = param(
        None, "mu_s' of the body at every wavelength", unit="1/cm", above=0, at_most=100_000
    )

    def optics(self, wavelengths_nm: tuple[float, ...]) -> Optics:
        """Return the properties in SI units. Raises `ReadError` for the file and `ValidationError` out of its range."""
        given = (self.absorption_per_cm, self.reduced_scattering_per_cm)
        if None in given:
            known = read_optics(self.table, wavelengths_nm) if self.table else self._of_tissue(wavelengths_nm)
            tabulated = [known.absorption_per_m, known.reduced_scattering_per_m]
        else:
            tabulated = [np.zeros(0)] * 2
        columns = [
            values if number is None else np.full(len(wavelengths_nm), 100 * number)
            for number, values in zip(given, tabulated, strict=True)
        ]
        return Optics(wavelengths_nm, *columns)

    def _of_tissue(self, wavelengths_nm: tuple[float, ...]) -> Optics:
        return tissue_optics(self.tissue, wavelengths_nm)


class AbsorptionTable(Parameters):
    """The table ``[absorption]``: from initial pressure and fluence to the absorption coefficient."""

    calibration: float | None = param(
        None,
        "K: signal that 1/m of absorption gives at fluence 1 and Grueneisen parameter 1; without it absorption is in "
        "arbitrary units",
        unit="a.u. m",
        above=0,
    )
    calibrated_by: Literal["hand", "spectra"] = param(
        "hand",
        'where the calibration comes from: "spectra" has the unmixer find it, once for a scan, if no number is given',
    )
    grueneisen: float = param(1.0, "Grueneisen parameter of the body; 1 leaves it in the calibration", above=0)
    passes: int = param(
        1,
        "passes between absorption and light: 1 takes the light of a homogeneous body, more feed the absorption back",
        at_least=1,
        at_most=100,
    )
    floor: float = param(
        0.02, "least fluence that is divided by, relative to the largest in the body", above=0, at_most=1
    )
