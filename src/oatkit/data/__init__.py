"""What flows through a pipeline: grids, detector arrays, scans and images.

All are frozen dataclasses in SI units (wavelengths in nm) whose arrays are read-only copies; they compare, hash and
pickle by content. Space has two axes in the order ``(y, x)``: y points up, x to the right, and row 0 of an image is at
the *bottom*. Only viewers and exporters flip.
"""

from oatkit.data.geometry import Detectors, Geometry
from oatkit.data.grid import Grid
from oatkit.data.image import Image, Optics
from oatkit.data.scan import Scan, Signals

__all__ = ["Detectors", "Geometry", "Grid", "Image", "Optics", "Scan", "Signals"]
