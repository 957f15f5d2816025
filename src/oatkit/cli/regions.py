"""The command that measures regions of interest."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from oatkit.cli.app import AsJson, Overwrite, RegionFiles, ResultPath, check_new, command
from oatkit.cli.opening import damage_is_unreadable, regions_in
from oatkit.errors import ValidationError


@command
def roi(
    result: ResultPath,
    regions: RegionFiles = [],  # noqa: B006 - typer wants a plain list
    rim: Annotated[
        float | None, typer.Option(metavar="MM", help="Also the rim of the body, from its surface to this depth.")
    ] = None,
    core: Annotated[
        float | None, typer.Option(metavar="MM", help="Also what lies deeper than this below the body's surface.")
    ] = None,
    background: Annotated[
        str | None, typer.Option(metavar="NAME", help="The region against which the CNR of the others is taken.")
    ] = None,
    frame: Annotated[int | None, typer.Option(help="Which frame of the result; else all of them.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="TABLE.csv", help="Write the table into this file.")
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="SPECTRA.png", help="Draw the spectra of the first frame into this file.")
    ] = None,
    as_json: AsJson = False,
    overwrite: Overwrite = False,
) -> None:
    """Measure regions of interest in the images of a result.

    Prints mean, spread, negative pixels and CNR for each region, image, wavelength and frame.
    """
    from oatkit.plain import encode
    from oatkit.regions import region_table, write_csv
    from oatkit.regions.text import table_text
    from oatkit.store import load

    for path in filter(None, (output, figure)):
        check_new(path, overwrite)
    with damage_is_unreadable():
        images = load(result)
        chosen = [*regions_in(regions, images), *_of_body(rim, core)]
        if not chosen:
            raise ValidationError("no region: give files of them with -r, or --rim or --core")
        rows = region_table(images, chosen, background, None if frame is None else [frame])
    picture = b"" if figure is None else _spectra(rows)
    if as_json:
        typer.echo(json.dumps([encode(asdict(row)) for row in rows], indent=2, allow_nan=False))
    elif output is None:
        typer.echo(table_text(rows))
    if output is not None:
        write_csv(rows, output, overwrite)
        typer.echo(f"wrote {output}: {len(rows)} rows", err=as_json)
    if figure is not None:
        from oatkit.atomic import write_file

        write_file(figure, picture, overwrite)
        typer.echo(f"wrote {figure}", err=as_json)


def _of_body(rim_mm: float | None, core_mm: float | None) -> list[Any]:
    """Return what makes rim and core, as far as they are asked for, of the images of a frame."""
    from oatkit.regions import core, rim

    def of_boundary(make: Callable[..., Any], depth_mm: float, images: Mapping[str, Any]) -> Any:
        if "boundary" not in images:
            raise ValidationError("--rim and --core need the outline of the body: a pipeline with a [segment] step")
        return make(images["boundary"], 1e-3 * depth_mm)

    asked = [(make, depth) for make, depth in ((rim, rim_mm), (core, core_mm)) if depth is not None]
    for make, depth in asked:
        if not 1e-3 <= depth <= 1000:
            raise ValidationError(f"--{make.__name__} {depth:g}: expected a depth of 0.001 .. 1000 mm")
    return [partial(of_boundary, make, depth) for make, depth in asked]


def _spectra(rows: Sequence[Any]) -> bytes:
    """Draw the spectra of the first frame in a table."""
    from oatkit.drawing.page import png
    from oatkit.regions.spectra import spectra_figure  # matplotlib

    return png(spectra_figure([row for row in rows if row.frame == rows[0].frame]))
