"""Removal of what the light pulse itself leaves in the signals."""

from dataclasses import replace
from typing import ClassVar

from oatkit.api import Preprocessor, Scan, param
from oatkit.builtin.preprocess.samples import check_offset_removed, finite_samples, window


class Transient(Preprocessor):
    """Sets the first part of every record to zero: there the light pulse hits the detectors.

    The default is 150 samples at 40 MHz, 5.6 mm of water. The offset must have been removed, or the step from zero to
    it would be a transient of its own.
    """

    name: ClassVar[str] = "transient"
    until: float = param(3.75, "the first time that is kept, after the light pulse", unit="us", at_least=0)

    def process(self, scan: Scan) -> Scan:
        """Return the scan with zeros before `until`."""
        samples = finite_samples(scan, self.name)
        check_offset_removed(samples, scan.valid, self.name)
        kept = window(scan.geometry, self.until, float("inf"), self.name)
        samples[..., : kept.start] = 0
        note = f"transient: {kept.start} samples before {self.until:g} us were set to zero."
        return replace(scan, signals=samples, notes=(*scan.notes, note))
