"""Scans of many frames that all differ, and results that are to be equal."""

from pathlib import Path

import numpy as np

import oatkit
from oatkit.scanfile import write_scan
from oatkit.store import load, verify


def write_frames_of(scan: oatkit.Scan, frames: int, path: Path) -> oatkit.Scan:
    """Write so many frames, each the first one of `scan` times another factor, and open the file."""
    signals = np.asarray(scan.signals)[:1] * np.linspace(1, 2, frames)[:, None, None, None]
    valid = np.repeat(np.asarray(scan.valid)[:1], frames, axis=0)
    write_scan(oatkit.Scan(signals, scan.geometry, scan.wavelengths_nm, valid, name=path.stem), path)
    return oatkit.read(path)


def same(first: Path, second: Path) -> bool:
    """Say whether two results have the same frames in one order, to the last bit, and the same pipeline as run."""
    one, other = (load(path) for path in (first, second))
    heads = [
        (r.frames, r.pipeline, dict(r.failed), [r.when(i)[0] for i in range(r.frames) if i not in r.failed])
        for r in (one, other)
    ]
    chunks = [path.relative_to(first) for path in first.glob("*/c/**/*") if path.is_file()]
    equal = all((first / name).read_bytes() == (second / name).read_bytes() for name in chunks)
    return heads[0] == heads[1] and bool(chunks) and equal and verify(second) == []
