"""The tables of the TOML file that describes a scan of plain arrays."""

import tomllib
from pathlib import Path
from typing import Any, ClassVar, Literal

import pydantic

from oatkit.builtin.readers.array_signals import AXES
from oatkit.errors import ReadError
from oatkit.hostile import printable, read_at_most
from oatkit.parameters import Parameters, param, problems

MAX_BYTES = 2**20
MAX_DETECTORS = 65_536


class SignalsTable(Parameters):
    """The table ``[signals]``: the file of signals, how its axes are ordered, and when the samples were taken."""

    file: str = param(..., "the .npy or .tif file of signals, in the folder of the description")
    axes: tuple[str, ...] = param(..., f"names of the axes of the file in its order, from {', '.join(AXES)}")
    wavelengths_nm: tuple[float, ...] = param(
        ..., "one for each index of the wavelength axis", unit="nm", at_least=100, at_most=20_000
    )
    sampling_rate_mhz: float = param(..., "samples in a microsecond", unit="MHz", at_least=0.1, at_most=10_000)
    start_time_us: float = param(
        0.0, "time of the first sample after the light pulse", unit="us", at_least=-10_000, at_most=10_000
    )
    speed_of_sound_m_s: float | None = param(
        None, "speed of sound in the coupling medium", unit="m/s", at_least=300, at_most=7000
    )


class DetectorsTable(Parameters):
    """The table ``[detectors]``: the positions of an array of any form in a plane."""

    positions: str = param(..., "file .npy, .csv or .mat (version 7.3) of two or three coordinates for each detector")
    dataset: str = param("transducerPos", "name of the array in a .mat file")
    axes: tuple[str, ...] | None = param(None, 'names of the coordinates in their order: "x", "y" and, of three, "z"')
    unit: Literal["m", "mm"] = param("m", "unit of the coordinates")


class ArcTable(Parameters):
    """The table ``[arc]``: detectors on an arc about the origin, in place of ``[detectors]``.

    The arc is cut into equal pieces with a detector in the middle of each, so that the first and the last are
    ``coverage_degrees * (count - 1) / count`` apart. Unrotated, it is open at the bottom.
    """

    radius_mm: float = param(..., "radius of the arc", unit="mm", at_least=1, at_most=1000)
    coverage_degrees: float = param(..., "angle that the arc covers", unit="degrees", above=0, at_most=360)
    count: int = param(..., "number of detectors", at_least=1, at_most=MAX_DETECTORS)
    rotation_degrees: float = param(
        0.0, "anticlockwise turn of the arc about the origin", unit="degrees", at_least=-360, at_most=360
    )
    order: Literal["anticlockwise", "clockwise"] = param("anticlockwise", "in which sense the detectors are counted")


class ResponseTable(Parameters):
    """The table ``[impulse_response]``: what a detector and its electronics make of an ideal pulse."""

    file: str = param(..., "file .npy, .csv or .mat (version 7.3) of one response, at the sampling rate of the signals")
    dataset: str = param("EIR", "name of the array in a .mat file")
    centre: int | None = param(None, "index of time zero, counted from 0; the middle, n // 2, unless given", at_least=0)


class PulsesTable(Parameters):
    """The table ``[pulses]``: files ``.npy``, ``.csv`` or ``.mat`` of one number for each frame and wavelength."""

    pulse_energy: str | None = param(None, "relative energy, by which signals are to be divided")
    temperature_c: str | None = param(None, "temperature of the coupling medium, degrees Celsius")
    timestamps_s: str | None = param(None, "time of each pulse, s")
    position_m: str | None = param(None, "place along the scan axis, m")
    dataset: str = param("data", "name of the array in .mat files")


class Description(Parameters):
    """All that the file says."""

    key_word: ClassVar[str] = "table"
    title: ClassVar[str] = "the description of a scan"

    version: Literal[1] = param(1, "version of the file format")
    signals: SignalsTable = param(..., "the file of signals")
    detectors: DetectorsTable | None = param(None, "where the detectors are")
    arc: ArcTable | None = param(None, "the arc that they lie on")
    impulse_response: ResponseTable | None = param(None, "their impulse response")
    pulses: PulsesTable = param(PulsesTable(), "what was measured with each pulse")


def read_description(path: Path) -> Description:
    """Return the description in a file. Raises `ReadError` with all that is wrong in it, one sentence a line."""
    try:
        table = tomllib.loads(read_at_most(path, MAX_BYTES).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # beyond syntax: numbers too long, nesting too deep, no UTF-8
        raise ReadError(f"{path}: not valid TOML: {printable(str(error), 200)}") from None
    try:
        description = Description.model_validate(table)
    except pydantic.ValidationError as error:
        lines = [f"{path}{_where(key, table)}: {text}" for key, text in problems(error)]
        raise ReadError("\n".join(lines)) from None
    if wrong := [*_wrong_axes(description.signals), *_wrong_detectors(description)]:
        raise ReadError("\n".join(f"{path} {line}" for line in wrong))
    return description


def _wrong_axes(signals: SignalsTable) -> list[str]:
    where = "[signals].axes"
    wrong = [
        f"{where}: '{printable(axis, 40)}' is no axis; they are {', '.join(AXES)}"
        for axis in signals.axes
        if axis not in AXES
    ]
    if not signals.axes or len(set(signals.axes)) < len(signals.axes):
        wrong.append(f"{where}: must name each axis of the file once, got {', '.join(signals.axes)[:60] or 'none'}")
    return wrong


def _wrong_detectors(description: Description) -> list[str]:
    given = (description.detectors is not None) + (description.arc is not None)
    return (
        [] if given == 1 else [f"must have one of the tables [detectors] and [arc], got {'both' if given else 'none'}"]
    )


def _where(path: str, table: dict[str, Any]) -> str:
    """Write ``.signals.axes`` as `` [signals].axes``, and a key without a table as it is."""
    head, *rest = path.split(".")[1:] or [""]
    named = f" [{head}]" if rest or isinstance(table.get(head), dict) else f" {head}"
    return named + "".join(f".{key}" for key in rest) if head else ""
