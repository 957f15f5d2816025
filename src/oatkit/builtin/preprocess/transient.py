"""Removal of what the light pulse itself leaves in the signals."""

from dataclasses import replace
from typing import ClassVar

from oatkit.api import Preprocessor, Scan, param
from oatkit.builtin.preprocess.samples import check_offset_removed, finite_samples, window


class Transient(Preprocessor):
    """Cuts off the first part of every record: there the light pulse hits the detectors.

    The records start later then and are shorter, so that the forward model predicts no more than what is left. The
    default is 150 samples at 40 MHz, 5.6 mm of water. The offset must have been removed, or the step from nothing to it
    would be a transient of its own for the filters that follow.
    """

    name: ClassVar[str] = "transient"
    until: float = param(3.75, "the first time that is kept, after the light pulse", unit="us", at_least=0)

    def process(self, scan: Scan) -> Scan:
        """Return the scan from `until` on. Raises `ValidationError` where no sample is left."""
        samples = finite_samples(scan, self.name)
        check_offset_removed(samples, scan.valid, self.name)
        geometry = scan.geometry
        kept = window(geometry, self.until, float("inf"), self.name)
        start_time_s, left = geometry.times_s[kept.start], geometry.n_samples - kept.start
        note = (
            f"transient: {kept.start} samples before {self.until:g} us were cut off; a detector does not hear what is "
            f"nearer than {1e3 * start_time_s * geometry.speed_of_sound_m_s:.3g} mm."
        )
        cropped = replace(geometry, start_time_s=start_time_s, n_samples=left)
        return replace(scan, signals=samples[..., kept], geometry=cropped, notes=(*scan.notes, note))
