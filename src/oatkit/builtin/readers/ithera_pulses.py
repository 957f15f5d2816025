"""The pulses of an iThera header: which wavelength each had, where its signals lie, what was measured with it."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from oatkit.builtin.readers.xml_fields import Node

UNIX_EPOCH_TICKS = 621_355_968_000_000_000
"""1 January 1970 on the clock of .NET, which counts 100 ns from the year 1."""
MAX_OFFSET = 10**9


@dataclass(frozen=True)
class Pulses:
    """What the header says of each pulse, as arrays ``(frame, wavelength)``; None where it says nothing."""

    wavelengths_nm: tuple[float, ...]
    offsets: np.ndarray
    """Index of each pulse's record in the file of signals."""
    energy: np.ndarray | None
    """The factor by which the signals are to be divided."""
    temperature_c: np.ndarray | None
    timestamps_s: np.ndarray | None
    """Since 1 January 1970, by the local clock of the instrument."""
    position_m: np.ndarray | None
    notes: tuple[str, ...]


def pulses(header: Node) -> Pulses:
    """Return the pulses in frames of all wavelengths; those of a last, incomplete sweep are dropped, with a note.

    Wavelengths come in the order of ``WAVELENGTHS``. Several pulses in a row at one wavelength become several frames;
    a wavelength that the list names twice stays twice. Raises `ReadError` where the pulses come in another order.
    """
    wavelengths = _wavelengths(header.get("MEASUREMENT-DESC/WAVELENGTHS"))
    shells = header.some("ScanNode/ScanFrames", "DataModelScanFrame")
    frames = [shell.get("Frame") for shell in shells]
    shots = _shots(frames, wavelengths)
    per_sweep = shots * len(wavelengths)
    sweeps = len(shells) // per_sweep
    if not sweeps:
        raise header.get("ScanNode/ScanFrames").error(f"a sweep of {per_sweep} pulses", f"{len(shells)}")
    in_file = np.arange(sweeps * per_sweep).reshape(sweeps, len(wavelengths), shots)
    order = in_file.swapaxes(1, 2).reshape(-1, len(wavelengths))
    kept = frames[: order.size]
    notes = [_dropped(len(shells) - order.size, per_sweep), _repeated(shots)]

    def table(name: str, read: Callable[[Node], float | None]) -> np.ndarray | None:
        values = [read(frame) for frame in kept]
        known = [value for value in values if value is not None]
        if known and len(known) < len(values):
            notes.append(f"{name} is missing for {len(values) - len(known)} of {len(values)} pulses and left out.")
        return np.array(known)[order] if len(known) == len(values) else None

    return Pulses(
        wavelengths,
        _offsets(shells[: order.size])[order],
        table("POWER", _energy),
        table("TEMPERATURE", lambda frame: _optional(frame, "TEMPERATURE", "degrees Celsius")),
        table("timestamp", _time_s),
        table("Z-POS", lambda frame: None if (z := _optional(frame, "Z-POS", "mm")) is None else 1e-3 * z),
        tuple(filter(None, notes)),
    )


def _wavelengths(parent: Node) -> tuple[float, ...]:
    """Return the wavelengths in the order of their numbers, or of the file where they have none."""
    parent.get("WAVELENGTH")
    entries = [(entry.attribute("number"), entry.number("a wavelength in nm")) for entry in parent.all("WAVELENGTH")]
    if all(number and number.isdecimal() and len(number) < 10 for number, _ in entries):
        entries.sort(key=lambda entry: int(entry[0] or 0))
    return tuple(value for _, value in entries)


def _shots(frames: list[Node], wavelengths: tuple[float, ...]) -> int:
    """Return how many pulses in a row have one wavelength, or raise `ReadError` where there is no such rule."""
    nodes = [frame.get("WAVELENGTH") for frame in frames]
    found = np.array([node.number("a wavelength in nm") for node in nodes])
    changes = np.flatnonzero(found != found[0])
    for shots in (1, int(changes[0]) if len(changes) else len(found)):
        expected = np.array(wavelengths)[np.arange(len(found)) // shots % len(wavelengths)]
        wrong = np.flatnonzero(abs(found - expected) > 0.5)
        if not len(wrong):
            return shots
    first = wrong[0]
    raise nodes[first].error(f"{expected[first]:g} nm by the order in WAVELENGTHS", f"{found[first]:g}")


def _offsets(shells: list[Node]) -> np.ndarray:
    offsets = [shell.get("IDOffset").count("the index of a record", 0, MAX_OFFSET) for shell in shells]
    if len(set(offsets)) < len(offsets):
        twice = next(offset for offset, count in Counter(offsets).items() if count > 1)
        raise shells[offsets.index(twice)].get("IDOffset").error("a record for each pulse", f"{twice} more than once")
    return np.array(offsets)


def _optional(frame: Node, name: str, unit: str) -> float | None:
    node = frame.find(name)
    return None if node is None else node.number(f"a number in {unit}")


def _energy(frame: Node) -> float | None:
    power = _optional(frame, "POWER", "the unit of the correction factor")
    return _optional(frame, "OverallCorrectionFactor", "the unit of the factor") if power is None else power


def _time_s(frame: Node) -> float | None:
    ticks = frame.attribute("timestamp")
    if ticks is None:
        return None
    if not (ticks.isdecimal() and len(ticks) < 20):
        raise frame.error("a timestamp in units of 100 ns", repr(ticks[:40]))
    return (int(ticks) - UNIX_EPOCH_TICKS) * 1e-7


def _dropped(count: int, per_sweep: int) -> str:
    return f"The last sweep has {count} of {per_sweep} pulses and was left out." if count else ""


def _repeated(shots: int) -> str:
    return f"{shots} pulses in a row at each wavelength were taken as {shots} frames." if shots > 1 else ""
