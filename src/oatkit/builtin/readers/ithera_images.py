"""Images that the vendor's software left beside an iThera scan: reconstructions, unmixed components, ultrasound."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from oatkit.builtin.readers.ithera_pulses import Pulses, pulses
from oatkit.builtin.readers.ithera_records import MAX_PIXELS, Planes, stack
from oatkit.builtin.readers.ithera_ultrasound import ultrasound
from oatkit.builtin.readers.stored_images import StoredImages, component_name, refuse
from oatkit.builtin.readers.xml_fields import Node
from oatkit.data import Image
from oatkit.errors import ReadError
from oatkit.hostile import inside, printable

MAX_RECORDS = 10**7


def images(root: Node, msot: Path) -> dict[str, Sequence[Image]]:
    """Return the images of a header by names that tell folder, method and number: ``RECONs/model_lin/0``.

    Raises `ReadError` where the header is malformed or a name in it leads out of the folder. Images whose file is
    missing or too short, and volumes, raise it when they are read.
    """
    taken = pulses(root)
    recons = _children(root, "ReconNodes", "DataModelNewReconstructionNode")
    found: dict[str, Sequence[Image]] = {}
    for number, node in enumerate(recons):
        found[f"RECONs/{_label(node, 'Method')}/{number}"] = _reconstruction(node, msot.parent, taken)
    by_guid = {guid.text: node for node in recons if (guid := node.find("GUID")) is not None}
    for number, node in enumerate(_children(root, "MspNodes", "DataModelNewMspNode")):
        name = f"MSPs/{_label(node, 'Method')}/{number}"
        found |= {f"{name}/{part}": entry for part, entry in _components(node, msot.parent, by_guid).items()}
    return found | ultrasound(root, msot)


def _children(root: Node, parent: str, name: str) -> list[Node]:
    node = root.find(parent)
    return [] if node is None else node.all(name)


def _label(node: Node, name: str) -> str:
    child = node.find(name)
    return printable((child.element.text if child is not None else "") or "unnamed", 100).replace("/", "_")


def _file(node: Node, folder: str, scan: Path) -> Path:
    return inside(inside(scan, folder), f"{node.get('GUID').text}.bin")


def _history(node: Node, dataset: str) -> dict[str, str]:
    return {"reader": "ithera", "dataset": dataset, "method": _label(node, "Method"), "name": _label(node, "Name")}


def _reconstruction(node: Node, scan: Path, taken: Pulses) -> StoredImages:
    """Return the images of a reconstruction, one for each sweep over its wavelengths."""
    path = _file(node, "RECONs", scan)
    records, wavelengths = _sweeps(node, taken)
    history = _history(node, f"RECONs/{path.name}")
    return _stack(node, path, records, "initial_pressure", wavelengths, history)


def _stack(
    recon: Node,
    path: Path,
    records: np.ndarray,
    quantity: str,
    wavelengths_nm: tuple[float, ...],
    history: dict[str, str],
) -> StoredImages:
    """Return images on the grid of a reconstruction."""
    try:
        planes = _planes(recon)
    except ReadError as error:
        return StoredImages(len(records), partial(refuse, str(error)))
    return stack(path, records, planes, quantity, "a.u.", wavelengths_nm, history)


def _sweeps(node: Node, taken: Pulses) -> tuple[np.ndarray, tuple[float, ...]]:
    """Return which record is which frame and wavelength, and the wavelengths; an incomplete last sweep is dropped."""
    entries = _children(node, "ReconFrames", "DataModelReconstructionFrame")
    if not entries:
        return np.arange(taken.offsets.size).reshape(taken.offsets.shape), taken.wavelengths_nm
    which = {int(offset): column for row in taken.offsets for column, offset in enumerate(row)}
    columns, records = [], []
    for position, entry in enumerate(entries):
        first = entry.get("ScanFramesID/int").count("the IDOffset of a pulse", 0, MAX_RECORDS)
        if first in which:  # those of a last, incomplete sweep are not
            columns.append(which[first])
            records.append(_record(entry, position))
    used = sorted(set(columns))
    sweeps = len(columns) // max(1, len(used))
    kept = sweeps * len(used)
    if columns[:kept] != used * sweeps:
        raise node.error("reconstructions in whole sweeps over the wavelengths", "another order in ReconFrames")
    shape = (sweeps, len(used))
    return np.array(records[:kept], int).reshape(shape), tuple(taken.wavelengths_nm[column] for column in used)


def _record(entry: Node, position: int) -> int:
    offset = entry.find("IDOffset")
    return position if offset is None else offset.count("the index of an image", 0, MAX_RECORDS)


def _planes(node: Node) -> Planes:
    """Return how the planes of a reconstruction lie in its file: two formats, told apart by the field of view."""
    if node.find("FIELD-OF-VIEW") is None:
        n = node.get("Resolution").count("pixels along a side", 2, MAX_PIXELS)
        size = node.get("Roi").number("a field of view in m") / (n - 1)
        return Planes((n, n), (size, size), "<f8", False)
    view = node.get("FIELD-OF-VIEW")
    counts = [view.get(f"PixelCount/{axis}").count("a number of pixels", 1, MAX_PIXELS) for axis in "XYZ"]
    extents = [view.get(f"Extents/{axis}").number("a field of view in m") for axis in "XYZ"]
    seen = [axis for axis in range(3) if counts[axis] > 1]
    if len(seen) != 2:
        raise view.error("an image of a plane", " x ".join(map(str, counts)) + " pixels")
    slow, fast = seen
    sizes = (extents[slow] / (counts[slow] - 1), extents[fast] / (counts[fast] - 1))
    return Planes((counts[slow], counts[fast]), sizes, "<f4", True)


def _components(node: Node, scan: Path, recons: dict[str, Node]) -> dict[str, StoredImages]:
    """Return the components of an unmixing by name, one image for each slice."""
    path = _file(node, "MSPs", scan)
    source = node.get("ReconGUID").text
    if source not in recons:
        raise ReadError(f"{node.where} <{node.path}/ReconGUID>: names no reconstruction of this header")
    records: dict[str, list[int]] = {}
    for entry in _children(node, "SlicesFrame", "MspSliceFrame"):
        for name, component in _named(_children(entry, "ComponentList", "MspSliceComponent")).items():
            record = component.get("IDOffset").count("the index of an image", 0, MAX_RECORDS)
            records.setdefault(name, []).append(record)
    history = _history(node, f"MSPs/{path.name}")
    return {
        name: _stack(recons[source], path, np.array(found)[:, None], name, (), history)
        for name, found in records.items()
    }


def _named(components: list[Node]) -> dict[str, Node]:
    """Return the components of a slice by name, numbered from the second one of a name on."""
    named: dict[str, Node] = {}
    for node in components:
        name = _component(node)
        same = sum(key == name or key.startswith(f"{name} (") for key in named)
        named[f"{name} ({same + 1})" if same else name] = node
    return named


def _component(node: Node) -> str:
    """Return the name of a component by its spectrum, or by its own name where it has none."""
    spectrum = _label(node, "SpectraName")
    return component_name(spectrum if spectrum != "unnamed" else _label(node, "ComponName"))
