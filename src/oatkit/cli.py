"""The command line. Every command calls what a script would call.

Exit codes: 0 done, 1 the result could not be written, 2 usage or invalid pipeline, 3 some frames failed,
4 unreadable input, 130 interrupted.
"""

import functools
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from oatkit.errors import OatkitError, PluginError, ReadError, ResultError, SolverError, ValidationError

app = typer.Typer(
    name="oatkit",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Optoacoustic tomography: from a scan to a non-negative image. "
    "Start with `oatkit demo`, then `oatkit run maxent SCAN -o OUT.zarr` and `oatkit export OUT.zarr picture.png`.",
)

EXIT_CODES: dict[type[OatkitError], int] = {
    ResultError: 1, ValidationError: 2, PluginError: 2, SolverError: 3, ReadError: 4,
}  # fmt: skip
INTERRUPTED = 130

Command = Callable[..., Any]

ScanPath = Annotated[
    Path, typer.Argument(metavar="SCAN", readable=False, help="The scan: an iThera .msot file, or an oatkit .h5 scan.")
]
ResultPath = Annotated[Path, typer.Argument(metavar="OUT.zarr", help="A result that `oatkit run` has written.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is there already.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for other programs.")]
Changes = Annotated[
    list[str],
    typer.Option("--set", metavar="SLOT.KEY=VALUE", help="Change the pipeline: reconstruct.weight=0.01. Repeatable."),
]


def main() -> None:
    """Run the command line; asked to end, by SIGTERM or a closed terminal, it cleans up behind itself."""
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _terminate)
    app()


class Terminated(BaseException):
    """A signal asked the command to end; its number is the text."""


def _terminate(number: int, frame: Any) -> None:
    raise Terminated(number)


def command(function: Command) -> Command:
    """Register a command whose errors become one sentence and an exit code."""

    @functools.wraps(function)
    def guarded(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except OatkitError as error:
            if os.environ.get("OATKIT_DEBUG"):
                raise
            _complain(str(error))
            raise typer.Exit(next((code for kind, code in EXIT_CODES.items() if isinstance(error, kind)), 1)) from None
        except KeyboardInterrupt:
            _complain("interrupted")
            raise typer.Exit(INTERRUPTED) from None
        except Terminated as signalled:
            _complain("terminated")
            raise typer.Exit(128 + int(str(signalled))) from None
        except BrokenPipeError:
            # The reader of our output has gone (`oatkit info ... | head`): nothing is left to say.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(0) from None
        except OSError as error:
            if os.environ.get("OATKIT_DEBUG"):
                raise
            _complain(str(error))
            raise typer.Exit(1) from None

    return app.command(name=function.__name__.removesuffix("_"))(guarded)


def _complain(text: str) -> None:
    for line in text.splitlines():
        # Names from files must not steer the terminal.
        shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)
        typer.echo(f"oatkit: {shown}", err=True)


class Phantom(StrEnum):
    """The phantoms of `oatkit simulate`."""

    BREAST = "breast"
    DISC = "disc"
    STAR = "star"
    VESSEL = "vessel"


@command
def demo(
    folder: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Where to write.")] = Path(
        "oatkit-demo"
    ),
    overwrite: Overwrite = False,
) -> None:
    """Simulate a scan, reconstruct it three ways and compare them with the truth in one figure. Needs no network."""
    from oatkit.demo import run_demo

    start = time.perf_counter()
    for line in run_demo(folder, overwrite):
        typer.echo(line)
    typer.echo(f"done in {time.perf_counter() - start:.0f} s")


