"""Commands on results as a whole."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from oatkit.cli.app import EXIT_CODES, Overwrite, RegionFiles, ResultPath, check_new, command, complain
from oatkit.cli.opening import regions_in, stored_frame
from oatkit.errors import ReadError


@command
def export(
    result: ResultPath,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Ends in .png (figure), .ome.tif or .h5.")],
    frame: Annotated[int | None, typer.Option(help="Which frame of the result; else the first one.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a result as a figure, an OME-TIFF or an HDF5 file."""
    from oatkit.export import export as write

    check_new(file, overwrite)
    write(stored_frame(result, frame), file, overwrite=overwrite)
    typer.echo(f"wrote {file}")


@command
def report(
    result: ResultPath,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.html", help="The page to write.")],
    regions: RegionFiles = [],  # noqa: B006 - typer wants a plain list
    frame: Annotated[int | None, typer.Option(help="Which frame of the result; else the first one.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write one page of a result, for a browser or a printer.

    It has images, spectra, certificates, the pipeline and where all of it came from.
    """
    from oatkit.report import write_report
    from oatkit.store import load

    check_new(output, overwrite)
    shown = stored_frame(result, frame)
    chosen = regions_in(regions, shown)
    write_report(replace(shown, stored=load(result).stored), output, regions=chosen, overwrite=overwrite)
    typer.echo(f"wrote {output}")


@command
def join(
    results: Annotated[list[Path], typer.Argument(metavar="PART.zarr ...", help="Results of the shards of one run.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.zarr", help="The folder to write.")],
    overwrite: Overwrite = False,
) -> None:
    """Join the results of `oatkit run --shard I/N` into one.

    Its frames stand in the order of the scan.
    """
    from oatkit.batch import join as joined

    check_new(output, overwrite)
    whole = joined(results, output, overwrite)
    typer.echo(f"wrote {output}: {whole.frames} frames")


@command
def verify(result: ResultPath) -> None:
    """Check that a result is complete and no bit of it has changed."""
    from oatkit.store import verify as problems_of

    found = problems_of(result)
    for problem in found:
        complain(problem)
    if found:
        raise typer.Exit(EXIT_CODES[ReadError])
    typer.echo(f"{result}: complete, all checksums right")
