"""What a reader promises: it claims its own files only, and reads them whole or says why not."""

import pickle
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from oatkit.api import Image, Reader, ReadError, Region, Scan
from oatkit.errors import OatkitError

FOREIGN: Mapping[str, bytes] = {
    "empty.dat": b"",
    "noise.bin": np.random.default_rng(0).bytes(4096),
    "letter.txt": b"Dear colleague,\n\nplease find enclosed the data.\n",
    "picture.png": b"\x89PNG\r\n\x1a\n" + bytes(200),
    "archive.zip": b"PK\x03\x04" + bytes(200),
}
"""Files that hold no scan."""


@dataclass(frozen=True)
class Sampled:
    """A reader, and a file of its own where there is one."""

    reader: Reader
    sample: Path | None = None


def foreign(plugin: Sampled) -> Iterator[str]:
    """`can_read` never raises, whatever the path is, and claims no file that holds no scan; `read` refuses it."""
    reader = plugin.reader
    with tempfile.TemporaryDirectory() as folder:
        for name, content in FOREIGN.items():
            path = Path(folder) / name
            path.write_bytes(content)
            if reader.can_read(path):
                yield f"it claims '{name}', which holds no scan"
            try:
                reader.read(path)
                yield f"it reads '{name}', which holds no scan"
            except ReadError:
                pass
        odd = (Path(folder), Path(folder) / "missing.h5", Path("x" * 5000), Path("a\0b"), Path())
        for path in odd:
            if reader.can_read(path):
                yield f"it claims {str(path)[:40]!r}, which is no scan"


def sample(plugin: Sampled) -> Iterator[str]:
    """It claims its sample and reads the same scan each time, with what every step after it needs."""
    if plugin.sample is None:
        return
    reader, path = plugin.reader, plugin.sample
    if not reader.can_read(path):
        yield f"it does not claim its own sample {path.name}"
    scan = reader.read(path)
    if not isinstance(scan, Scan):
        yield f"it returns {type(scan).__name__}, no scan"
        return
    if scan.reader != reader.name or not scan.source:
        yield f"the scan says that '{scan.reader}' read it, from '{scan.source}'; expected '{reader.name}' and the path"
    first = np.asarray(scan.frame(0).signals)
    if first.shape != (1, *scan.signals.shape[1:]) or first.dtype.kind not in "iuf":
        yield f"its first frame has signals {first.dtype} of shape {first.shape}, not {(1, *scan.signals.shape[1:])}"
    again = reader.read(path)
    if again != scan or pickle.loads(pickle.dumps(scan)) != scan:
        yield "the scan is another when it is read again, or sent to another process"
    elif not np.array_equal(np.asarray(again.frame(0).signals), first, equal_nan=first.dtype.kind == "f"):
        yield "the first frame is another when it is read again"


def beside(plugin: Sampled) -> Iterator[str]:
    """Images and regions in or beside the sample are those of oatkit, one image for each frame."""
    if plugin.sample is None:
        return
    for name, images in plugin.reader.images(plugin.sample).items():
        if not isinstance(name, str) or (len(images) and not isinstance(_first(images), Image | None)):
            yield f"the images '{name}' are none"
    if not all(isinstance(region, Region) for region in plugin.reader.regions(plugin.sample)):
        yield "a region of interest is none"


def damaged(plugin: Sampled) -> Iterator[str]:
    """A sample cut short or with bytes changed is read or is a `ReadError`; nothing else is raised."""
    if plugin.sample is None or not plugin.sample.is_file():
        return
    content = plugin.sample.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        for neighbour in plugin.sample.parent.iterdir():
            if neighbour.is_file() and neighbour.stat().st_size < 2**24:
                shutil.copy(neighbour, folder)
        path = Path(folder) / plugin.sample.name
        for name, damaged_content in _damages(content):
            path.write_bytes(damaged_content)
            try:
                plugin.reader.can_read(path)
            except Exception as error:
                yield f"can_read raises {type(error).__name__} for its sample {name}: {error}"
                return
            try:
                plugin.reader.read(path).frame(0)
            except ReadError:
                continue
            except Exception as error:
                yield f"its sample {name} raises {type(error).__name__}: {error}; expected ReadError"
                return


def _damages(content: bytes) -> Iterator[tuple[str, bytes]]:
    for share in (0.0, 0.02, 0.3, 0.9):
        yield f"cut to {share:.0%}", content[: int(share * len(content))]
    rng = np.random.default_rng(0)
    for trial in range(20):
        changed = bytearray(content)
        # Half of them near the begin, where formats say what follows.
        for _ in range(3):
            changed[int(rng.integers(0, min(len(content), 2048) if trial % 2 else len(content)))] ^= 1 << int(
                rng.integers(8)
            )
        yield f"with bits flipped (trial {trial})", bytes(changed)


def _first(images: Sequence[Image]) -> Image | None:
    """Return the first image; None where it cannot be had, which its reader may say when it is asked for it."""
    try:
        return images[0]
    except OatkitError:
        return None


CHECKS = (foreign, sample, beside, damaged)