@command
def paper(
    experiment: Annotated[
        str, typer.Argument(metavar="EXPERIMENT", help="Its name; without it, the list of experiments.")
    ] = "",
    folder: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Where to write.")] = Path(
        "oatkit-paper"
    ),
    scan: Annotated[
        Path | None, typer.Option(metavar="SCAN", help="A real scan of a mouse, for fig5, fig6 and table1.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Repeat an experiment of Prakash et al. 2019: a figure, and a table of the paper's figures beside ours."""
    from oatkit.paper.experiments import EXPERIMENTS
    from oatkit.paper.running import run_experiment

    if not experiment:
        for name, what in EXPERIMENTS.items():
            typer.echo(f"{name:<10}{what}")
        return
    start = time.perf_counter()
    for line in run_experiment(experiment, folder, scan, overwrite):
        typer.echo(line)
    typer.echo(f"done in {time.perf_counter() - start:.0f} s")


@command
def info(scan: ScanPath, as_json: AsJson = False) -> None:
    """Print what is in a scan file, and where its speed of sound came from."""
    from oatkit.describe import scan_table, scan_text
    from oatkit.reading import read

    found = read(scan)
    typer.echo(json.dumps(scan_table(found), indent=2, allow_nan=False) if as_json else scan_text(found))


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
) -> None:
    """Run a pipeline over a scan and write the images, with how they came about, to a folder."""
    from oatkit.batch import run_frames
    from oatkit.pipeline import Pipeline
    from oatkit.progress import ProgressBar
    from oatkit.reading import read
    from oatkit.summary import summary

    start = time.perf_counter()
    loaded = Pipeline.load(pipeline, changes)
    found = read(scan)
    chosen = _frames(frames, found.frames)
    _check_new(output, overwrite)
    with ProgressBar(len(chosen)) as bar:
        result = run_frames(
            loaded, found, output, chosen, bar.show, on_frame=lambda frame: bar.next_frame(), overwrite=overwrite
        )
    for line in summary(result):
        typer.echo(line)
    typer.echo(f"wrote {output} in {time.perf_counter() - start:.1f} s")
    if result.failed:
        raise SolverError(f"{len(result.failed)} of {len(chosen)} frames failed")


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
    """Find the speed of sound that gives the sharpest image; to use it: --set scan.speed_of_sound_m_s=focus."""
    from oatkit.describe import focus_text
    from oatkit.focus import focus as find
    from oatkit.pipeline import Pipeline
    from oatkit.progress import ProgressBar
    from oatkit.reading import read

    if (lowest is None) != (highest is None):
        raise ValidationError("--lowest and --highest go together: give both, or neither")
    if figure is not None:
        _check_new(figure, overwrite)
    loaded, found = Pipeline.load(pipeline, changes), read(scan)
    speeds = None if lowest is None or highest is None else (lowest, highest)
    with ProgressBar() as bar:
        result = find(loaded, found, speeds_m_s=speeds, frame=frame, metric=metric, on_event=bar.show)
    typer.echo(json.dumps(result.table(), indent=2, allow_nan=False) if as_json else focus_text(result))
    if figure is not None:
        from oatkit.atomic import write_file
        from oatkit.focus_figure import focus_figure  # matplotlib
        from oatkit.page import png

        write_file(figure, png(focus_figure(result)), overwrite)
        typer.echo(f"wrote {figure}", err=as_json)


@command
def pipeline(
    preset_name: Annotated[
        str, typer.Argument(metavar="PRESET", help="Its name; without it, the list of presets.")
    ] = "",
) -> None:
    """Print a preset as TOML: save it, change it, run it."""
    from oatkit.pipeline import preset, presets

    if preset_name:
        typer.echo(preset(preset_name), nl=False)
        return
    for name, text in presets().items():
        typer.echo(f"{name:<28}{text.splitlines()[0].lstrip('# ')}")


@command
def plugins(as_json: AsJson = False) -> None:
    """List all plugins by kind; for a broken one, the reason."""
    from oatkit.registry import installed

    rows = [entry.row() for entry in installed().entries]
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
        return
    for row in sorted(rows, key=lambda r: (r["kind"] or "~", r["name"])):
        problem = f"  {row['status']}: {row['problem']}" if row["problem"] else ""
        typer.echo(f"{row['kind'] or '-':<14} {row['name']:<16} {row['distribution']} {row['version']}{problem}")


@command
def describe(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A plugin's name, as `oatkit plugins` lists it.")],
) -> None:
    """Print what a plugin does, its reference, and its parameters with type, unit, range and default."""
    from oatkit.api import KINDS
    from oatkit.describe import plugin_text
    from oatkit.names import did_you_mean
    from oatkit.registry import installed

    entries = [e for e in installed().entries if name in (e.name, e.full_name)]
    if not entries:
        known = [e.name for e in installed().entries]
        raise ValidationError(f"no plugin named '{name}' of any kind ({', '.join(KINDS)}){did_you_mean(name, known)}")
    for entry in entries:
        origin = f"{entry.distribution} {entry.version}"
        typer.echo(plugin_text(entry.cls, origin) if entry.cls else f"{entry.full_name}: {entry.problem}")


@command
def simulate(
    phantom: Annotated[Phantom, typer.Argument(help="What is imaged.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="SCAN.h5", help="The scan file to write.")],
    snr: Annotated[
        float, typer.Option(help="Signal to noise in dB, in the window that the field of view reaches.")
    ] = 32.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    overwrite: Overwrite = False,
) -> None:
    """Simulate a scan of a phantom on a finer grid than the one that reconstructs, and write it with the truth."""
    from oatkit.demo import simulated
    from oatkit.scanfile import write_scan

    _check_new(output, overwrite)
    scan, truth = simulated(phantom.value, snr, seed)
    write_scan(scan, output, truth, overwrite=overwrite)
    typer.echo(f"wrote {output}: {phantom.value} phantom, {snr:g} dB, seed {seed}")


@command
def export(
    result: ResultPath,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Ends in .png (figure), .ome.tif or .h5.")],
    frame: Annotated[int | None, typer.Option(help="Which frame of the result; else the first one.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the images of a result as a figure, an OME-TIFF or an HDF5 file."""
    from oatkit.export import export as write

    _check_new(file, overwrite)
    write(_stored(result, frame), file, overwrite=overwrite)
    typer.echo(f"wrote {file}")


@command
def verify(result: ResultPath) -> None:
    """Check that a result is complete and that no bit of it has changed."""
    from oatkit.store import verify as problems_of

    found = problems_of(result)
    for problem in found:
        _complain(problem)
    if found:
        raise typer.Exit(EXIT_CODES[ReadError])
    typer.echo(f"{result}: complete, all checksums right")


def _check_new(path: Path, overwrite: bool) -> None:
    """Refuse, before any work is done, to write over what is there."""
    if os.path.lexists(path) and not overwrite:
        raise ValidationError(f"{path}: exists already; choose another name or add --overwrite")


def _stored(path: Path, frame: int | None) -> Any:
    """Read one frame of a result, the first good one unless said; a damaged result is unreadable input."""
    from oatkit.store import load

    try:
        stored = load(path)
        chosen = stored if frame is None else stored.frame(frame)
        return replace(chosen, images=dict(chosen))
    except ResultError as error:
        raise ReadError(str(error)) from None


def _frames(text: str, count: int) -> list[int]:
    """Read ``A:B``, ``A:B:C`` or ``N``. Raises `ValidationError` for anything else and for an empty choice."""
    try:
        numbers = [int(part) if part else None for part in text.split(":")]
        one = len(numbers) == 1
        chosen = [range(count)[numbers[0]]] if one else list(range(count)[slice(*numbers)])  # type: ignore[index]
    except (ValueError, IndexError, TypeError):
        chosen = []
    if not chosen:
        raise ValidationError(f"--frames {text}: expected A:B or one number within the scan's frames 0 .. {count - 1}")
    return chosen
