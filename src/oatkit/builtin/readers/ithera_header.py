"""The header of an iThera scan, ``.msot``: all that its XML says, checked, in SI units."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from oatkit.builtin.readers.ithera_geometry import detectors
from oatkit.builtin.readers.ithera_pulses import Pulses, pulses
from oatkit.builtin.readers.ithera_response import impulse_response
from oatkit.builtin.readers.speed_of_sound import WATER_RANGE_C, water_speed_of_sound_m_s
from oatkit.builtin.readers.xml_fields import Node
from oatkit.data import Geometry
from oatkit.errors import ReadError
from oatkit.hostile import MAX_XML_BYTES, parse_xml, printable, read_at_most

VERSIONS = ("2.2", "2.3", "2.4")
MAX_SAMPLES = 1_000_000
NOT_APPLIED = ("DAQTriggerDelay", "AXIAL-OFFSET", "COUPLANT-SPEED-OF-SOUND", "COUPLANT-CURVATURE-RADIUS")
"""Elements of ``HARDWARE-DESC`` whose effect on the signals is not known here; noted where they are not zero."""


@dataclass(frozen=True)
class Header:
    """A header and the impulse response beside it."""

    name: str
    geometry: Geometry
    speed_of_sound_source: str
    pulses: Pulses
    notes: tuple[str, ...]
    digest: str
    """SHA-256 of the bytes of the header, in hexadecimal."""


def read_header(msot: Path, with_response: bool) -> Header:
    """Return the header of a scan. Raises `ReadError`, and `ValidationError` for values out of physical range."""
    content = read_at_most(msot, MAX_XML_BYTES)
    root = root_of(content, msot)
    hardware, measurement = root.get("HARDWARE-DESC"), root.get("MEASUREMENT-DESC")
    _check_flat(hardware)
    sampling_rate_hz = hardware.get("SAMPLING-FREQUENCY").frequency_hz()
    n_samples = measurement.get("RECORDED-LENGTH").count("the samples of a record", 1, MAX_SAMPLES)
    taken = pulses(root)
    speed, source, speed_note = _speed_of_sound(root, taken.temperature_c)
    response, response_note = None, "The impulse response was not asked for: signals are taken as the ideal ones."
    if with_response:
        response, response_note = impulse_response(root, msot, n_samples)
    geometry = Geometry(detectors(hardware), sampling_rate_hz, n_samples, 0.0, speed, response)
    notes = (*_oddities(root), *taken.notes, speed_note, response_note)
    return Header(
        _name(root, msot), geometry, source, taken, tuple(filter(None, notes)), hashlib.sha256(content).hexdigest()
    )


def root_of(content: bytes, msot: Path) -> Node:
    """Return the root of a header. Raises `ReadError` where the content is another one."""
    root = Node(parse_xml(content, msot), str(msot))
    if root.element.tag != "DataModelMsotProject":
        raise ReadError(f"{msot}: expected an iThera header <DataModelMsotProject>, found <{root.element.tag[:60]}>")
    return root


def _check_flat(hardware: Node) -> None:
    transducer = hardware.find("TRANSDUCER")
    if transducer is not None and transducer.text.lower() == "msot3":
        raise transducer.error("a transducer that images a plane", f"{transducer.text}, which images a volume")


def _speed_of_sound(root: Node, temperature_c: np.ndarray | None) -> tuple[float, str, str]:
    """Return the speed of sound (m/s), where it comes from, and a note where it had to be assumed.

    Water at the mean temperature of the pulses, plus the base of the transducer and the trim of the scan: a rule
    inferred from one scan, in which it agrees within 1.4 m/s with what its authors stored.
    """
    default = Geometry.speed_of_sound_m_s
    if temperature_c is None:
        return default, "default", f"No temperatures in the header: the speed of sound is assumed, {default:g} m/s."
    mean = float(temperature_c.mean())
    if not WATER_RANGE_C[0] < mean <= WATER_RANGE_C[1]:
        return default, "default", f"A mean temperature of {mean:g} C is implausible: speed of sound {default:g} m/s."
    parts = {"base": "HARDWARE-DESC/SPEED-OF-SOUND-BASE", "trim": "ScanNode/TrimSpeedOfSound"}
    nodes = {word: root.find(path) for word, path in parts.items()}
    added = {word: node.number("a speed in m/s") for word, node in nodes.items() if node is not None}
    water = water_speed_of_sound_m_s(mean)
    speed = water + sum(added.values())
    terms = "".join(f" {value:+g} ({word})" for word, value in added.items())
    missing = " and ".join(word for word, node in nodes.items() if node is None)
    note = f"The header gives no {missing} of the speed of sound." if missing else ""
    return speed, f"header: water at {mean:.2f} C {water:.2f}{terms} = {speed:.1f} m/s", note


def _oddities(root: Node) -> list[str]:
    notes = []
    version = root.find("DataModelVersion")
    found = "none" if version is None else printable(version.text, 20)
    if found not in VERSIONS:
        notes.append(f"The header's version is {found}; known are {', '.join(VERSIONS)}.")
    for name in NOT_APPLIED:
        node = root.find(f"HARDWARE-DESC/{name}")
        if node is not None and (value := node.number("a number")):
            notes.append(f"{name} is {value:g}; it is not applied.")
    return notes


def _name(root: Node, msot: Path) -> str:
    node = root.find("ScanNode/Name")
    return printable(node.element.text or "" if node is not None else "", 200) or msot.stem
