"""How the parts of a new package are called, all of them made from the one name that its author gives."""

import importlib.util
import keyword
import re
from dataclasses import dataclass

import oatkit.api
from oatkit.api import KINDS
from oatkit.errors import ValidationError
from oatkit.names import did_you_mean
from oatkit.registry import installed

PREFIX = "oatkit-"
"""May stand before the name of a package, and is then no part of the plugin's."""


@dataclass(frozen=True)
class Names:
    """The names of a new package and of the plugin in it."""

    kind: str
    """One of `oatkit.api.KINDS`."""
    package: str
    """``oatkit-my-method``"""
    module: str
    """``oatkit_my_method``"""
    plugin: str
    """``my-method``"""
    cls: str
    """``MyMethod``"""

    @property
    def base(self) -> str:
        """The class in `oatkit.api` that the plugin is derived from."""
        return KINDS[self.kind].__name__

    @property
    def hook(self) -> str:
        """The hook that returns it."""
        return f"oatkit_{self.kind}s"


def names_of(package: str, kind: str) -> Names:
    """Return the names that follow from the name of a package and a kind, ``forward-model`` or ``forward_model``.

    Raises `ValidationError` for an unknown kind and a name that cannot be one, that stands for something Python can
    import already, or that would make a plugin named like one of the same kind that is installed.
    """
    kind = kind.replace("-", "_")
    if kind not in KINDS:
        raise ValidationError(f"no plugin kind named '{kind}'{did_you_mean(kind, KINDS)}")
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", package):
        raise ValidationError(
            f"'{package}' is no name for a package: small letters, digits and single hyphens, a letter first, as in "
            "oatkit-my-method"
        )
    names = Names(kind, package, package.replace("-", "_"), package.removeprefix(PREFIX), _class_name(package))
    if keyword.iskeyword(names.module) or importlib.util.find_spec(names.module):
        raise ValidationError(
            f"{package}: 'import {names.module}' means something else here; take another name, as in "
            f"{PREFIX}{package.removeprefix(PREFIX)}-2"
        )
    twins = [e.distribution for e in installed().entries if (e.kind, e.name) == (kind, names.plugin)]
    if twins:
        raise ValidationError(
            f"{package}: {' and '.join(twins)} has a {kind.replace('_', ' ')} named '{names.plugin}'; take another name"
        )
    return names


def _class_name(package: str) -> str:
    """Return ``MyMethod`` for ``oatkit-my-method``, with a word before it where that would mean something else."""
    joined = "".join(part.capitalize() for part in package.removeprefix(PREFIX).split("-"))
    taken = keyword.iskeyword(joined) or hasattr(oatkit.api, joined)
    return joined if joined.isidentifier() and not taken else f"My{joined}"
