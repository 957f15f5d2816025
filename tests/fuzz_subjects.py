"""What is fuzzed: files of every kind that oatkit reads, how they are read, and what came out of them."""

import logging
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tifffile

import array_files
import ipasc_files
import msot_files
import oatkit
import patato_files
from conftest import SHARED
from oatkit.describe import scan_table
from oatkit.pipeline import presets
from oatkit.regions import load_regions
from oatkit.scanfile import PER_PULSE, read_truths, write_scan
from oatkit.spectra.optics import read_optics
from oatkit.store import StoreWriter
from results import GRID, make_result, write_frames

Values = dict[str, Any]
MOUSE = SHARED / "data" / "mouse_scan9"
MOUSE_SAMPLES = 200
"""Of each record that are kept of the real scan, so that a file takes a moment."""


@dataclass(frozen=True)
class Subject:
    """Files in a folder and the function that reads them."""

    write: Callable[[Path], None]
    """Writes the files into an empty folder."""
    read: Callable[[Path], Values]
    """Returns all that is in them, by name."""
    forms: Mapping[str, str]
    """For each file, or the last part of the names of several, how it may be edited (see `mutations.FORMATS`)."""

    def files(self, folder: Path) -> list[tuple[Path, str]]:
        """Return the files that are damaged, each with its format."""
        return [
            (path, form)
            for pattern, form in self.forms.items()
            for path in sorted(folder.glob(pattern))
            if path.is_file()
        ]


class Remarks(logging.Handler):
    """Collects what oatkit warns of."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a warning."""
        self.found.append(record.getMessage())


# What comes out ------------------------------------------------------------------------------------------------------


def of_scan(scan: oatkit.Scan) -> Values:
    """Return all that a scan holds."""
    geometry = scan.geometry
    parts = ("wavelengths_nm", "valid", "pulse_energy", "temperature_c", "timestamps_s", "position_m", "name")
    times = ("sampling_rate_hz", "start_time_s", "speed_of_sound_m_s", "impulse_response")
    whole = np.asarray(scan.signals[...])
    assert np.array_equal(whole[-1:], np.asarray(scan.signals[scan.frames - 1 :]), equal_nan=whole.dtype.kind == "f")
    return {
        "signals": whole,
        "detectors": geometry.detectors.positions_m,
        **{name: getattr(geometry, name) for name in times},
        **{name: getattr(scan, name) for name in parts},
        "notes": (scan_table(scan)["notes"], scan.speed_of_sound_source),
    }


