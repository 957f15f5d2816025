"""The files of a new package."""

import os
import tempfile
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from string import Template

from oatkit.api import API_VERSION
from oatkit.errors import ValidationError
from oatkit.scaffold.naming import Names, names_of


def new_plugin(package: str, kind: str, folder: str | Path = ".") -> Path:
    """Write a package with a plugin of a kind into a new folder in `folder`, and return that new folder.

    The plugin is a small right method of its kind, to be replaced. Raises `ValidationError` for a name that cannot be
    taken (see `oatkit.scaffold.naming.names_of`), where something has it already, and where nothing can be written.
    """
    names = names_of(package, kind)
    target = Path(folder) / package
    if os.path.lexists(target):
        raise ValidationError(f"{target}: exists already; choose another name or another folder")
    try:
        _write(names, target)
    except OSError as error:
        raise ValidationError(f"{target}: cannot be written: {error.strerror or error}") from None
    return target


def _write(names: Names, target: Path) -> None:
    """Write all files into a folder beside the target, which then takes its name: half a package is never there."""
    with tempfile.TemporaryDirectory(prefix=f".{names.package}-", dir=target.parent) as draft:
        package = Path(draft) / names.package
        for path, text in _files(names):
            file = package / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        package.rename(target)


def _files(names: Names) -> Iterator[tuple[str, str]]:
    """Yield the path and the text of each file of the package."""
    source = f"src/{names.module}"
    yield "pyproject.toml", _filled(names, "pyproject.toml")
    yield "README.md", _filled(names, "README.md", use=_filled(names, f"{names.kind}/use.md"))
    yield f"{source}/__init__.py", _filled(names, "init.py")
    yield f"{source}/plugin.py", _filled(names, f"{names.kind}/plugin.py")
    yield f"{source}/py.typed", ""
    yield f"tests/test_{names.module}.py", _filled(names, f"{names.kind}/test.py")


def _filled(names: Names, template: str, **more: str) -> str:
    """Return a template with the names put in."""
    text = files("oatkit.scaffold").joinpath("templates", f"{template}.txt").read_text(encoding="utf-8")
    words = {
        "package": names.package,
        "module": names.module,
        "plugin": names.plugin,
        "cls": names.cls,
        "kind": names.kind,
        "kind_words": names.kind.replace("_", " "),
        "base": names.base,
        "hook": names.hook,
        "api": f"({API_VERSION[0]}, {API_VERSION[1]})",
        "api_words": ".".join(map(str, API_VERSION)),
    }
    return Template(text).substitute(words, **more)
