"""Slips of units, orientation and time that no range can refuse, since somebody might mean them: said in notes.

What is impossible is refused where it is declared. Here stands what is possible but not what scans of tissue look
like, each with the unit that may have been meant.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from oatkit.data import Grid, Optics, Scan

USUAL: Mapping[str, tuple[float, float, str]] = {
    "pulse_energy": (1e-12, 1e12, "energies are positive numbers"),
    "temperature_c": (-20.0, 120.0, "the unit is degrees Celsius, so 306 K is 32.85"),
    "timestamps_s": (-1e11, 1e11, "the unit is s, so 5 ms is 0.005"),
    "position_m": (-2.0, 2.0, "the unit is m, so 60 mm is 0.06"),
}
"""What a scan says of each pulse: range, and the unit."""
WAVELENGTHS_NM = (350.0, 2500.0)
SPEEDS_M_S = (1300.0, 1700.0)
RATES_HZ = (1e6, 5e8)
ABSORPTION_PER_M = (0.1, 1e5)
SCATTERING_PER_M = (50.0, 1e5)
FAR = 3.0
"""Times the median distance of the detectors from their middle: further than that, one of them is out of place."""
CLOSE_M = 1e-6
"""Detectors that are nearer to each other are at one place."""
FEW = 20
"""Samples beside the times of the field of view that are too few to be compared with those within."""


def scan_notes(scan: Scan) -> tuple[str, ...]:
    """Say what in a scan's numbers speaks of a slip; its signals are not looked at."""
    return (*_of_times(scan), *_of_detectors(scan.geometry.detectors.positions_m), *_of_pulses(scan))


def optics_notes(optics: Optics) -> tuple[str, ...]:
    """Say where the optical properties of a body are none that tissue has, by their unit."""
    found = []
    for name, symbol, values, (lowest, highest) in (
        ("absorption_per_m", "mu_a", optics.absorption_per_m, ABSORPTION_PER_M),
        ("reduced_scattering_per_m", "mu_s'", optics.reduced_scattering_per_m, SCATTERING_PER_M),
    ):
        means = [float(np.mean(plane)) for plane in values]
        wrong = [mean for mean in means if not lowest <= mean <= highest]
        if wrong:
            found.append(
                f"{symbol} is {wrong[0]:g} 1/m; tissue has {lowest:g} .. {highest:g} 1/m "
                f"({name}: the unit is 1/m, so 10 per cm is 1000)"
            )
    return tuple(found)


def arrival_notes(clean: Scan, grid: Grid) -> tuple[str, ...]:
    """Say where the signals of a preprocessed frame are stronger outside the times of the field of view than within.

    Compared are mean squares of all samples of valid channels that are not zero, before the sound of the nearest pixel
    can arrive, until that of the farthest one, and after. A slip in the time zero, the speed of sound or the unit of
    the positions shows in it where it moves most of the signal out of these times, a reversed time axis where the
    record is not symmetric about them; a smaller one does not.
    """
    before, within, after = _mean_squares(clean, grid)
    loud = [
        f"{word} {square / within:.3g} times"
        for word, square in (("before", before), ("after", after))
        if square > within
    ]
    if not loud:
        return ()
    near, far = clean.geometry.reach(grid)
    speed = clean.geometry.speed_of_sound_m_s
    return (
        f"The signals are stronger, {' and '.join(loud)}, than at the {1e6 * near.min() / speed:.3g} .. "
        f"{1e6 * far.max() / speed:.3g} us at which the sound of the field of view arrives; check the time of the "
        f"first sample ({1e6 * clean.geometry.start_time_s:.3g} us after the light), the speed of sound, the unit of "
        "the detectors' positions, and whether the time axis runs forward.",
    )


def _of_times(scan: Scan) -> Iterator[str]:
    """Say what is odd in wavelengths, speed and sampling."""
    geometry = scan.geometry
    odd = [w for w in scan.wavelengths_nm if not WAVELENGTHS_NM[0] <= w <= WAVELENGTHS_NM[1]]
    if odd:
        yield (
            f"A wavelength is {odd[0]:g} nm; tissue is imaged at {WAVELENGTHS_NM[0]:g} .. {WAVELENGTHS_NM[1]:g} nm "
            "(the unit is nm, so 7000 angstrom are 700)."
        )
    if not SPEEDS_M_S[0] <= geometry.speed_of_sound_m_s <= SPEEDS_M_S[1]:
        yield (
            f"The speed of sound is {geometry.speed_of_sound_m_s:g} m/s; water and soft tissue have {SPEEDS_M_S[0]:g} "
            f".. {SPEEDS_M_S[1]:g} m/s (the unit is m/s, so 4900 feet a second are 1494)."
        )
    if not RATES_HZ[0] <= geometry.sampling_rate_hz <= RATES_HZ[1]:
        yield (
            f"The sampling rate is {geometry.sampling_rate_hz:g} Hz; ultrasound is sampled at {RATES_HZ[0]:g} .. "
            f"{RATES_HZ[1]:g} Hz (the unit is Hz, so 40 MHz is 40e6)."
        )


def _of_detectors(positions_m: np.ndarray) -> Iterator[str]:
    """Say which detectors are far from all others, and how many share a place."""
    distance = np.hypot(*(positions_m - np.median(positions_m, axis=0)).T)
    usual = float(np.median(distance))
    far = np.flatnonzero(distance > FAR * usual)
    if len(positions_m) > 2 and len(far):
        yield (
            f"Detector {far[0]} of {len(positions_m)}{_more(len(far) - 1)} lies {1e3 * distance[far[0]]:.4g} mm from "
            f"the middle of all, the others about {1e3 * usual:.4g} mm (the unit is m, so 40 mm is 0.04)."
        )
    places = len(np.unique(np.round(positions_m / CLOSE_M), axis=0))
    if places < len(positions_m):
        yield f"The {len(positions_m)} detectors are at {places} places only: some share one."


def _of_pulses(scan: Scan) -> Iterator[str]:
    for name, (lowest, highest, hint) in USUAL.items():
        values = getattr(scan, name)
        if values is None:
            continue
        odd = values[~((values >= lowest) & (values <= highest))]
        if odd.size:
            yield f"The {name} of {odd.size} of {values.size} pulses is odd, as {odd[0]:g}; {hint}."


def _more(count: int) -> str:
    return f" and {count} more" if count else ""


def _mean_squares(clean: Scan, grid: Grid) -> tuple[float, float, float]:
    """Return the mean square of the samples before, within and after the times of a grid; 0 where they are few."""
    near, far = clean.geometry.reach(grid)
    speed, times = clean.geometry.speed_of_sound_m_s, clean.geometry.times_s
    signals = np.asarray(clean.signals, dtype=float) * clean.valid[..., None]
    squares = signals**2
    early = times < near[:, None] / speed
    late = times > far[:, None] / speed
    return _mean(squares, early), _mean(squares, ~(early | late)), _mean(squares, late)


def _mean(squares: np.ndarray, chosen: np.ndarray) -> float:
    """Return the mean of those that are chosen, (detector, sample), and not zero: a crop leaves zeros."""
    values = squares[..., chosen]
    count = np.count_nonzero(values)
    return float(values.sum() / count) if count > FEW * len(chosen) else 0.0
