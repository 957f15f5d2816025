"""Scans of known objects: phantoms, detector arrays and simulated noisy signals.

Nothing here knows a forward model by name; it is handed in.
"""

from oatkit.simulate.arrays import arc_detectors, msot_geometry
from oatkit.simulate.phantoms import PHANTOMS, breast, disc, star, truth, vessel
from oatkit.simulate.scan import simulate_scan, useful_window

__all__ = [
    "PHANTOMS", "arc_detectors", "breast", "disc", "msot_geometry", "simulate_scan", "star", "truth", "useful_window",
    "vessel",
]  # fmt: skip
