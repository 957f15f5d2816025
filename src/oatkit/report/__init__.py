"""A report: one HTML page of a result, complete in itself, for a browser or a printer.

Everything is inline, nothing is fetched, and the page works without JavaScript. Importing this module raises
`ResultError` where jinja2 or matplotlib, the extra ``report``, is not installed.
"""

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from oatkit.atomic import check_output, write_file
from oatkit.drawing.page import PERCENTILE
from oatkit.drawing.plot import COLOURS
from oatkit.errors import ResultError, ValidationError
from oatkit.regions.table import RegionOf
from oatkit.report.content import content_of
from oatkit.result import Result

try:
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup
except ImportError as error:
    raise ResultError('a report needs jinja2, which is not installed: pip install "oatkit[report]"') from error

__all__ = ["report_page", "write_report"]


def write_report(
    result: Result,
    path: str | Path,
    frame: int | None = None,
    regions: Sequence[RegionOf] = (),
    overwrite: bool = False,
) -> None:
    """Write one frame of a result as an HTML page; without `frame`, the one that it shows.

    `regions` are drawn over the images, and what lies in them is listed and plotted. Raises `ValidationError` where
    the name does not end in .html, there is no such frame or a region does not fit the images, and `ResultError` where
    the frame failed or is damaged, or the page cannot be written.
    """
    if Path(path).suffix.lower() != ".html":
        raise ValidationError(f"{path}: the name must end in .html")
    inputs = [str(result.scan.get("source", "")), *([str(result.stored.path)] if result.stored else [])]
    check_output(Path(path), inputs, overwrite)
    write_file(Path(path), report_page(result, frame, regions).encode("utf-8", "backslashreplace"), overwrite)


def report_page(result: Result, frame: int | None = None, regions: Sequence[RegionOf] = ()) -> str:
    """Return the page that `write_report` writes."""
    shown = result if frame is None else _frame(result, frame)
    script = _text("script.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    template = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return template.from_string(_text("template.html.j2")).render(
        page=content_of(shown, regions),
        style=Markup(_text("style.css")),
        script=Markup(script),
        script_hash=f"sha256-{digest}",
        colours=COLOURS,
        percentile=PERCENTILE,
        drawn=[],
    )


def _frame(result: Result, index: int) -> Result:
    """Return one frame that still knows the others."""
    return replace(result.frame(index), stored=result.stored)


def _text(name: str) -> str:
    return files("oatkit.report").joinpath(name).read_text(encoding="utf-8")
