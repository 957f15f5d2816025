"""What an IPASC file says of each pulse of light."""

from collections.abc import Callable
from typing import Any

import numpy as np

from oatkit.builtin.readers.ipasc_axes import by_pulse
from oatkit.builtin.readers.ipasc_fields import Fields
from oatkit.ipasc import ZERO_CELSIUS_K

Found = tuple[np.ndarray | None, str]
"""Values of shape (frame, wavelength), or None, and a note, or nothing."""


def read_pulses(fields: Fields, shape: tuple[int, ...], across: int) -> tuple[dict[str, Any], list[str]]:
    """Return what the file says of each pulse, by the name of the scan's field, and notes on what was left out.

    `shape` is (frame, wavelength), `across` the axis across the image plane.
    """
    frames, wavelengths = shape
    found = {
        "pulse_energy": _pulse_energy(fields, (frames, wavelengths)),
        # Rounding takes away what the sum in K has added: 33.27 C, not 33.27000000000004.
        "temperature_c": _values(
            fields, "temperature_control", (frames, wavelengths), lambda k: np.round(k - ZERO_CELSIUS_K, 11)
        ),
        "timestamps_s": _values(fields, "measurement_timestamps", (frames, wavelengths)),
        "position_m": _position_m(fields, (frames, wavelengths), across),
    }
    return {name: values for name, (values, _) in found.items()}, [note for _, note in found.values() if note]


def _pulse_energy(fields: Fields, shape: tuple[int, int]) -> Found:
    """Return the energies, J or relative; none where one of them is no positive number."""
    values, note = _values(fields, "pulse_energy", shape)
    if values is not None and not (np.isfinite(values) & (values > 0)).all():
        return None, "The pulse energies in the file are not all positive numbers; they are left out."
    return values, note


def _position_m(fields: Fields, shape: tuple[int, int], across: int) -> Found:
    """Return the positions along the axis across the image plane, out of poses (x, y, z and three angles)."""
    if fields.has("oatkit_position_m"):
        return _values(fields, "oatkit_position_m", shape)
    poses = fields.array("measurement_spatial_poses")
    if poses is None:
        return None, ""
    poses = poses.reshape(1, -1) if poses.ndim == 1 else poses
    if poses.ndim != 2 or poses.shape[1] not in (3, 6):
        return None, f"The poses of the array, of shape {poses.shape}, are no (x, y, z); they are left out."
    # A measurement, of which each has a pose, is what the layout calls a frame.
    of_frames = poses[:, [across]].repeat(shape[1], axis=1)
    values = of_frames if len(poses) == shape[0] else by_pulse(poses[:, across], *shape)
    if values is None:
        return None, _unclear("measurement_spatial_poses", poses, shape)
    moved = np.delete(poses, across, axis=1).any()
    return (
        values,
        "The poses of the array move or turn it in the image plane, too; that is not applied." if moved else "",
    )


def _values(
    fields: Fields, name: str, shape: tuple[int, int], convert: Callable[[np.ndarray], np.ndarray] = np.asarray
) -> Found:
    values = fields.array(name)
    if values is None:
        return None, ""
    taken = by_pulse(values, *shape)
    return (None, _unclear(name, values, shape)) if taken is None else (convert(taken.astype(float)), "")


def _unclear(name: str, values: np.ndarray, shape: tuple[int, int]) -> str:
    frames, wavelengths = shape
    return (
        f"It is not clear to which of {frames} frames and {wavelengths} wavelengths the values of {name}, of shape "
        f"{values.shape}, belong; they are left out."
    )
