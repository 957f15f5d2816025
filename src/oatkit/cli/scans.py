"""Commands on scans."""

import json
import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from oatkit.cli.app import AsJson, Changes, Overwrite, ScanPath, check_new, command, complain, frames_in
from oatkit.errors import SolverError, ValidationError


class Phantom(StrEnum):
    """The phantoms of `oatkit simulate`."""

    BREAST = "breast"
    DISC = "disc"
    OXYGEN = "oxygen"
    STAR = "star"
    VESSEL = "vessel"


@command
def info(scan: ScanPath, as_json: AsJson = False) -> None:
    """Print what is in a scan file, and what lies beside it.

    It says where the speed of sound came from, and lists stored images and regions.
    """
    from oatkit.describe import look_beside, scan_table, scan_text
    from oatkit.reading import read

    found, more = read(scan), look_beside(scan)
    typer.echo(json.dumps(scan_table(found, more), indent=2, allow_nan=False) if as_json else scan_text(found, more))


@command
def run(
    pipeline: Annotated[
        str, typer.Argument(metavar="PIPELINE", help="A preset's name (maxent, lsqr, ...) or a .toml.")
    ],
    scan: ScanPath,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.zarr", help="The folder to write.")],
    changes: Changes = [],  # noqa: B006 - typer wants a plain list
    frames: Annotated[str, typer.Option(metavar="A:B", help="Which frames, as a Python slice, or one number.")] = ":",
    overwrite: Overwrite = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a run that was interrupted; start where there was none.")
    ] = False,
    engine: Annotated[
        str, typer.Option(metavar="NAME", help="Who runs the frames: serial, processes or dask.")
    ] = "serial",
    workers: Annotated[
        int | None, typer.Option(help="How many, for processes and dask; else one for each core.")
    ] = None,
    scheduler: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Of a dask cluster; else one is started on this machine.")
    ] = "",
    shard: Annotated[
        str,
        typer.Option(
            metavar="I/N", help="Run only every N-th frame, from the I-th: for job arrays. See `oatkit join`."
        ),
    ] = "",
) -> None:
    """Run a pipeline over a scan and write its images.

    The folder that is written also holds how they came about.
    """
    from oatkit.batch import engine_named, run_frames, shard_of
    from oatkit.cli.progress import ProgressBar
    from oatkit.cli.summary import summary
    from oatkit.pipeline import Pipeline
    from oatkit.reading import read

    start = time.perf_counter()
    loaded = Pipeline.load(pipeline, changes)
    found = read(scan)
    chosen = frames_in(frames, found.frames)
    chosen = shard_of(chosen, shard) if shard else chosen
    by = engine_named(engine, workers, scheduler)
    check_new(output, overwrite or resume)
    complete = resume and not overwrite and output.exists()
    with ProgressBar(len(chosen)) as bar:
        result = run_frames(
            loaded, found, output, chosen, bar.show, lambda _: bar.next_frame(), overwrite, resume=resume, engine=by
        )
    for line in summary(result):
        typer.echo(line)
    done = f"wrote {output} in {time.perf_counter() - start:.1f} s"
    typer.echo(f"{output} was complete already" if complete else done)
    for reason in result.failed.values():
        complain(reason)
    if result.failed:
        raise SolverError(f"{len(result.failed)} of {result.frames} frames failed")


@command
def motion(
    scan: ScanPath,
    figure: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.png", help="Draw the curve into this file.")
    ] = None,
    as_json: AsJson = False,
    overwrite: Overwrite = False,
) -> None:
    """Find pulses out of place, by breathing or otherwise.

    To leave such frames out: oatkit run --set motion.leave_out=true.
    """
    from oatkit.describe import motion_text
    from oatkit.motion import find_motion
    from oatkit.reading import read

    if figure is not None:
        check_new(figure, overwrite)
    found = find_motion(read(scan))
    typer.echo(json.dumps(found.table(), indent=2, allow_nan=False) if as_json else motion_text(found))
    if figure is not None:
        from oatkit.motion.figure import motion_figure  # matplotlib

        _draw(motion_figure(found), figure, as_json, overwrite)


