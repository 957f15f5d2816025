"""Detector arrays to simulate with."""

import numpy as np

from oatkit.content import check_range
from oatkit.data import Detectors, Geometry


def arc_detectors(n: int = 256, radius_m: float = 0.0405, coverage_deg: float = 270.0) -> Detectors:
    """Return `n` detectors on an arc about the origin, open at the bottom (negative y), as in an MSOT scanner.

    The arc is cut into `n` equal pieces with a detector in the middle of each, counted anticlockwise from the lower
    right; 360 degrees give a closed ring. The defaults are the array of an MSOT256-TF, detector by detector.

    Raises `ValidationError` for a count below 1, a radius outside 1 mm .. 1 m or a coverage outside 0.1 .. 360 degrees.
    """
    check_range("n", n, 1, 100_000, "an array has at least one detector")
    check_range("radius_m", radius_m, 1e-3, 1.0, "the unit is m, so 40.5 mm is 0.0405")
    check_range("coverage_deg", coverage_deg, 0.1, 360.0, "the unit is degrees, so a half circle is 180")
    from_top_deg = ((np.arange(n) + 0.5) / n - 0.5) * coverage_deg
    angle = np.deg2rad(90 + from_top_deg)
    return Detectors(radius_m * np.column_stack([np.sin(angle), np.cos(angle)]))


def msot_geometry() -> Geometry:
    """Return the array and sampling of [Prakash2019]_, an MSOT256-TF: 2030 samples at 40 MHz, 1520 m/s.

    Its detectors are points without an impulse response, as in the paper's simulations.
    """
    return Geometry(arc_detectors(), sampling_rate_hz=40e6, n_samples=2030, speed_of_sound_m_s=1520)
