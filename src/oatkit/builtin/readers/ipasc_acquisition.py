"""How the signals of an IPASC file were taken: wavelengths, sampling, speed of sound, and what is not applied."""

from math import prod

import numpy as np

from oatkit.builtin.readers.ipasc_fields import Fields
from oatkit.data import Detectors, Geometry

WAVELENGTHS = "acquisition_wavelengths"
NOT_APPLIED = ("overall_gain", "element_dependent_gain", "time_gain_compensation", "frequency_domain_filter")
"""Fields that say what was done to the signals; noted where they are not one."""


def wavelengths_nm(fields: Fields, unnamed: float) -> tuple[tuple[float, ...], list[str]]:
    """Return the wavelengths and notes; without any in the file, `unnamed` as the only one.

    Metres are the layout's unit. Files with nanometres exist, some of the consortium's own converters write them; no
    wavelength of light in one of the units can be taken for one in the other.
    """
    values = fields.array(WAVELENGTHS)
    if values is None:
        return (unnamed,), [
            f"The file does not name its wavelength: {unnamed:g} nm is assumed, which matters to fluence and unmixing "
            "only; the reader 'ipasc' takes another one as its parameter 'wavelength'."
        ]
    values = values.ravel()
    if values.size and ((values >= 1e-7) & (values <= 2e-5)).all():
        # Rounding takes away what the conversion has added: 8.135e-07 m is 813.5 nm, not 813.5000000000001.
        return tuple(float(w) for w in np.round(values * 1e9, 11)), []
    if values.size and ((values >= 100) & (values <= 20_000)).all():
        return tuple(float(w) for w in values), [f"The {WAVELENGTHS} are taken as nm; the layout wants m."]
    found = ", ".join(f"{w:g}" for w in values[:3]) or "none"
    raise fields.error(WAVELENGTHS, "wavelengths between 1e-7 and 2e-5 m", found)


def read_geometry(fields: Fields, detectors: Detectors, n_samples: int) -> tuple[Geometry, str, list[str]]:
    """Return the geometry, where its speed of sound comes from, and what had to be assumed."""
    notes = []
    rate_hz = fields.number("ad_sampling_rate")
    if rate_hz is None:
        raise fields.error("ad_sampling_rate", "the sampling rate in Hz", "nothing")
    start_s = fields.number("oatkit_start_time_s")
    if start_s is None:
        notes.append("The file does not say when the first sample was taken: at the light pulse is assumed.")
    response = fields.array("oatkit_impulse_response")
    if response is None:
        notes.append("The file holds no impulse response with its phase: signals are taken as the ideal ones.")
    speed, source, note = _speed_of_sound(fields)
    response = None if response is None else response.ravel()
    return Geometry(detectors, rate_hz, n_samples, start_s or 0.0, speed, response), source, [*notes, *note]


def _speed_of_sound(fields: Fields) -> tuple[float, str, list[str]]:
    """Return the speed of sound (m/s), where it comes from, and a note where it had to be chosen."""
    values, default = fields.array("speed_of_sound"), Geometry.speed_of_sound_m_s
    if values is None or not values.size:
        return default, "default", [f"The file gives no speed of sound: {default:g} m/s is assumed."]
    lowest, median, highest = (float(v) for v in np.quantile(values, (0, 0.5, 1)))
    if lowest == highest:
        return lowest, fields.text("oatkit_speed_of_sound_source") or "file: meta_data/speed_of_sound", []
    note = f"The speed of sound is a map of {lowest:g} .. {highest:g} m/s; its median is taken, {median:g} m/s."
    return median, "file: median of the map meta_data/speed_of_sound", [note]


def valid(fields: Fields, shape: tuple[int, ...]) -> np.ndarray:
    """Return which channels can be trusted, (frame, wavelength, detector): all, where oatkit has not added it."""
    values = fields.array("oatkit_valid")
    if values is None:
        return np.ones(shape, bool)
    if values.size != prod(shape):
        raise fields.error("oatkit_valid", f"a value for each of {shape}", f"the shape {values.shape}")
    return values.reshape(shape[::-1]).T


def stored_notes(fields: Fields) -> list[str]:
    """Return the notes of the scan that oatkit wrote."""
    return [line for line in fields.text("oatkit_notes").split("\n") if line]


def oddities(fields: Fields, shape: tuple[int, ...]) -> list[str]:
    """Return notes on fields that are not applied, and on sizes that disagree with the signals."""
    notes = []
    for name in NOT_APPLIED:
        values = fields.array(name)
        if values is not None and not (values == 1).all():
            notes.append(f"The file holds {name}; it is neither applied nor undone.")
    sizes = fields.array("sizes")
    if sizes is not None and sorted(n for n in sizes.ravel() if n != 1) != sorted(n for n in shape if n != 1):
        found = " x ".join(f"{n:g}" for n in sizes.ravel()[:6])
        notes.append(f"The field sizes says {found}, the signals are {' x '.join(map(str, shape))}.")
    return notes
