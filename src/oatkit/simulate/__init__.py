"""Scans of known objects: phantoms and bodies, detector arrays and simulated noisy signals.

Nothing here knows a forward model or a model of light by name; it is handed in.
"""

from oatkit.simulate.arrays import arc_detectors, msot_geometry
from oatkit.simulate.bodies import BODIES, Body, breast_body, disc_body, mouse_body, star_body
from oatkit.simulate.phantoms import PHANTOMS, breast, disc, star, truth, vessel
from oatkit.simulate.scan import simulate_scan, useful_window

__all__ = [
    "BODIES", "PHANTOMS", "Body", "arc_detectors", "breast", "breast_body", "disc", "disc_body", "mouse_body",
    "msot_geometry", "simulate_scan", "star", "star_body", "truth", "useful_window", "vessel",
]  # fmt: skip
