"""The table of regions as aligned lines, for a reader's eyes."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from oatkit.hostile import printable
from oatkit.regions.table import RegionRow


class Column(NamedTuple):
    """One column: its heading, whether it is set to the left or to the right, and its text in a row."""

    heading: str
    side: str
    text: Callable[[RegionRow], str]


def table_text(rows: Sequence[RegionRow]) -> str:
    """Return rows as lines under a line of headings, with a column of frames where there are several, and the notes."""
    columns = COLUMNS if len({row.frame for row in rows}) > 1 else COLUMNS[1:]
    cells = [[c.heading for c in columns], *([c.text(row) for c in columns] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    formats = [f"{{:{c.side}{width}}}" for c, width in zip(columns, widths, strict=True)]
    lines = ["  ".join(formats).format(*line).rstrip() for line in cells]
    notes = dict.fromkeys(f"note: {printable(row.region)} in {row.image}: {row.note}" for row in rows if row.note)
    return "\n".join([*lines, *notes])


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f} %"


COLUMNS = (
    Column("frame", ">", lambda row: str(row.frame)),
    Column("image", "<", lambda row: f"{row.image} ({row.unit})" if row.unit else row.image),
    Column("region", "<", lambda row: printable(row.region, 40)),
    Column("nm", ">", lambda row: _number(row.wavelength_nm)),
    Column("pixels", ">", lambda row: str(row.pixels)),
    Column("mm²", ">", lambda row: _number(row.area_mm2)),
    Column("mean", ">", lambda row: _number(row.mean)),
    Column("std", ">", lambda row: _number(row.std)),
    Column("median", ">", lambda row: _number(row.median)),
    Column("min", ">", lambda row: _number(row.min)),
    Column("max", ">", lambda row: _number(row.max)),
    Column("negative", ">", lambda row: _share(row.negative_share)),
    Column("undefined", ">", lambda row: _share(row.undefined_share)),
    Column("CNR", ">", lambda row: _number(row.cnr)),
)
