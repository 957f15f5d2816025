"""Correction for the energy of the light pulses."""

from dataclasses import replace
from typing import ClassVar

from oatkit.api import Preprocessor, ReadError, Scan
from oatkit.builtin.preprocess.samples import check_offset_removed, finite_samples

MOST_LISTED = 3
"""Of more energies, the least and the greatest are told."""


class Energy(Preprocessor):
    """Divides the signals of each pulse by its relative energy, so that wavelengths compare.

    The energies leave the scan with that, so that they cannot be applied twice; without any, nothing is done. The
    offset must have been removed, since it does not come from the light.
    """

    name: ClassVar[str] = "energy"

    def process(self, scan: Scan) -> Scan:
        """Return the scan per unit of pulse energy, without ``pulse_energy``."""
        if scan.pulse_energy is None:
            return replace(scan, notes=(*scan.notes, "energy: the scan holds no pulse energies, nothing was divided."))
        samples = finite_samples(scan, self.name)
        check_offset_removed(samples, scan.valid, self.name)
        energies = scan.pulse_energy[0]
        for wavelength, energy in zip(scan.wavelengths_nm, energies, strict=True):
            if not 0 < energy < float("inf"):
                raise ReadError(f"energy: expected a positive pulse energy at {wavelength:g} nm, found {energy:g}")
        divided = (samples / energies[:, None, None]).astype(samples.dtype)
        listed = ", ".join(f"{e:.6g}" for e in energies)
        if len(energies) > MOST_LISTED:
            listed = f"{energies.min():.6g} .. {energies.max():.6g}, by wavelength"
        note = f"energy: signals were divided by {listed}."
        return replace(scan, signals=divided, pulse_energy=None, notes=(*scan.notes, note))