def of_images(found: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the images of a file, or why one of them cannot be read."""
    for name, images in found.items():
        for frame in range(min(len(images), 10)):
            key = f"image {name} {frame}"
            try:
                image = images[frame]
                yield key, (image.values, image.unit, image.grid.shape, image.grid.pixel_size_m, image.wavelengths_nm)
            except oatkit.ReadError as error:
                yield key, f"refused: {error}"


def of_regions(regions: Any) -> Iterator[tuple[str, Any]]:
    """Yield the outlines of regions."""
    yield from ((f"region {number} {region.name}", region.outline_m) for number, region in enumerate(regions))


def of_result(path: Path) -> Values:
    """Return all images of a result."""
    result, found = oatkit.load(path), {}
    for index in range(result.frames):
        if index in result.failed:
            found[f"failed {index}"] = result.failed[index]
        else:
            frame = result.frame(index)
            found |= {f"frame {index} {name}": (image.values, image.unit) for name, image in frame.items()}
            found[f"made {index}"] = (frame.pipeline, frame.scan, frame.warnings, frame.seconds)
    return found


def everything(path: Path) -> Values:
    """Return the scan of a file, its images and its regions."""
    values = of_scan(oatkit.read(path))
    values |= of_images(oatkit.read_images(path))
    return values | dict(of_regions(oatkit.read_regions(path)))


# The files -----------------------------------------------------------------------------------------------------------


def write_mouse(folder: Path) -> None:
    """The real scan of a mouse, its records cut to their first samples."""
    signals = np.fromfile(MOUSE / "Scan_9.bin", "<u2").reshape(256, -1)
    np.ascontiguousarray(signals[:, :MOUSE_SAMPLES]).tofile(folder / "Scan_9.bin")
    np.fromfile(MOUSE / "Scan_9.irf", "<f8")[900 : 900 + MOUSE_SAMPLES].tofile(folder / "Scan_9.irf")
    text = (MOUSE / "Scan_9.msot").read_bytes()
    short = re.sub(rb"(<RECORDED-LENGTH[^>]*>)\d+<", rb"\g<1>%d<" % MOUSE_SAMPLES, text)
    (folder / "Scan_9.msot").write_bytes(short)
    shutil.copy(MOUSE / "Scan_9.iannotation", folder / "Scan_9.iannotation")


def write_msot(folder: Path) -> None:
    """A small scan with stored images, and the impulse response in its header."""
    view = msot_files.field_of_view("FIELD-OF-VIEW", (5, 4, 1), (8e-3, 6e-3, 0.0))
    recons = [
        msot_files.recon_node("A", [(0, 0), (1, 1)]),
        msot_files.recon_node("B", [(0, 0), (1, 1)], view),
    ]
    msps = [msot_files.msp_node("C", "A", [[(0, "Hb"), (1, "HbO2")]])]
    more = msot_files.nodes(recons, msps)
    text = msot_files.header(embedded=np.hanning(8), version="2.4", more=more)
    msot_files.write(folder, text)
    rng = np.random.default_rng(0)
    stored = {"RECONs/A": ((2, 4, 4), "<f8"), "RECONs/B": ((2, 5, 4), "<f4"), "MSPs/C": ((2, 4, 4), "<f8")}
    for name, (shape, dtype) in stored.items():
        (folder / name).parent.mkdir(exist_ok=True)
        rng.standard_normal(shape).astype(dtype).tofile(folder / f"{name}.bin")


def write_arrays(folder: Path) -> None:
    """Signals in both formats, and all that a description may name."""
    stored, _ = array_files.numbers()
    np.save(folder / "scan.npy", stored)
    array_files.write_scattered(folder / "scan.tif", stored)
    array_files.write_plain(folder / "plain.tif", stored)
    angles = np.linspace(0.3, 5, 5)
    np.savetxt(folder / "positions.csv", 40 * np.column_stack([np.cos(angles), np.sin(angles)]), delimiter=",")
    np.save(folder / "response.npy", np.hanning(9))
    array_files.write_mat(folder / "pulses.mat", data=np.linspace(1, 2, 8).reshape(2, 4))
    rest = (
        '[detectors]\npositions = "positions.csv"\nunit = "mm"\naxes = ["x", "y"]\n'
        '[impulse_response]\nfile = "response.npy"\ncentre = 4\n[pulses]\npulse_energy = "pulses.mat"\n'
    )
    numbers = {"start_time_us": "0.5", "speed_of_sound_m_s": "1480"}
    array_files.describe(folder, rest=rest, **numbers)
    (folder / "npy.toml").write_bytes((folder / "scan.toml").read_bytes())
    for name in ("scan.tif", "plain.tif"):
        array_files.describe(folder, file=name, **numbers).rename(folder / f"{name[:2]}-tif.toml")


def read_arrays(folder: Path) -> Values:
    """All scans that the folder describes."""
    found: Values = {}
    for name in ("npy", "sc-tif", "pl-tif"):
        found |= {f"{name} {key}": value for key, value in of_scan(oatkit.read(folder / f"{name}.toml")).items()}
    return found


def own_scan() -> oatkit.Scan:
    """A scan with everything in it."""
    rng = np.random.default_rng(4)
    geometry = oatkit.Geometry(
        oatkit.Detectors(ring_m()), 40e6, 30, 1e-6, 1480.0, impulse_response=rng.standard_normal(9)
    )
    pulses = {name: rng.uniform(1, 2, (3, 2)) for name in PER_PULSE}
    signals = rng.integers(0, 60_000, (3, 2, 5, 30)).astype("u2")
    return oatkit.Scan(
        signals, geometry, (700.0, 800.0), rng.random((3, 2, 5)) > 0.2, **pulses, name="own", notes=("a",)
    )


def ring_m() -> np.ndarray:
    """Five detectors (y, x), m."""
    angle = np.linspace(0.3, 5, 5)
    return 0.04 * np.column_stack([np.sin(angle), np.cos(angle)])


def write_own(folder: Path) -> None:
    """The scan file of oatkit, with two truths."""
    truths = (
        oatkit.Image(np.ones((1, 4, 5)), name, "", oatkit.Grid((4, 5), 1e-4)) for name in ("initial_pressure", "so2")
    )
    write_scan(own_scan(), folder / "scan.h5", tuple(truths))


def read_own(folder: Path) -> Values:
    """The scan and its truths."""
    values = of_scan(oatkit.read(folder / "scan.h5"))
    return values | {f"truth {name}": (i.values, i.unit) for name, i in read_truths(folder / "scan.h5").items()}


RUN = {"pipeline": "a test", "frames": [0, 1, 2]}


def write_unfinished(folder: Path) -> None:
    """Two of three frames, and the diary that says so."""
    try:
        with StoreWriter(folder / "out.zarr", 3, run=RUN) as writer:
            writer.write(0, make_result(0))
            writer.fail(1, "the light was off")
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        pass


def finish(folder: Path) -> Values:
    """Go on with the run, end it and return the result."""
    with StoreWriter(folder / "out.zarr", 3, run=RUN, resume=True) as writer:
        for index in sorted({0, 1, 2} - writer.done):
            if index == 1:
                writer.fail(1, "the light was off")
            else:
                writer.write(index, make_result(index))
    assert oatkit.verify(folder / "out.zarr") == []
    return of_result(folder / "out.zarr")


def write_pipelines(folder: Path) -> None:
    """Every preset, and the table that one of them names."""
    for name, text in presets().items():
        (folder / f"{name}.toml").write_text(text)
    rows = "".join(f"{w},0.{w},10.5\n" for w in range(650, 1000, 50))
    head = "# of a phantom\nwavelength_nm,absorption_per_cm,reduced_scattering_per_cm\n"
    (folder / "optics.csv").write_text(head + rows)


def read_pipelines(folder: Path) -> Values:
    """All settings, and the table."""
    loaded = {path.stem: oatkit.Pipeline.load(path).model_dump() for path in sorted(folder.glob("*.toml"))}
    optics = read_optics(folder / "optics.csv", (700.0, 810.0))
    return {**loaded, "optics": (optics.absorption_per_m, optics.reduced_scattering_per_m)}


def write_regions(folder: Path) -> None:
    """Regions as shapes, and as labels in every format."""
    from PIL import Image as Picture

    (folder / "regions.toml").write_text(
        'version = 1\n[[region]]\nname = "tumour"\nshape = "ellipse"\ncentre_yx_mm = [2.0, -3.5]\n'
        'half_axes_yx_mm = [1.0, 2.5]\nangle_degrees = 30\n[[region]]\nname = "muscle"\nshape = "polygon"\n'
        "vertices_yx_mm = [[0, 0], [0, 4], [3, 4.25]]\n"
    )
    labels = np.zeros(GRID.shape, "u1")
    labels[3:9, 4:8], labels[12:20, 9:15] = 1, 2
    np.save(folder / "labels.npy", labels)
    Picture.fromarray(labels).save(folder / "labels.png")
    tifffile.imwrite(folder / "labels.tif", labels, compression="zlib", photometric="minisblack")


def read_region_files(folder: Path) -> Values:
    """All regions."""
    files = ("regions.toml", "labels.npy", "labels.png", "labels.tif")
    return {
        f"{name} {key}": value
        for name in files
        for key, value in [(r.name, r.mask(GRID)) for r in load_regions(folder / name, GRID)]
    }


def write_ipasc(folder: Path) -> None:
    """A small file of the consortium's layout."""
    energy = np.linspace(1, 2, 6).reshape(2, 3)
    ipasc_files.write(folder / "scan.hdf5", oatkit_name="name", pulse_energy=energy)


def write_patato(folder: Path) -> None:
    """A small file of PATATO with everything in it."""
    patato_files.write_patato(folder / "scan.hdf5")


def write_result(folder: Path) -> None:
    """Three frames, the second of which failed."""
    write_frames(folder / "out.zarr", make_result(0), "no light", make_result(2))


def copy_ipasc(folder: Path) -> None:
    """The real scan of a mouse as the consortium's own program wrote it."""
    shutil.copy(MOUSE.parent / "mouse_scan9_ipasc.hdf5", folder / "scan.hdf5")


def _one(name: str) -> Callable[[Path], Values]:
    return lambda folder: everything(folder / name)


HDF5 = {"scan.hdf5": "hdf5"}
MSOT = {"Scan_?.msot": "xml", "Scan_?.bin": "binary", "Scan_?.irf": "binary", "Scan_?.iannotation": "text"}
STORED = {"RECONs/*.bin": "binary", "MSPs/*.bin": "binary"}
ARRAYS = {"npy.toml": "text", "scan.npy": "npy", "*.tif": "tiff", "positions.csv": "text", "response.npy": "npy"}
LABELS = {"regions.toml": "text", "labels.npy": "npy", "labels.png": "binary", "labels.tif": "tiff"}
SUBJECTS: dict[str, Subject] = {
    "iThera": Subject(write_msot, _one("Scan_1.msot"), MSOT | STORED),
    "IPASC": Subject(write_ipasc, _one("scan.hdf5"), HDF5),
    "PATATO": Subject(write_patato, _one("scan.hdf5"), HDF5),
    "plain arrays": Subject(write_arrays, read_arrays, ARRAYS | {"pulses.mat": "hdf5"}),
    "scan file": Subject(write_own, read_own, {"scan.h5": "hdf5"}),
    "result": Subject(write_result, lambda folder: of_result(folder / "out.zarr"), {"out.zarr/**/*": "binary"}),
    "unfinished": Subject(
        write_unfinished, finish, {".out.zarr.journal": "binary", ".out.zarr.unfinished/**/*": "binary"}
    ),
    "pipelines": Subject(write_pipelines, read_pipelines, {"*.toml": "text", "optics.csv": "text"}),
    "regions": Subject(write_regions, read_region_files, LABELS),
}
if MOUSE.is_dir():
    SUBJECTS |= {
        "mouse": Subject(write_mouse, _one("Scan_9.msot"), MSOT),
        "mouse IPASC": Subject(copy_ipasc, _one("scan.hdf5"), HDF5),
    }
