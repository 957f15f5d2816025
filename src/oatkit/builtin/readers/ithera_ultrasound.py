"""Ultrasound images taken along with an iThera scan."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from oatkit.builtin.readers.ithera_pulses import pulses
from oatkit.builtin.readers.ithera_records import MAX_PIXELS, Planes, stack
from oatkit.builtin.readers.stored_images import StoredImages, refuse
from oatkit.builtin.readers.xml_fields import Node, local_name
from oatkit.data import Image
from oatkit.errors import ReadError
from oatkit.hostile import inside

OFFSET = "ultraSound-frame-offset"


def ultrasound(root: Node, msot: Path) -> dict[str, Sequence[Image]]:
    """Return ``ultrasound``, the image that goes with each frame, and ``ultrasound/all``, those of the file in order.

    The first is there only where the header tells which image goes with which pulse; nothing without a file ``.us``.
    Where the size of an image is unknown, reading one raises `ReadError`.
    """
    path = inside(msot.parent, f"{msot.stem}.us")
    if not path.is_file():
        return {}
    try:
        planes = _planes(root)
    except ReadError as error:
        return {"ultrasound/all": StoredImages(1, partial(refuse, str(error)))}
    count = path.stat().st_size // (planes.pixels[0] * planes.pixels[1] * np.dtype(planes.dtype).itemsize)
    history = {"reader": "ithera", "dataset": path.name}
    chosen = {"ultrasound/all": np.arange(count)[:, None]}
    by_frame = _by_frame(root)
    if by_frame is not None:
        chosen["ultrasound"] = np.where(by_frame < count, by_frame, -1)[:, None]
    return {name: stack(path, records, planes, "ultrasound", "a.u.", (), history) for name, records in chosen.items()}


def _planes(root: Node) -> Planes:
    view = _anywhere(root, "ULTRA-SOUND-FIELD-OF-VIEW")
    if view is not None:
        n = view.get("PixelCount/X").count("pixels along a side", 2, MAX_PIXELS)
        size = view.get("Extents/X").number("a field of view in m") / (n - 1)
    else:
        resolution = _anywhere(root, "ULTRA-SOUND-RESOLUTION")
        pixel = _anywhere(root, "UltraSoundPixelSize")
        if resolution is None or pixel is None:
            raise root.error("ULTRA-SOUND-RESOLUTION and UltraSoundPixelSize for the ultrasound", "not both")
        n = resolution.count("pixels along a side", 2, MAX_PIXELS)
        size = pixel.number("the size of a pixel in m")
    return Planes((n, n), (size, size), "<f4", False)


def _by_frame(root: Node) -> np.ndarray | None:
    """Return which image goes with the first pulse of each frame, -1 for none; None where nothing is told."""
    shells = root.some("ScanNode/ScanFrames", "DataModelScanFrame")
    by_record = {}
    for shell in shells:
        told = shell.get("Frame").attribute(OFFSET)
        if told is not None and told.isdecimal() and len(told) < 10:
            by_record[shell.get("IDOffset").text] = int(told)
    if not by_record:
        return None
    return np.array([by_record.get(str(offset), -1) for offset in pulses(root).offsets[:, 0]])


def _anywhere(root: Node, name: str) -> Node | None:
    return next((Node(e, root.where, name) for e in root.element.iter() if local_name(e) == name), None)
