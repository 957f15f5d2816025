"""Regions of interest in a TOML file of our own, which names its numbers' order and unit in its keys::

    version = 1

    [[region]]
    name = "tumour"
    shape = "ellipse"
    centre_yx_mm = [2.0, -3.5]
    half_axes_yx_mm = [1.0, 2.5]
    angle_degrees = 30

    [[region]]
    name = "muscle"
    shape = "polygon"
    vertices_yx_mm = [[0, 0], [0, 4], [3, 4]]

``y`` points up and ``x`` to the right, from the origin of the image plane; a shape is turned anticlockwise about its
centre. The third shape, ``"rectangle"``, has the keys of an ellipse.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from decimal import Context, Decimal
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pydantic

from oatkit.errors import ValidationError
from oatkit.hostile import read_at_most
from oatkit.names import did_you_mean
from oatkit.parameters import Parameters, param, problems
from oatkit.shapes import EllipseRegion, PolygonRegion, RectangleRegion, Region

MOST_BYTES = 5_000_000
VERSION = 1


class PolygonTable(Parameters):
    """The numbers of a polygon."""

    key_word: ClassVar[str] = "key"
    title: ClassVar[str] = "a polygon"

    vertices_yx_mm: tuple[tuple[float, float], ...] = param(
        ..., "corners in order, each (y, x)", unit="mm", at_least=-1000, at_most=1000
    )


class CentredTable(Parameters):
    """The numbers of an ellipse or a rectangle."""

    key_word: ClassVar[str] = "key"
    title: ClassVar[str] = "an ellipse or rectangle"

    centre_yx_mm: tuple[float, float] = param(..., "centre, (y, x)", unit="mm", at_least=-1000, at_most=1000)
    half_axes_yx_mm: tuple[float, float] = param(
        ..., "half of its size along y and x before it is turned", unit="mm", at_least=1e-3, at_most=1000
    )
    angle_degrees: float = param(
        0.0, "turn about the centre, anticlockwise", unit="degrees", at_least=-400, at_most=400
    )


TABLES: Mapping[str, type[Parameters]] = {"polygon": PolygonTable, "ellipse": CentredTable, "rectangle": CentredTable}
REGIONS: Mapping[str, type[PolygonRegion | EllipseRegion | RectangleRegion]] = {
    "polygon": PolygonRegion, "ellipse": EllipseRegion, "rectangle": RectangleRegion,
}  # fmt: skip

EXACT = Context(prec=50)
"""Enough digits for a number to come back to the last bit after a change of its unit and back."""
PER_METRE = Decimal(1000)
PER_RADIAN = EXACT.divide(180, Decimal("3.14159265358979323846264338327950288419716939937511"))
FIELDS: Mapping[str, tuple[str, Decimal]] = {
    "vertices_yx_mm": ("vertices_m", PER_METRE),
    "centre_yx_mm": ("centre_m", PER_METRE),
    "half_axes_yx_mm": ("half_axes_m", PER_METRE),
    "angle_degrees": ("angle_rad", PER_RADIAN),
}
"""For each key of a file the field of the region, and how many units of the file are one of the field's."""


def regions_of(path: Path) -> Iterator[Region]:
    """Yield the regions of a TOML file, after all of them were checked."""
    rough, exact = _parsed(path)
    found: list[Region] = []
    wrong: list[str] = []
    for number, (table, precise) in enumerate(zip(rough, exact, strict=True), 1):
        where = f"{path.name} [[region]] {number}"
        try:
            found.append(_region(table, precise, where))
        except ValidationError as error:
            wrong += str(error).splitlines()
    if wrong:
        raise ValidationError("\n".join(wrong))
    yield from found


def toml_of(regions: Sequence[Region]) -> str:
    """Return regions as the text of a file. Raises `ValidationError` for a region of pixels, which has no shape."""
    import tomlkit  # only needed to write

    return tomlkit.dumps({"version": VERSION, "region": [_table(region) for region in regions]})


def _parsed(path: Path) -> tuple[list[Any], list[Any]]:
    """Return the tables of a file, with its numbers as floats, and with them as they are written."""
    try:
        text = read_at_most(path, MOST_BYTES).decode("utf-8-sig")
        rough, exact = tomllib.loads(text), tomllib.loads(text, parse_float=Decimal)
    except (ValueError, RecursionError) as error:  # beyond syntax: no text, numbers too long, nesting too deep
        raise ValidationError(f"{path}: not valid TOML: {error}") from None
    unknown = [key for key in rough if key not in ("version", "region")]
    if unknown:
        raise ValidationError(
            f"{path.name}: a file of regions has no key '{unknown[0]}'{did_you_mean(unknown[0], ('version', 'region'))}"
        )
    if rough.get("version", VERSION) != VERSION:
        raise ValidationError(f"{path.name} version: must be {VERSION}, got {rough['version']!r:.60}")
    if not isinstance(rough.get("region", []), list):
        raise ValidationError(f"{path.name}: expected a list of tables [[region]], with two brackets on each side")
    return rough.get("region", []), exact.get("region", [])


def _region(table: Any, exact: Any, where: str) -> Region:
    """Make the region that a table describes. Raises `ValidationError` with a line for each thing wrong with it."""
    if not isinstance(table, dict) or not isinstance(name := table.get("name"), str) or not name.strip():
        raise ValidationError(f'{where}: needs a name, as in name = "tumour"')
    where = f"{where} '{name}'"
    shape = table.get("shape")
    if not isinstance(shape, str) or shape not in TABLES:
        raise ValidationError(f'{where}.shape: must be "polygon", "ellipse" or "rectangle", got {shape!r:.60}')
    try:
        TABLES[shape].model_validate({key: value for key, value in table.items() if key not in ("name", "shape")})
    except pydantic.ValidationError as error:
        raise ValidationError("\n".join(f"{where}{key}: {text}" for key, text in problems(error))) from None
    fields = {field: _to_si(exact[key], factor) for key, (field, factor) in FIELDS.items() if key in exact}
    try:
        return REGIONS[shape](name, **fields)
    except ValidationError as error:
        raise ValidationError(f"{where}: {error}") from None


def _to_si(value: Any, per_unit: Decimal) -> Any:
    """Return numbers of a file, nested as they are, in SI units."""
    if isinstance(value, list):
        return tuple(_to_si(item, per_unit) for item in value)
    return float(EXACT.divide(Decimal(value), per_unit))


def _table(region: Region) -> dict[str, Any]:
    shape = next((word for word, kind in REGIONS.items() if isinstance(region, kind)), None)
    if shape is None:
        raise ValidationError(
            f"region '{region.name}': it is made of pixels and has no shape to be written; save its array as .npy"
        )
    numbers = {
        key: _from_si(np.asarray(getattr(region, field)).tolist(), factor)
        for key, (field, factor) in FIELDS.items()
        if hasattr(region, field)
    }
    return {"name": region.name, "shape": shape, **numbers}


def _from_si(value: Any, per_unit: Decimal) -> Any:
    """Return SI numbers, nested as they are, in the unit of a file: the shortest text that is read as the same one."""
    from tomlkit.items import Float, Trivia

    if isinstance(value, list):
        return [_from_si(item, per_unit) for item in value]
    exact = EXACT.multiply(Decimal(value), per_unit)
    rounded = (Context(prec=digits).create_decimal(exact) for digits in range(1, 25))
    text = f"{next(number for number in rounded if _to_si(number, per_unit) == value):f}"
    text = text if "." in text else f"{text}.0"
    return Float(float(text), Trivia(), text)
