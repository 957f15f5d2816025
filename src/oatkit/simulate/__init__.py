"""Scans of known objects: phantoms and bodies, detector arrays and simulated noisy signals.

Nothing here knows a forward model or a model of light by name; it is handed in.
"""

from oatkit.simulate.arrays import arc_detectors, msot_geometry
from oatkit.simulate.bodies import BODIES, Body, breast_body, disc_body, mouse_body, star_body
from oatkit.simulate.finite_elements import Band, diffuse_light
from oatkit.simulate.multispectral import LitBody, illuminate, oxygen_phantom, simulate_multispectral
from oatkit.simulate.oxygen import Inclusion, OxygenBody
from oatkit.simulate.phantoms import PHANTOMS, breast, disc, star, truth, vessel
from oatkit.simulate.polar_mesh import PolarMesh
from oatkit.simulate.scan import simulate_scan, useful_window

__all__ = [
    "BODIES", "PHANTOMS", "Band", "Body", "Inclusion", "LitBody", "OxygenBody", "PolarMesh", "arc_detectors", "breast",
    "breast_body", "diffuse_light", "disc", "disc_body", "illuminate", "mouse_body", "msot_geometry", "oxygen_phantom",
    "simulate_multispectral", "simulate_scan", "star", "star_body", "truth", "useful_window", "vessel",
]  # fmt: skip
