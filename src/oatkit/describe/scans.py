"""Scans, and what lies beside them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.api import Region
from oatkit.data import Image, Scan
from oatkit.errors import OatkitError
from oatkit.reading import read_images, read_regions
from oatkit.slips import scan_notes
from oatkit.wavelengths import wavelength_notes

MOST_LINES = 20
"""How many images, and how many regions, are listed one by one for a reader's eyes."""


@dataclass(frozen=True)
class Beside:
    """What a file holds beside its scan."""

    images: Mapping[str, Sequence[Image]] = field(default_factory=dict)
    """Finished images by name, one for each frame."""
    regions: tuple[Region, ...] = ()
    notes: tuple[str, ...] = ()
    """Why some of it cannot be had."""


def look_beside(path: Path) -> Beside:
    """Return what a file holds beside its scan; what cannot be read hides neither the scan nor the rest."""
    notes: list[str] = []
    images: Mapping[str, Sequence[Image]] = {}
    regions: tuple[Region, ...] = ()
    try:
        images = read_images(path)
    except OatkitError as error:
        notes.append(f"Images: {error}")
    try:
        regions = read_regions(path)
    except OatkitError as error:
        notes.append(f"Regions: {error}")
    return Beside(images, regions, tuple(notes))


def scan_table(scan: Scan, beside: Beside | None = None) -> dict[str, Any]:
    """Return what is known of a scan and what lies beside it as plain values, for `info` and its JSON."""
    beside = beside or Beside()
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
        "images": [{"name": name, "frames": len(stored)} for name, stored in beside.images.items()],
        "regions": [region.name for region in beside.regions],
        "notes": [*scan.notes, *wavelength_notes(scan.wavelengths_nm), *scan_notes(scan), *beside.notes],
    }


def _mean(values: np.ndarray | None) -> float | None:
    """Return the mean of what is known, None where nothing is."""
    known = np.array([]) if values is None else values[np.isfinite(values)]
    return float(np.mean(known)) if known.size else None


def scan_text(scan: Scan, beside: Beside | None = None) -> str:
    """Return what is known of a scan and what lies beside it as lines for a reader's eyes."""
    table = scan_table(scan, beside)
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
    images = [f"{image['name']} ({_counted(image['frames'], 'frame')})" for image in table["images"]]
    lines = [f"{name:<18}{value}" for name, value in (*rows.items(), *_few("image", images))]
    lines += [f"{name:<18}{value}" for name, value in _few("region", table["regions"])]
    return "\n".join([*lines, *(f"note: {note}" for note in table["notes"])])


def _counted(count: int, noun: str) -> str:
    """Return ``1 frame`` or ``3 frames``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _few(what: str, values: list[str]) -> list[tuple[str, str]]:
    """Return a row for each value, and one for all those beyond `MOST_LINES`."""
    rows = [(what, value) for value in values[:MOST_LINES]]
    return [*rows, (what, f"... and {len(values) - MOST_LINES} more")] if len(values) > MOST_LINES else rows
