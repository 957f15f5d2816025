"""The HDF5 file of the International Photoacoustic Standardisation Consortium (IPASC): its layout, and its writer.

The layout is the one of ``pacfish`` 0.4.4, the consortium's own package: three roots, no attributes, SI units,
wavelengths in metres::

    /binary_time_series_data    (detector, sample, wavelength, frame), any real type
    /meta_data/                 ad_sampling_rate, acquisition_wavelengths, speed_of_sound, ...
    /meta_data_device/          general/, illuminators/, detectors/<number>/detector_position (x, y, z)

What a scan holds beyond that goes into fields ``/meta_data/oatkit_...``, which other programs pass over. They are no
group of their own, since the consortium's MATLAB reader takes no field of a group that has groups in it.
"""

from math import prod
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from oatkit.atomic import check_output, check_space, new_file
from oatkit.data import Scan
from oatkit.errors import ValidationError
from oatkit.hostile import MAX_CHUNK_BYTES, MAX_TEXT_BYTES

SIGNALS, ACQUISITION, DEVICE = "binary_time_series_data", "meta_data", "meta_data_device"
ROOTS = frozenset({SIGNALS, ACQUISITION, DEVICE})
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
LONGEST_USER_BLOCK = 2048
"""How far into a file `is_ipasc_file` looks for the signature."""
ZERO_CELSIUS_K = 273.15
TEXTS = ("name", "speed_of_sound_source", "notes")
"""Fields of a scan that are stored as texts, each note on a line."""
MAX_DETECTORS = 65_536
"""Limit for what is read, and so for what is written."""
BYTES_PER_DETECTOR = 4096
"""Upper bound for what a detector's group takes in the file."""


def is_ipasc_file(path: Path) -> bool:
    """Say whether a file is HDF5 with the three roots of the layout and no other; never raises."""
    try:
        if not path.is_file():  # opening a pipe would block
            return False
        with open(path, "rb") as head:
            if HDF5_SIGNATURE not in head.read(LONGEST_USER_BLOCK + len(HDF5_SIGNATURE)):
                return False
        import h5py

        with h5py.File(path, "r") as file:
            return len(file) == len(ROOTS) and set(file) == ROOTS
    except Exception:  # whatever the library finds broken
        return False


def write_ipasc(scan: Scan, path: Path | str, overwrite: bool = False) -> tuple[str, ...]:
    """Write a scan, frame by frame, and say in sentences what other programs will not find in the file.

    The file stands under its name only when it is complete. Raises `ResultError` where it cannot be written, or exists
    and `overwrite` is not asked for, and `ValidationError` where a record of one detector exceeds 64 MiB, or there are
    more than `MAX_DETECTORS`.
    """
    path = Path(path)
    if scan.geometry.detectors.count > MAX_DETECTORS:
        raise ValidationError(f"an IPASC file takes {MAX_DETECTORS} detectors, got {scan.geometry.detectors.count}")
    check_output(path, [scan.source], overwrite)
    check_space(path, _size(scan))  # HDF5 crashes the interpreter on a full disk
    with new_file(path, overwrite) as hidden:
        _write(hidden, scan)
    return _losses(scan)


def _size(scan: Scan) -> int:
    """Return an upper bound for the size of the file, bytes."""
    pulses = scan.frames * len(scan.wavelengths_nm)
    arrays = prod(scan.signals.shape) * scan.signals.dtype.itemsize + scan.valid.nbytes
    response = scan.geometry.impulse_response
    arrays += 0 if response is None else response.nbytes
    return arrays + 1024 * pulses + BYTES_PER_DETECTOR * scan.geometry.detectors.count + 2**20


def _write(path: Path, scan: Scan) -> None:
    import h5py

    # The oldest format that protects its own tables by checksums, that of the chunks included.
    with h5py.File(path, "x", libver=("v110", "v110")) as file:
        _write_signals(file, scan)
        for name, value in (_acquisition(scan) | _additions(scan)).items():
            file[f"{ACQUISITION}/{name}"] = value
        for name, value in _general(scan).items():
            file[f"{DEVICE}/general/{name}"] = value
        file.create_group(f"{DEVICE}/illuminators")
        for number, (y, x) in enumerate(scan.geometry.detectors.positions_m):
            file[f"{DEVICE}/detectors/{number:010}/detector_position"] = np.array([x, y, 0.0])


def _write_signals(file: Any, scan: Scan) -> None:
    frames, wavelengths, detectors, samples = scan.signals.shape
    dtype = scan.signals.dtype.newbyteorder("<")
    # In one piece, a frame would lie scattered over the whole of the dataset.
    chunks = (_detectors_per_chunk(detectors, samples * dtype.itemsize), samples, 1, 1)
    shape = (detectors, samples, wavelengths, frames)
    signals = file.create_dataset(SIGNALS, shape, dtype, chunks=chunks, fletcher32=True)
    for frame in range(frames):
        for wavelength, record in enumerate(scan.signals[frame]):
            signals[:, :, wavelength, frame] = record


