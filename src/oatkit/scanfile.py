"""The scan file of oatkit: one HDF5 file that holds a `Scan` and, where it was simulated, the images it came from.

The first 512 bytes are the user block, which begins with `MARKER` and the version. Then comes HDF5 in the format of
its version 1.10, the oldest that protects its own tables by checksums, with these datasets, all chunked with a
fletcher32 checksum, uncompressed, little-endian::

    /about             JSON in UTF-8, one fixed-length string: name, source, reader, speed_of_sound_source, notes,
                       sampling_rate_hz, start_time_s, speed_of_sound_m_s, wavelengths_nm, under arrays the names of
                       the optional datasets that are there, and, with a truth, under
                       truth its quantity, unit, pixel_size_m, centre_m and wavelengths_nm; those of further truths
                       under truth_images, by name
    /signals           (frame, wavelength, detector, sample), any real type; one chunk holds one pulse
    /detectors_m       (detector, 2), each (y, x)
    /valid             (frame, wavelength, detector), 0 or 1
    /impulse_response  (n,), time zero at n // 2                            optional
    /pulse_energy      (frame, wavelength)                                  optional, and so the next three
    /temperature_c     /timestamps_s     /position_m
    /truth             (wavelength, y, x), row 0 at the bottom              optional
    /truth_images/NAME likewise, for each further truth; its quantity is its name
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.atomic import check_output, check_space, new_file
from oatkit.data import Grid, Image, Scan
from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import MAX_CHUNK_BYTES, hdf5_dataset, open_hdf5, printable

MARKER = b"oatkit scan "
VERSION = 1
USER_BLOCK = 512
PER_PULSE = ("pulse_energy", "temperature_c", "timestamps_s", "position_m")
"""Fields of a scan with one number for each frame and wavelength, and the datasets of the same names."""
MAX_ABOUT_BYTES = 4 * 2**20
MAX_ARRAY_BYTES = 512 * 2**20
"""Limit for every dataset but the signals, which are read in parts, and for all truths together."""
FIRST, FURTHER = "truth", "truth_images"
"""Where the image that a scan was simulated from is stored, and where other true images are."""


def write_scan(
    scan: Scan, path: Path | str, truth: Image | Sequence[Image] | None = None, overwrite: bool = False
) -> None:
    """Write a scan, frame by frame, with the image that it was simulated from; of several, the first is that one.

    The file stands under its name only when it is complete. Raises `ValidationError` for two truths of one quantity,
    and `ResultError` where the file cannot be written, or exists and `overwrite` is not asked for.
    """
    path = Path(path)
    truths = _named((truth,) if isinstance(truth, Image) else truth or ())
    check_output(path, [scan.source], overwrite)
    check_space(path, _size(scan, truths))  # HDF5 crashes the interpreter on a full disk
    with new_file(path, overwrite) as hidden:
        _write(hidden, scan, truths)


def read_truth(path: Path | str) -> Image | None:
    """Return the image that a scan was simulated from, or None where the file has none. Raises `ReadError`."""
    return next(iter(read_truths(path).values()), None)


def read_truths(path: Path | str) -> dict[str, Image]:
    """Return all images that are known to be true of a scan, by quantity; first the one that it was simulated from.

    Empty where the file has none. Raises `ReadError`, also where they hold more than `MAX_ARRAY_BYTES` together.
    """
    path = Path(path)
    with open_hdf5(path) as file:
        known = dict(_descriptions(read_about(file, path), path))
        left, values = MAX_ARRAY_BYTES, {}
        for name in known:
            dataset = hdf5_dataset(file, name, "f", 3, left)
            left -= dataset.nbytes
            values[name] = dataset[()]
    truths = {image.quantity: image for image in (_image(path, known[name], values[name]) for name in known)}
    if len(truths) < len(known):
        raise ReadError(f"{path} 'about': expected one truth for each quantity, found {len(known)} of {list(truths)}")
    return truths


def _named(truths: Sequence[Image]) -> dict[str, Image]:
    """Return images by the name of the dataset that holds them."""
    quantities = [image.quantity for image in truths]
    wrong = [q for q in quantities if quantities.count(q) > 1 or "/" in q or not q]
    if wrong:
        raise ValidationError(f"truths: expected one image for each quantity, got {', '.join(map(repr, wrong))}")
    return {f"{FURTHER}/{image.quantity}" if i else FIRST: image for i, image in enumerate(truths)}


def _descriptions(about: Mapping[str, Any], path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the name of each dataset with a truth, and what is known of it."""
    if FIRST in about:
        yield FIRST, about[FIRST]
    further = about.get(FURTHER, {})
    if not isinstance(further, dict):
        raise ReadError(f"{path} 'about': expected a table '{FURTHER}', found a {type(further).__name__}")
    yield from ((f"{FURTHER}/{name}", known) for name, known in further.items())


def _image(path: Path, known: Any, values: np.ndarray) -> Image:
    try:
        grid = Grid(values.shape[1:], known["pixel_size_m"], tuple(known["centre_m"]))
        quantity, unit = (printable(known[key]) for key in ("quantity", "unit"))
        return Image(values, quantity, unit, grid, tuple(known["wavelengths_nm"]))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ReadError(f"{path} 'about': the description of a truth is unusable ({error!r})") from None


