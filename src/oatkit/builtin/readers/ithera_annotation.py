"""Regions of interest that iLabs keeps beside an iThera scan, in a file ``.iannotation``."""

import json
import logging
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.api import EllipseRegion, PolygonRegion, RectangleRegion, Region
from oatkit.errors import ReadError, ValidationError
from oatkit.hostile import printable, read_at_most

MAX_BYTES = 16 * 2**20
MAX_REGIONS = 10_000
MAX_DEGREES = 36_000
DEFAULT_SIZE = "Point(0.01, 0.01)"
SHAPES = ("Ellipse", "Segment", "Polygon", "Rectangle")
POINT = re.compile(r"\s*Point\(([^(),]{1,40}),([^(),]{1,40})\)\s*")
log = logging.getLogger("oatkit")


def read_annotation(path: Path) -> tuple[Region, ...]:
    """Return the regions in a file by the names ``iAnnotation_<i>/<j>``, counted from 0.

    A straight line, which has no area, and a region that makes no sense are left out, each with a warning in the log.
    Raises `ReadError` for a file that holds no list of regions.
    """
    found = []
    for name, entry in _entries(_wrapper(path), path):
        where = f"{path} '{name}'"
        try:
            found.append(_region(entry, name, where))
        except ReadError as error:
            log.warning("%s; it is left out", error)
        except ValidationError as error:
            log.warning("%s: %s; it is left out", path, error)
    return tuple(found)


def _wrapper(path: Path) -> dict[str, Any]:
    try:
        wrapper = json.loads(read_at_most(path, MAX_BYTES).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # no UTF-8, no JSON, numbers too long, nesting too deep
        raise ReadError(f"{path}: not valid JSON: {printable(str(error), 200)}") from None
    if not isinstance(wrapper, dict) or not isinstance(wrapper.get("Annotations"), list):
        raise ReadError(f"{path}: expected an iAnnotationListWrapper with a list of Annotations")
    return wrapper


def _entries(wrapper: dict[str, Any], path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every region of every annotation with its name."""
    count = 0
    for i, annotation in enumerate(wrapper["Annotations"]):
        listed = annotation.get("ROIList", []) if isinstance(annotation, dict) else None
        # Some programs put the list into another one.
        listed = listed[0] if isinstance(listed, list) and len(listed) == 1 and isinstance(listed[0], list) else listed
        for j, entry in enumerate(listed if isinstance(listed, list) else [None]):
            count += 1
            if not isinstance(entry, dict) or count > MAX_REGIONS:
                raise ReadError(
                    f"{path} 'iAnnotation_{i}/{j}': expected a region of interest, one of at most {MAX_REGIONS}"
                )
            yield f"iAnnotation_{i}/{j}", entry


def _region(entry: dict[str, Any], name: str, where: str) -> Region:
    shape = entry.get("type", "Rectangle")
    if shape not in SHAPES:
        raise ReadError(f"{where}: expected the type {', '.join(SHAPES)} or none, found {printable(repr(shape), 40)}")
    if shape in ("Segment", "Polygon"):
        points = entry.get("points")
        if not isinstance(points, list) or not points:
            raise ReadError(f"{where}: expected a list of points, found {printable(repr(points), 40)}")
        x, y_down = np.array([_point(point, where) for point in points]).T
        if shape == "Segment" or len(points) < 3:
            raise ReadError(f"{where}: a straight line has no area")
        return PolygonRegion(name, np.column_stack([-y_down, x]))
    kind = EllipseRegion if shape == "Ellipse" else RectangleRegion
    return kind(name, *_placed(entry, where))


def _placed(entry: dict[str, Any], where: str) -> tuple[tuple[float, float], tuple[float, float], float]:
    """Return centre (y, x), half axes (y, x) and angle of a shape that is turned about its upper left corner.

    The file's y points down, so that its angle turns clockwise.
    """
    left, top_down = _point(entry.get("pos"), where)
    width, height = _point(entry.get("size", DEFAULT_SIZE), where)
    degrees = entry.get("angle", 0)
    if isinstance(degrees, bool) or not isinstance(degrees, int | float) or not abs(degrees) <= MAX_DEGREES:
        raise ReadError(f"{where}: expected an angle in degrees, found {printable(repr(degrees), 40)}")
    angle = math.radians(math.fmod(degrees, 360))
    c, s = math.cos(angle), math.sin(angle)
    x = left + (c * width - s * height) / 2
    y_down = top_down + (s * width + c * height) / 2
    return (-y_down, x), (height / 2, width / 2), -angle


def _point(text: Any, where: str) -> tuple[float, float]:
    """Return ``Point(x, y)``, m."""
    match = POINT.fullmatch(text) if isinstance(text, str) else None
    try:
        x, y = (float(number) for number in match.groups()) if match else (math.nan, math.nan)
    except ValueError:
        x = y = math.nan
    if not math.isfinite(x + y):
        raise ReadError(f"{where}: expected 'Point(x, y)' in m, found {printable(repr(text), 60)}")
    return x, y
