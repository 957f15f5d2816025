"""Commands that tell what is there, presets and plugins, and where it comes from."""

import json
from dataclasses import asdict
from typing import Annotated, Any

import typer

from oatkit.cli.app import AsJson, Changes, command
from oatkit.errors import PluginError, ValidationError


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
def plugins(
    as_json: AsJson = False,
    check: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Load the plugins of one distribution, or of `all`, in a process of their own, where they can neither "
            "crash nor hang this one, and see whether they keep what users rely on (`oatkit.testing`).",
        ),
    ] = "",
    seconds: Annotated[
        float,
        typer.Option(min=0.1, help="How long --check waits for each distribution to load; checks have ten times that."),
    ] = 60.0,
) -> None:
    """List all plugins by kind; for a broken one, the reason.

    OATKIT_PLUGINS=none in the environment leaves out all that did not come with oatkit.
    """
    if check:
        _check(check, seconds, as_json)
        return
    from oatkit.registry import ALLOWED, allowed, distributions, installed

    rows = [entry.row() for entry in installed().entries]
    if as_json:
        typer.echo(json.dumps(rows, indent=2))
        return
    for row in sorted(rows, key=lambda r: (r["kind"] or "~", r["name"])):
        typer.echo(_line(row))
    left_out = [name for name in distributions() if not allowed(name)]
    if left_out:
        typer.echo(f"left out by {ALLOWED}: {', '.join(left_out)}")


def _check(name: str, seconds: float, as_json: bool) -> None:
    from oatkit.cli.trial import distributions_of, try_out

    trials = [try_out(distribution, seconds) for distribution in distributions_of(name)]
    if as_json:
        typer.echo(json.dumps([asdict(trial) for trial in trials], indent=2))
    for trial in trials if not as_json else ():
        for row in trial.rows:
            typer.echo(_line(row))
            for sentence in row.get("violations", ()):
                typer.echo(f"    {sentence}")
            if row.get("unchecked"):
                typer.echo(f"    not checked: {row['unchecked']}")
        if trial.problem:
            typer.echo(f"{'-':<14} {'-':<16} {trial.distribution}  broken: {trial.problem}")
    wrong = [trial.distribution for trial in trials if not trial.fine]
    if wrong:
        raise PluginError(f"not all plugins can be used: {', '.join(wrong)}")
    untrue = [trial.distribution for trial in trials if trial.violations]
    if untrue:
        raise PluginError(f"not all plugins keep their promises: {', '.join(untrue)}")


def _line(row: dict[str, Any]) -> str:
    problem = f"  {row['status']}: {row['problem']}" if row["problem"] else ""
    return f"{row['kind'] or '-':<14} {row['name']:<16} {row['distribution']} {row['version']}{problem}"


@command
def describe(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="A plugin's name, as `oatkit plugins` lists it, or a table of a pipeline: grid."
        ),
    ],
) -> None:
    """Print what a plugin does, its references and parameters.

    Each parameter with its type, unit, range and default.
    """
    from oatkit.describe import pipeline_tables, plugin_text, table_text
    from oatkit.names import did_you_mean
    from oatkit.registry import installed

    entries = [e for e in installed().entries if name in (e.name, e.full_name)]
    tables = pipeline_tables()
    if not entries and name not in tables:
        known = [*(e.name for e in installed().entries), *tables]
        raise ValidationError(f"no plugin and no table of a pipeline is named '{name}'{did_you_mean(name, known)}")
    if name in tables:
        typer.echo(table_text(name, tables[name]))
    for entry in entries:
        origin = f"{entry.distribution} {entry.version}"
        typer.echo(plugin_text(entry.cls, origin) if entry.cls else f"{entry.full_name}: {entry.problem}")


@command
def cite(
    pipeline: Annotated[
        str, typer.Argument(metavar="PIPELINE", help="A preset or a .toml file; without it, only oatkit itself.")
    ] = "",
    changes: Changes = [],  # noqa: B006 - typer wants a plain list
) -> None:
    """Print BibTeX of oatkit and of what a pipeline uses.

    Methods by the references of their plugins, spectra and tissues by those of their tables.
    """
    from oatkit.citing import bibtex
    from oatkit.pipeline import Pipeline

    typer.echo(bibtex(Pipeline.load(pipeline, changes) if pipeline else None))