def read_about(file: Any, path: Path) -> dict[str, Any]:
    """Return the JSON of ``/about``, after a look at marker and version. Raises `ReadError`."""
    check_marker(path)
    stored = hdf5_dataset(file, "about", "S", 1, MAX_ABOUT_BYTES)
    if stored.shape != (1,):
        raise ReadError(f"{path} 'about': expected one text, found the shape {stored.shape}")
    try:
        about = json.loads(stored[0].decode(), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ReadError(f"{path} 'about': expected JSON in UTF-8, found an error: {error}") from None
    if not isinstance(about, dict):
        raise ReadError(f"{path} 'about': expected a JSON object, found a {type(about).__name__}")
    return about


def is_scan_file(path: Path) -> bool:
    """Say whether a file begins as a scan file does; never raises."""
    try:
        if not path.is_file():  # opening a pipe would block
            return False
        with open(path, "rb") as file:
            return file.read(len(MARKER)) == MARKER
    except (OSError, ValueError):
        return False


def check_marker(path: Path) -> None:
    """Raise `ReadError` unless the file begins with the marker and a version that this oatkit knows."""
    with open(path, "rb") as file:
        head = file.read(64)
    version = head[len(MARKER) :].split(b"\n")[0]
    if not head.startswith(MARKER):
        raise ReadError(f"{path}: expected a scan file that begins with {MARKER!r}, found {head[:16]!r}")
    if version != b"%d" % VERSION:
        raise ReadError(
            f"{path}: expected version {VERSION} of the scan file, found {version.decode('ascii', 'replace')!r}"
        )


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is no number")


def _size(scan: Scan, truths: Mapping[str, Image]) -> int:
    """Return an upper bound for the size of the file, bytes."""
    pulses = scan.frames * len(scan.wavelengths_nm)
    arrays = prod(scan.signals.shape) * scan.signals.dtype.itemsize + scan.valid.nbytes
    return arrays + sum(image.values.nbytes for image in truths.values()) + 1024 * pulses + 4 * 2**20


def _write(path: Path, scan: Scan, truths: Mapping[str, Image]) -> None:
    import h5py

    with h5py.File(path, "x", libver=("v110", "v110"), userblock_size=USER_BLOCK) as file:
        _write_signals(file, scan)
        for name, values in _arrays(scan, truths).items():
            file.create_dataset(name, data=values, chunks=_chunk(values.shape, values.dtype), fletcher32=True)
    with open(path, "r+b") as head:
        head.write(MARKER + b"%d\n" % VERSION)


def _write_signals(file: Any, scan: Scan) -> None:
    shape, dtype = scan.signals.shape, scan.signals.dtype.newbyteorder("<")
    chunks = (1, 1, *_chunk(shape[2:], dtype))
    signals = file.create_dataset("signals", shape, dtype, chunks=chunks, fletcher32=True)
    for frame in range(scan.frames):
        signals[frame] = scan.signals[frame]


def _arrays(scan: Scan, truths: Mapping[str, Image]) -> dict[str, np.ndarray]:
    """Return what is stored beside the signals, by the name of its dataset."""
    arrays = {name: getattr(scan, name) for name in PER_PULSE}
    arrays |= {"detectors_m": scan.geometry.detectors.positions_m, "impulse_response": scan.geometry.impulse_response}
    arrays |= {"valid": scan.valid.astype("u1"), "about": np.array([json.dumps(_about(scan, truths)).encode()])}
    arrays |= {name: image.values for name, image in truths.items()}
    return {name: values for name, values in arrays.items() if values is not None}


def _about(scan: Scan, truths: Mapping[str, Image]) -> dict[str, Any]:
    texts = ("name", "source", "reader", "speed_of_sound_source", "notes", "wavelengths_nm")
    numbers = ("sampling_rate_hz", "start_time_s", "speed_of_sound_m_s")
    about = {k: getattr(scan, k) for k in texts} | {k: getattr(scan.geometry, k) for k in numbers}
    described = {name: _description(image) for name, image in truths.items()}
    further = {name.removeprefix(f"{FURTHER}/"): described[name] for name in described if name != FIRST}
    about["arrays"] = [name for name in PER_PULSE if getattr(scan, name) is not None]
    about["arrays"] += [] if scan.geometry.impulse_response is None else ["impulse_response"]
    return about | {k: v for k, v in {FIRST: described.get(FIRST), FURTHER: further}.items() if v}


def _description(image: Image) -> dict[str, Any]:
    known = {k: getattr(image, k) for k in ("quantity", "unit", "wavelengths_nm")}
    return known | {k: getattr(image.grid, k) for k in ("pixel_size_m", "centre_m")}


def _chunk(shape: tuple[int, ...], dtype: np.dtype) -> tuple[int, ...]:
    """Return the chunk of an array: all of it, or as many of its first rows as the reader's limit allows."""
    row = prod(shape[1:]) * dtype.itemsize
    if row > MAX_CHUNK_BYTES:
        raise ValidationError(f"a scan file holds rows of up to {MAX_CHUNK_BYTES} bytes, got {row}")
    return (min(shape[0], MAX_CHUNK_BYTES // row), *shape[1:])
