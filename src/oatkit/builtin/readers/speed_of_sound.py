"""The speed of sound in water."""

WATER_COEFFICIENTS = (1402.385, 5.038813, -5.799136e-2, 3.287156e-4, -1.398845e-6, 2.787860e-9)
WATER_RANGE_C = (0.0, 95.0)


def water_speed_of_sound_m_s(temperature_c: float) -> float:
    """Return the speed of sound in pure water, m/s, by the polynomial of Marczak (1997), good for 0 .. 95 C."""
    return sum(c * temperature_c**power for power, c in enumerate(WATER_COEFFICIENTS))
