"""Detector positions of an iThera header, in either of its two forms."""

import math

import numpy as np

from oatkit.builtin.readers.plane import flat_axes, seen_along
from oatkit.builtin.readers.xml_fields import Node
from oatkit.data import Detectors
from oatkit.hostile import printable

MAX_DETECTORS = 65_536


def detectors(hardware: Node) -> Detectors:
    """Return the detectors of ``HARDWARE-DESC``, in the plane in which they lie.

    Raises `ReadError` where they do not lie in a plane of constant x, y or z, or the form is neither of the two.
    """
    description = hardware.get("FRAME-DESC")
    equal = description.find("EQUAL")
    points = _listed(description) if equal is None else _equally_spaced(equal)
    return seen_along(points, _axis_across(points, description))


def _listed(description: Node) -> np.ndarray:
    """Return ``PROJECTION`` elements as points ``(n, 3)``, m."""
    description.get("PROJECTION")
    projections = description.all("PROJECTION")
    if len(projections) > MAX_DETECTORS:
        raise description.error(f"at most {MAX_DETECTORS} elements PROJECTION", str(len(projections)))
    numbers = [projection.attribute("number") for projection in projections]
    if None not in numbers and numbers != [str(i + 1) for i in range(len(numbers))]:
        odd = next(i for i, number in enumerate(numbers) if number != str(i + 1))
        raise projections[odd].error(
            f"elements numbered one by one, here {odd + 1}", repr(printable(numbers[odd] or "", 20))
        )
    return np.array([_point(projection) for projection in projections])


def _point(projection: Node) -> list[float]:
    values = {value.attribute("axis-ref"): value for value in projection.all("VALUE")}
    if sorted(map(str, values)) != ["1", "2", "3"]:
        raise projection.error("one VALUE for each axis-ref 1, 2 and 3", ", ".join(sorted(map(str, values))) or "none")
    return [values[axis].number("a coordinate in m") for axis in "123"]


def _equally_spaced(equal: Node) -> np.ndarray:
    """Return ``EQUAL`` (an arc by start, step and end in radians) as points ``(n, 3)``, m."""
    start, step, end = (equal.get(name).number("an angle in radians") for name in ("START", "STEP", "END"))
    if not max(abs(start), abs(end)) <= 4 * math.pi:
        raise equal.error("angles in radians", f"{start:g} .. {end:g}")
    n_steps = (end - start) / step if step else math.nan
    if not 0 <= n_steps < MAX_DETECTORS:
        raise equal.error(f"a STEP that leads from START to END in at most {MAX_DETECTORS} steps", f"{step:g}")
    constants = {constant.attribute("axis-ref"): constant for constant in equal.all("CONSTANT")}
    if "2" not in constants:
        raise equal.error("a CONSTANT with axis-ref 2, the radius", "none")
    angles = start + step * np.arange(round(n_steps) + 1)
    radius = constants["2"].number("a radius in m")
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros_like(angles)], axis=1)


def _axis_across(points: np.ndarray, description: Node) -> int:
    """Return the axis along which the detectors do not extend; z, then y, where there are several."""
    # Version 2.3 holds the image plane in the first and the third axis, the others in the first and the second.
    return flat_axes(points, f"{description.where} <{description.path}>")[0]
