"""One frame of a result as a file for other programs: a figure, an OME-TIFF, an HDF5 file.

All are made in memory, written under a hidden name and renamed, so a full disk leaves no half file.
"""

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from oatkit.atomic import check_output, write_file
from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.plain import encode
from oatkit.result import Result
from oatkit.store import load


def export(result: Result | str | Path, file: str | Path, frame: int | None = None, overwrite: bool = False) -> None:
    """Write frame `frame` of a result, or of the result folder at a path, in the format that the name asks for.

    Without `frame`, the first one that has images.

    Raises `ValidationError` for a name whose ending is not among `FORMATS` or a frame that does not exist, and
    `ResultError` where the result is damaged, the file exists and `overwrite` is not asked for, or cannot be written.
    """
    file = Path(file)
    convert = next((function for ending, function in FORMATS.items() if file.name.lower().endswith(ending)), None)
    if convert is None:
        raise ValidationError(f"{file}: the name must end in one of {', '.join(FORMATS)}")
    if not isinstance(result, Result):
        result = load(result)
    inputs = [str(result.scan.get("source", "")), *([str(result.stored.path)] if result.stored else [])]
    check_output(file, inputs, overwrite)
    write_file(file, convert(result if frame is None else result.frame(frame)), overwrite)


def _png(result: Result) -> bytes:
    from oatkit.drawing.page import png
    from oatkit.figure import image_figure

    return png(image_figure(result))


def _ome_tiff(result: Result) -> bytes:
    """Return one series of axes CYX for each image, row 0 at the top, as viewers draw it."""
    import tifffile

    file = io.BytesIO()
    with tifffile.TiffWriter(file, ome=True) as writer:
        for name, image in result.items():
            writer.write(image.values[:, ::-1], photometric="minisblack", metadata=_ome_metadata(name, image))
    return file.getvalue()


def _ome_metadata(name: str, image: Image) -> dict[str, Any]:
    pixel = round(1e6 * image.grid.pixel_size_m, 9)
    channels = [f"{w:g} nm" for w in image.wavelengths_nm] or [name]
    return {
        "axes": "CYX",
        "Name": name,
        "Description": f"{image.quantity} in {image.unit or 'no unit'}; y points up, the first row is the top",
        "PhysicalSizeX": pixel,
        "PhysicalSizeXUnit": "µm",
        "PhysicalSizeY": pixel,
        "PhysicalSizeYUnit": "µm",
        "Channel": {"Name": channels},
    }


def _hdf5(result: Result) -> bytes:
    """Return an HDF5 file: a dataset ``(wavelength, y, x)`` for each image, and ``provenance``, a JSON text.

    Attributes of an image: ``quantity``, ``unit``, ``wavelengths_nm``, ``pixel_size_m``, ``centre_m`` ``(y, x)`` and
    ``row_0`` = "bottom". Datasets carry Fletcher checksums and strings have a fixed length (others escape checksums).
    """
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w", libver=("v108", "v108")) as file:
        file.attrs.update(_texts(format="oatkit-export"), version=1)
        for name, image in result.items():
            dataset = file.create_dataset(name, data=image.values, chunks=(1, *image.grid.shape), fletcher32=True)
            dataset.attrs.update(_texts(quantity=image.quantity, unit=image.unit, row_0="bottom"))
            dataset.attrs["wavelengths_nm"] = np.array(image.wavelengths_nm)
            dataset.attrs["pixel_size_m"] = image.grid.pixel_size_m
            dataset.attrs["centre_m"] = image.grid.centre_m
        text = np.array([json.dumps(_provenance(result), indent=1).encode()])
        file.create_dataset("provenance", data=text, chunks=(1,), fletcher32=True)
    return content.getvalue()


def _texts(**texts: str) -> dict[str, np.bytes_]:
    return {key: np.bytes_(text.encode()) for key, text in texts.items()}


def _provenance(result: Result) -> Any:
    choices = ("requested", "pipeline", "weight_choice", "speed_choice", "calibration_choice")
    keys = ("frame_index", "time_s", "scan", *choices, "versions", "seconds", "warnings")
    table = {key: getattr(result, key) for key in keys}
    images = {name: {"history": image.history, "diagnostics": image.diagnostics} for name, image in result.items()}
    return encode({**table, "images": images}, "result")


FORMATS: Mapping[str, Callable[[Result], bytes]] = MappingProxyType(
    {".png": _png, ".ome.tif": _ome_tiff, ".ome.tiff": _ome_tiff, ".h5": _hdf5}
)
"""Endings of file names, and what makes such a file of one frame."""
