"""The other sign."""

from dataclasses import replace
from typing import ClassVar

from oatkit.api import Preprocessor, Scan
from oatkit.builtin.preprocess.samples import finite_samples


class Invert(Preprocessor):
    """Multiplies the signals by -1: for scanners, and files, that store a rise of pressure as a negative number.

    A wrong sign shows: the image is bright where it should be dark, least squares is negative inside the body, and
    non-negative solvers find next to nothing there. Put it behind `offset`.
    """

    name: ClassVar[str] = "invert"

    def process(self, scan: Scan) -> Scan:
        """Return the scan with the other sign, as float32 or float64."""
        samples = finite_samples(scan, self.name)
        return replace(scan, signals=-samples, notes=(*scan.notes, "invert: signals were multiplied by -1."))
