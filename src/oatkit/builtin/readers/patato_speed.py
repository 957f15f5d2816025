"""The speed of sound in an HDF5 file of PATATO."""

from typing import Any

import numpy as np

from oatkit.builtin.readers.patato_layout import RAW_DATA, members, number
from oatkit.builtin.readers.speed_of_sound import WATER_RANGE_C, water_speed_of_sound_m_s
from oatkit.data import Geometry
from oatkit.hostile import printable

LOWEST_M_S, HIGHEST_M_S = 300.0, 7000.0
"""What is outside is no speed but, in results that come from iThera, a trim added to the speed in water."""


def speed_of_sound(file: Any, temperature_c: np.ndarray | None) -> tuple[float, str, str]:
    """Return the speed of sound (m/s), where it comes from, and a note where it had to be assumed.

    The attribute ``speedofsound`` of the raw data or of the file; else that of the first reconstruction which has one;
    else water at the mean temperature of the pulses.
    """
    stored = [(name, number(file[name], "speedofsound")) for name in (RAW_DATA, "/", *members(file, "recons"))]
    speeds = [(name, value) for name, value in stored if value is not None and LOWEST_M_S <= value <= HIGHEST_M_S]
    if speeds:
        name, speed = speeds[0]
        others = ", ".join(f"{value:g}" for value in sorted({value for _, value in speeds} - {speed}))
        note = f"Reconstructions in the file used other speeds of sound: {others} m/s." if others else ""
        return speed, f"file: attribute speedofsound of {printable(name, 100)}", note
    mean = np.nan if temperature_c is None else float(temperature_c.mean())
    if not WATER_RANGE_C[0] < mean <= WATER_RANGE_C[1]:
        default = Geometry.speed_of_sound_m_s
        return default, "default", f"The file tells no speed of sound: {default:g} m/s is assumed."
    speed = water_speed_of_sound_m_s(mean)
    note = "The file tells no speed of sound: that in water is assumed, without the trim that the image may need."
    return speed, f"water at {mean:.2f} C {speed:.1f} m/s", note