def _detectors_per_chunk(detectors: int, record_bytes: int) -> int:
    if record_bytes > MAX_CHUNK_BYTES:
        raise ValidationError(
            f"an IPASC file holds records of up to {MAX_CHUNK_BYTES} bytes a detector, got {record_bytes}"
        )
    return min(detectors, MAX_CHUNK_BYTES // record_bytes)


def _acquisition(scan: Scan) -> dict[str, Any]:
    """Return the fields of ``/meta_data`` that IPASC defines."""
    frames, wavelengths, detectors, samples = scan.signals.shape
    fields = {
        "uuid": np.bytes_(str(uuid5(NAMESPACE_URL, f"oatkit:{scan.fingerprint}")).encode()),
        "encoding": np.bytes_(b"raw"),
        "compression": np.bytes_(b"none"),
        "data_type": np.bytes_(scan.signals.dtype.name.encode()),
        "dimensionality": np.bytes_(b"time"),
        "sizes": np.array([detectors, samples, wavelengths, frames]),
        "ad_sampling_rate": scan.geometry.sampling_rate_hz,
        "acquisition_wavelengths": np.array(scan.wavelengths_nm) * 1e-9,
        "speed_of_sound": scan.geometry.speed_of_sound_m_s,
        "pulse_energy": _by_pulse(scan.pulse_energy),
        "temperature_control": _by_pulse(scan.temperature_c, ZERO_CELSIUS_K),
        "measurement_timestamps": _by_pulse(scan.timestamps_s),
        "measurement_spatial_poses": _poses(scan),
    }
    return {name: value for name, value in fields.items() if value is not None}


def _by_pulse(values: np.ndarray | None, offset: float = 0.0) -> np.ndarray | None:
    """Return values (frame, wavelength) in the order of the signals' axes; flat where one of the two has length one."""
    if values is None:
        return None
    return (values.T if min(values.shape) > 1 else values.ravel()) + offset


def _poses(scan: Scan) -> np.ndarray | None:
    """Return the pose (x, y, z and three angles) of each frame, or None where poses cannot say it."""
    if scan.position_m is None or not _poses_suffice(scan.position_m):
        return None
    return np.pad(scan.position_m[:, :1], ((0, 0), (2, 3)))


def _poses_suffice(position_m: np.ndarray) -> bool:
    """Say whether a pose for each of several frames says it all."""
    # pacfish squeezes a lone pose to one axis when it loads it, and then finds it inconsistent.
    return len(position_m) > 1 and not np.ptp(position_m, axis=1).any()


def _additions(scan: Scan) -> dict[str, Any]:
    """Return the fields that IPASC does not define, by their names in the file."""
    geometry = scan.geometry
    fields: dict[str, Any] = {"start_time_s": geometry.start_time_s, "impulse_response": geometry.impulse_response}
    fields["valid"] = None if scan.valid.all() else scan.valid.transpose(2, 1, 0).astype("u1")
    if scan.position_m is not None and not _poses_suffice(scan.position_m):
        fields["position_m"] = scan.position_m.T
    fields |= {name: np.bytes_(text.encode()) for name, text in _texts(scan).items() if _fits(text)}
    return {f"oatkit_{name}": value for name, value in fields.items() if value is not None}


def _texts(scan: Scan) -> dict[str, str]:
    lines = {"name": [scan.name], "speed_of_sound_source": [scan.speed_of_sound_source], "notes": scan.notes}
    return {name: text for name in TEXTS if (text := "\n".join(" ".join(line.split()) for line in lines[name]))}


def _fits(text: str) -> bool:
    return len(text.encode()) <= MAX_TEXT_BYTES


def _general(scan: Scan) -> dict[str, Any]:
    """Return the fields of ``/meta_data_device/general``."""
    y, x = scan.geometry.detectors.positions_m.T
    return {
        "unique_identifier": np.bytes_(b"unknown"),
        "field_of_view": np.array([x.min(), x.max(), y.min(), y.max(), 0.0, 0.0]),
        "num_detectors": len(x),
        "num_illuminators": 0,
    }


def _losses(scan: Scan) -> tuple[str, ...]:
    """Say what IPASC has no field for, and what was written for what a scan does not hold."""
    kept = "IPASC has no field for {}: kept in /meta_data/{}, which other programs do not read."
    words = {
        "start_time_s": "the time of the first sample",
        "impulse_response": "an impulse response with its phase",
        "valid": "channels that are not to be trusted",
        "position_m": "the position of each pulse",
    }
    stored = _additions(scan)
    if not scan.geometry.start_time_s:
        del stored["oatkit_start_time_s"]
    losses = [kept.format(text, f"oatkit_{name}") for name, text in words.items() if f"oatkit_{name}" in stored]
    losses += [
        f"Too long to be kept: the {name} of the scan." for name, text in _texts(scan).items() if not _fits(text)
    ]
    if scan.pulse_energy is not None:
        losses.append("IPASC expects pulse energies in J; those of a scan are relative, and written as they are.")
    losses.append(
        "A scan knows neither device, illumination nor field of view: written are 'unknown', no illuminators, and the "
        "box around the detectors."
    )
    return tuple(losses)
