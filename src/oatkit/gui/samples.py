"""Simulated scans to try the windows with: made on the spot, in seconds, without a network."""

from collections.abc import Callable, Mapping

from oatkit.api import ForwardModel
from oatkit.data import Scan
from oatkit.registry import plugin

WAVELENGTHS_NM = (700.0, 760.0, 800.0, 850.0)
SPACING_M = 0.24e-3
"""Of the mesh of the light."""


def breast() -> Scan:
    """Return a scan of a breast-like phantom at one wavelength."""
    from oatkit.simulate import simulate_scan

    return simulate_scan("breast", arc(), pixels=331)


def oxygen() -> Scan:
    """Return a scan of a body with vessels of known oxygen saturation, which dims its own light."""
    from oatkit.simulate import OxygenBody, illuminate, oxygen_phantom, simulate_scan

    lit = illuminate(OxygenBody.draw(0), WAVELENGTHS_NM, spacing_m=SPACING_M)
    return simulate_scan(oxygen_phantom(lit), arc(), pixels=331)


SAMPLES: Mapping[str, Callable[[], Scan]] = {"breast": breast, "oxygen": oxygen}
"""By the name that the manifest knows."""


def arc() -> ForwardModel:
    """Return the acoustic model that samples are made with."""
    arc = plugin("forward_model", "arc")()
    assert isinstance(arc, ForwardModel)
    return arc
