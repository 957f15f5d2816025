"""Commands on results."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from oatkit.cli.app import (
    EXIT_CODES,
    AsJson,
    Overwrite,
    RegionFiles,
    ResultPath,
    check_new,
    command,
    complain,
    frames_in,
)
from oatkit.errors import ReadError, ResultError, ValidationError

Baseline = Annotated[str, typer.Option(metavar="A:B", help="Frames of the state before, as a Python slice.")]


@command
def export(
    result: ResultPath,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Ends in .png (figure), .ome.tif or .h5.")],
    frame: Annotated[int | None, typer.Option(help="Which frame of the result; else the first one.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the images of a result as a figure, an OME-TIFF or an HDF5 file."""
    from oatkit.export import export as write

    check_new(file, overwrite)
    write(_stored(result, frame), file, overwrite=overwrite)
    typer.echo(f"wrote {file}")


@command
def report(
    result: ResultPath,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.html", help="The page to write.")],
    regions: RegionFiles = [],  # noqa: B006 - typer wants a plain list
    frame: Annotated[int | None, typer.Option(help="Which frame of the result; else the first one.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write one page of a result for a browser or a printer: images, spectra, certificates, pipeline, provenance."""
    from oatkit.report import write_report
    from oatkit.store import load

    check_new(output, overwrite)
    shown = _stored(result, frame)
    chosen = _of_files(regions, shown)
    write_report(replace(shown, stored=load(result).stored), output, regions=chosen, overwrite=overwrite)
    typer.echo(f"wrote {output}")


@command
def verify(result: ResultPath) -> None:
    """Check that a result is complete and that no bit of it has changed."""
    from oatkit.store import verify as problems_of

    found = problems_of(result)
    for problem in found:
        complain(problem)
    if found:
        raise typer.Exit(EXIT_CODES[ReadError])
    typer.echo(f"{result}: complete, all checksums right")


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
    """Print mean, spread, negative pixels and CNR of regions of interest, for each image, wavelength and frame."""
    from oatkit.plain import encode
    from oatkit.region_table import region_table, write_csv
    from oatkit.region_text import table_text
    from oatkit.store import load

    for path in filter(None, (output, figure)):
        check_new(path, overwrite)
    with _damage_is_unreadable():
        images = load(result)
        chosen = [*_of_files(regions, images), *_of_body(rim, core)]
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


@command
def challenge(
    result: ResultPath,
    baseline: Baseline,
    challenge: Annotated[str, typer.Option(metavar="C:D", help="Frames of the second state, as a Python slice.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="CHANGE.zarr", help="The folder to write.")],
    image: Annotated[str, typer.Option(metavar="NAME", help="Which image of the result.")] = "so2",
    overwrite: Overwrite = False,
) -> None:
    """Write how an image differs between two states, as in a gas challenge: means, change and its standard error."""
    from oatkit.kinetics import gas_challenge
    from oatkit.store import load

    check_new(output, overwrite)
    with _damage_is_unreadable():
        stored = load(result)
        before = frames_in(baseline, stored.frames, "--baseline", "result")
        after = frames_in(challenge, stored.frames, "--challenge", "result")
        changed = gas_challenge(stored, before, after, image)
    _write_maps(changed, output, result, overwrite)


@command
def kinetics(
    result: ResultPath,
    image: Annotated[str, typer.Option(metavar="NAME", help="Which image of the result.")],
    baseline: Baseline,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="MAPS.zarr", help="The folder to write.")],
    regions: RegionFiles = [],  # noqa: B006 - typer wants a plain list
    curves: Annotated[
        Path | None, typer.Option(metavar="CURVES.csv", help="Write the curves of the regions into this file.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write what an image does after a baseline: peak, time to peak, area under the curve, wash-in, by pixel."""
    from oatkit.atomic import write_file
    from oatkit.kinetics import contrast_kinetics
    from oatkit.region_curves import curve_text, curves_csv, region_curves
    from oatkit.store import load

    if curves is not None and not regions:
        raise ValidationError("--curves needs regions: give files of them with -r")
    for path in filter(None, (output, curves)):
        check_new(path, overwrite)
    with _damage_is_unreadable():
        stored = load(result)
        before = frames_in(baseline, stored.frames, "--baseline", "result")
        chosen = _of_files(regions, stored)
        maps = contrast_kinetics(stored, image, before)
        found = region_curves(stored, image, before, chosen) if chosen else ()
    _write_maps(maps, output, result, overwrite)
    for curve in found:
        typer.echo(curve_text(curve))
    if curves is not None:
        write_file(curves, curves_csv(found).encode(), overwrite)
        typer.echo(f"wrote {curves}")


def _write_maps(maps: Any, output: Path, source: Path, overwrite: bool) -> None:
    """Write what was made of a result, which it may not touch, and say what to know of it."""
    from oatkit.atomic import check_output

    check_output(output, [str(source)], overwrite)
    maps.save(output, overwrite)
    for note in maps.warnings:
        typer.echo(f"note: {note}")
    typer.echo(f"wrote {output}: {', '.join(maps)}")


def _of_files(files: Sequence[Path], images: Mapping[str, Any]) -> list[Any]:
    """Read the regions in files; a mask lies on the grid of the first of the images."""
    from oatkit.region_files import load_regions

    grid = next(iter(images.values())).grid
    return [region for file in files for region in load_regions(file, grid)]


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
    from oatkit.page import png
    from oatkit.spectra_figure import spectra_figure  # matplotlib

    return png(spectra_figure([row for row in rows if row.frame == rows[0].frame]))


@contextmanager
def _damage_is_unreadable() -> Iterator[None]:
    """Make a damaged result what it is to a command: unreadable input."""
    try:
        yield
    except ResultError as error:
        raise ReadError(str(error)) from None


def _stored(path: Path, frame: int | None) -> Any:
    """Read one frame of a result, the first good one unless said; a damaged result is unreadable input."""
    from oatkit.store import load

    with _damage_is_unreadable():
        stored = load(path)
        chosen = stored if frame is None else stored.frame(frame)
        return replace(chosen, images=dict(chosen))
