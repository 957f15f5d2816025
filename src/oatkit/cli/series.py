"""Commands on many frames of a result as a series in time."""

from pathlib import Path
from typing import Annotated, Any

import typer

from oatkit.cli.app import Overwrite, RegionFiles, ResultPath, check_new, command, frames_in
from oatkit.cli.opening import damage_is_unreadable, regions_in
from oatkit.errors import ValidationError

Baseline = Annotated[str, typer.Option(metavar="A:B", help="Frames of the state before, as a Python slice.")]


@command
def challenge(
    result: ResultPath,
    baseline: Baseline,
    challenge: Annotated[str, typer.Option(metavar="C:D", help="Frames of the second state, as a Python slice.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="CHANGE.zarr", help="The folder to write.")],
    image: Annotated[str, typer.Option(metavar="NAME", help="Which image of the result.")] = "so2",
    overwrite: Overwrite = False,
) -> None:
    """Write how an image differs between two states of the body.

    As in a gas challenge: the means, their difference and its standard error, by pixel.
    """
    from oatkit.kinetics import gas_challenge
    from oatkit.store import load

    check_new(output, overwrite)
    with damage_is_unreadable():
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
    """Write what an image does over time, after a baseline.

    Peak, time to peak, area under the curve and wash-in, by pixel.
    """
    from oatkit.atomic import write_file
    from oatkit.kinetics import contrast_kinetics, curve_text, curves_csv, region_curves
    from oatkit.store import load

    if curves is not None and not regions:
        raise ValidationError("--curves needs regions: give files of them with -r")
    for path in filter(None, (output, curves)):
        check_new(path, overwrite)
    with damage_is_unreadable():
        stored = load(result)
        before = frames_in(baseline, stored.frames, "--baseline", "result")
        chosen = regions_in(regions, stored)
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
