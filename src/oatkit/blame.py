"""Whose fault it is: what a plugin raises becomes an error that names it."""

from collections.abc import Iterator
from contextlib import contextmanager

from oatkit.errors import OatkitError, PluginError
from oatkit.parameters import Parameters


@contextmanager
def blame(plugin: Parameters) -> Iterator[None]:
    """Turn any exception that is not ours into a `PluginError` that names the plugin; ours pass as they are."""
    try:
        yield
    except OatkitError:
        raise
    except (Exception, SystemExit) as error:
        kind = plugin.kind.replace("_", " ")
        raise PluginError(f"{kind} '{plugin.name}' failed: {type(error).__name__}: {error}") from error
