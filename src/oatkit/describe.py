"""Plugins and scans described in words, from their own declarations."""

import inspect
from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.api import Plugin
from oatkit.data import Scan
from oatkit.focus import Focus
from oatkit.parameters import Parameters, bounds_of, expected


@dataclass(frozen=True)
class ParameterRow:
    """One parameter of a plugin."""

    name: str
    takes: str
    """Type, range and unit in words."""
    unit: str
    default: str
    """As a pipeline file writes it."""
    meaning: str


def parameter_rows(cls: type[Parameters]) -> list[ParameterRow]:
    """Return the parameters of a plugin class in the order of their declaration."""
    return [
        ParameterRow(name, expected(f), bounds_of(f).unit, _default(f.default), f.description or "")
        for name, f in cls.model_fields.items()
    ]


def plugin_text(cls: type[Plugin], origin: str) -> str:
    """Return kind, name, docstring and a paragraph for each parameter of a plugin."""
    lines = [f"{cls.kind.replace('_', ' ')} {cls.name}   ({origin})", "", inspect.cleandoc(cls.__doc__ or ""), ""]
    rows = parameter_rows(cls)
    lines.append("Parameters:" if rows else "It has no parameters.")
    for row in rows:
        lines += [f"  {row.name} = {row.default}", f"      {row.meaning}", f"      takes {row.takes}"]
    return "\n".join(lines)


def scan_table(scan: Scan) -> dict[str, Any]:
    """Return what is known of a scan as plain values, for `info` and its JSON."""
    geometry = scan.geometry
    response = geometry.impulse_response
    return {
        "name": scan.name,
        "reader": scan.reader,
        "frames": scan.frames,
        "wavelengths_nm": list(scan.wavelengths_nm),
        "detectors": geometry.detectors.count,
        "samples": geometry.n_samples,
        "sampling_rate_hz": geometry.sampling_rate_hz,
        "start_time_s": geometry.start_time_s,
        "speed_of_sound_m_s": geometry.speed_of_sound_m_s,
        "speed_of_sound_source": scan.speed_of_sound_source,
        "impulse_response_samples": 0 if response is None else len(response),
        "temperature_c": _mean(scan.temperature_c),
        "dtype": str(scan.signals.dtype),
        "fingerprint": scan.fingerprint,
        "notes": list(scan.notes),
    }


def _mean(values: np.ndarray | None) -> float | None:
    """Return the mean of what is known, None where nothing is."""
    known = np.array([]) if values is None else values[np.isfinite(values)]
    return float(np.mean(known)) if known.size else None


def scan_text(scan: Scan) -> str:
    """Return what is known of a scan as lines for a reader's eyes."""
    table = scan_table(scan)
    temperature = table["temperature_c"]
    rows = {
        "scan": f"{table['name']} (reader {table['reader']})",
        "frames": table["frames"],
        "wavelengths": ", ".join(f"{w:g}" for w in table["wavelengths_nm"]) + " nm",
        "detectors": table["detectors"],
        "samples": f"{table['samples']} at {table['sampling_rate_hz'] / 1e6:g} MHz, {table['dtype']}",
        "speed of sound": f"{table['speed_of_sound_m_s']:.1f} m/s ({table['speed_of_sound_source']})",
        "temperature": "unknown" if temperature is None else f"{temperature:.2f} degrees Celsius",
        "impulse response": f"{table['impulse_response_samples']} samples"
        if table["impulse_response_samples"]
        else "none",
    }
    lines = [f"{name:<18}{value}" for name, value in rows.items()]
    return "\n".join([*lines, *(f"note: {note}" for note in table["notes"])])


def focus_text(focus: Focus) -> str:
    """Return a speed of sound by focus as lines: the pick, what the scan says, what the other metrics pick."""
    rows = [
        ("speed of sound", f"{focus.speed_m_s:.1f} m/s by focus ({focus.metric})"),
        ("the scan says", f"{focus.header_m_s:.1f} m/s ({focus.header_source})"),
        ("tried", f"{len(focus.speeds_m_s)} speeds, {focus.speeds_m_s[0]:.0f} .. {focus.speeds_m_s[-1]:.0f} m/s"),
        *((name, f"{pick:.1f} m/s") for name, pick in focus.picks.items() if name != focus.metric),
    ]
    lines = [f"{name:<20}{value}" for name, value in rows]
    return "\n".join([*lines, *(f"note: {note}" for note in focus.notes)])


def _default(value: Any) -> str:
    if isinstance(value, Parameters):
        return f'"{value.name}"' if value.name else "{}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return f"[{', '.join(_default(v) for v in value)}]"
    return f'"{value}"' if isinstance(value, str) else "not set" if value is None else str(value)