@command
def focus(
    scan: ScanPath,
    pipeline: Annotated[
        str, typer.Option(metavar="PIPELINE", help="Whose preprocessing, grid and acoustic model are used.")
    ] = "maxent",
    changes: Changes = [],  # noqa: B006 - typer wants a plain list
    metric: Annotated[str, typer.Option(metavar="NAME", help="The measure of sharpness that decides.")] = "variance",
    lowest: Annotated[float | None, typer.Option(help="Lowest speed to try, m/s.")] = None,
    highest: Annotated[float | None, typer.Option(help="Highest speed to try, m/s.")] = None,
    frame: Annotated[int, typer.Option(min=0, help="Which frame.")] = 0,
    figure: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.png", help="Draw the curves into this file.")
    ] = None,
    as_json: AsJson = False,
    overwrite: Overwrite = False,
) -> None:
    """Find the speed of sound that gives the sharpest image.

    To use it: oatkit run --set scan.speed_of_sound_m_s=focus.
    """
    from oatkit.cli.progress import ProgressBar
    from oatkit.describe import focus_text
    from oatkit.focus import focus as find
    from oatkit.pipeline import Pipeline
    from oatkit.reading import read

    if (lowest is None) != (highest is None):
        raise ValidationError("--lowest and --highest go together: give both, or neither")
    if figure is not None:
        check_new(figure, overwrite)
    loaded, found = Pipeline.load(pipeline, changes), read(scan)
    speeds = None if lowest is None or highest is None else (lowest, highest)
    with ProgressBar() as bar:
        result = find(loaded, found, speeds_m_s=speeds, frame=frame, metric=metric, on_event=bar.show)
    typer.echo(json.dumps(result.table(), indent=2, allow_nan=False) if as_json else focus_text(result))
    if figure is not None:
        from oatkit.focus.figure import focus_figure  # matplotlib

        _draw(focus_figure(result), figure, as_json, overwrite)


@command
def simulate(
    phantom: Annotated[
        Phantom,
        typer.Argument(
            metavar="PHANTOM", help="What is imaged; oxygen: vessels in a body that dims its light, 680 .. 900 nm."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="SCAN.h5", help="The scan file to write.")],
    snr: Annotated[
        float, typer.Option(help="Signal to noise in dB, in the window that the field of view reaches.")
    ] = 32.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise, and of the body where it is drawn.")] = 0,
    frames: Annotated[int, typer.Option(min=1, help="How many, each with noise of its own.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Simulate a scan of a phantom, and write it with the truth.

    It is simulated on a finer grid than the one that reconstructs.
    """
    from oatkit.demo import simulated, simulated_oxygen
    from oatkit.scanfile import write_scan

    if output.suffix.lower() != ".h5":
        raise ValidationError(f"{output}: the name must end in .h5; `oatkit convert` then writes other formats")
    check_new(output, overwrite)
    if phantom is Phantom.OXYGEN:
        scan, truths = simulated_oxygen(snr, seed, frames)
    else:
        scan, truth = simulated(phantom.value, snr, seed, frames)
        truths = [truth]
    write_scan(scan, output, truths, overwrite=overwrite)
    typer.echo(f"wrote {output}: {phantom.value} phantom, {snr:g} dB, seed {seed}")
    if phantom is Phantom.OXYGEN:
        # The preset is for scanners, whose light comes through water; K is 1 here, and found only without that.
        clear = "--set fluence.ring_radius="
        typer.echo(f"note: the water takes no light here: oatkit run multispectral {output} -o OUT.zarr {clear}")


@command
def convert(
    scan: ScanPath,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What to write; its ending says in which format.")],
    overwrite: Overwrite = False,
) -> None:
    """Write a scan in another format.

    An ending .h5 gives the scan file of oatkit, .hdf5 gives IPASC.
    """
    from oatkit.convert import convert as write
    from oatkit.reading import read

    check_new(file, overwrite)
    notes = write(read(scan), file, overwrite)
    typer.echo(f"wrote {file}")
    for note in notes:
        typer.echo(f"note: {note}")


def _draw(drawn: Any, file: Path, as_json: bool, overwrite: bool) -> None:
    """Write a figure as a PNG file, and say so where it does not mix with JSON."""
    from oatkit.atomic import write_file
    from oatkit.drawing.page import png

    write_file(file, png(drawn), overwrite)
    typer.echo(f"wrote {file}", err=as_json)
