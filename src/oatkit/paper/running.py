"""Running one experiment, from its name to the files that it writes."""

from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from oatkit.errors import ResultError, ValidationError
from oatkit.names import did_you_mean
from oatkit.paper.experiments import EXPERIMENTS


def run_experiment(name: str, folder: Path, scan: Path | None = None, overwrite: bool = False) -> Iterator[str]:
    """Run one experiment, write ``NAME.png`` and ``NAME.md`` into `folder`, and yield a line for each thing done.

    `scan` is a real scan of a mouse for the experiments on one. Raises `ValidationError` for an unknown name
    or files that are there already, unless `overwrite`.
    """
    if name not in EXPERIMENTS:
        raise ValidationError(f"no experiment named '{name}'{did_you_mean(name, EXPERIMENTS)}")
    there = [str(path) for ending in (".png", ".md") if (path := folder / f"{name}{ending}").exists()]
    if there and not overwrite:
        raise ValidationError(f"{there[0]}: exists already; choose another folder with -o or add --overwrite")
    module = import_module(f"oatkit.paper.{name}")
    setting = replace(module.SETTING, scan=scan)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"{folder}: cannot be made: {error.strerror}") from None
    for item in getattr(module, name)(setting):
        if isinstance(item, str):
            yield item
            continue
        yield from ("", *item.markdown().splitlines(), "")
        for path in item.write(folder, overwrite):
            yield f"wrote {path}"
