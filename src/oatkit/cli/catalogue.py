"""Commands that tell what is there: presets and plugins."""

import json
from typing import Annotated

import typer

from oatkit.cli.app import AsJson, command
from oatkit.errors import ValidationError


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
