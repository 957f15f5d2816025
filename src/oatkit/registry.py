"""Which plugins are installed, by kind and name, and what is wrong with those that could not be loaded.

Every plugin comes through an entry point of the group ``oatkit``, ours like anybody's. Each is loaded and asked in a
guard of its own, so that a broken one is listed with its reason and the rest works.
"""

import inspect
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import pluggy

from oatkit import hookspecs
from oatkit.api import API_VERSION, KINDS, Plugin
from oatkit.errors import PluginError, ValidationError
from oatkit.names import did_you_mean

GROUP = "oatkit"
"""Of entry points."""
ALLOWED = "OATKIT_PLUGINS"
"""The environment variable that says whose plugins are loaded."""
OURS = "oatkit"
"""The distribution whose plugins cannot be shadowed."""


@dataclass(frozen=True)
class Entry:
    """One plugin, or one entry point that yields none."""

    kind: str | None
    """One of `oatkit.api.KINDS`; None where the entry point itself is broken."""
    name: str
    """The plugin's name, or the entry point's where that is broken."""
    distribution: str
    version: str
    status: str = "ok"
    """``"ok"``, ``"broken"`` or ``"ambiguous"``."""
    problem: str = ""
    """Why it is not ok, in a sentence."""
    cls: type[Plugin] | None = None

    @property
    def full_name(self) -> str:
        """``distribution:name``, which is never ambiguous."""
        return f"{self.distribution}:{self.name}"

    def row(self) -> dict[str, Any]:
        """Return the entry without its class, for tables and JSON."""
        return {k: v for k, v in asdict(self).items() if k != "cls"}


class Registry:
    """The plugins of a set of entry points, loaded at once and never again."""

    def __init__(self, points: Iterable[EntryPoint]) -> None:
        ordered = sorted(points, key=lambda p: (_distribution(p)[0] != OURS, *_distribution(p), p.name))
        self.entries = _mark_ambiguous([entry for point in ordered for entry in _load(point)])

    def find(self, kind: str, name: str) -> type[Plugin]:
        """Return the class of a plugin by its kind and its name or ``distribution:name``.

        Raises `ValidationError` where there is none, with the nearest name and the broken plugins, and `PluginError`
        where the name is ambiguous or the plugin broken.
        """
        if kind not in KINDS:
            raise ValidationError(f"no plugin kind named '{kind}'{did_you_mean(kind, KINDS)}")
        candidates = [e for e in self.entries if e.kind == kind]
        for entry in candidates:
            if entry.cls and (name == entry.full_name or (name == entry.name and entry.status == "ok")):
                return entry.cls
        named = [e for e in candidates if name in (e.name, e.full_name)]
        if named:
            raise PluginError(f"{kind.replace('_', ' ')} '{name}': {named[0].problem}")
        broken = [f"{e.full_name} ({e.problem})" for e in self.entries if e.status == "broken"]
        hint = did_you_mean(str(name), (e.name for e in candidates if e.cls))
        also = f" (broken plugins: {'; '.join(broken)})" if broken else ""
        raise ValidationError(f"no {kind.replace('_', ' ')} named '{name}'{hint}{also}")

    def of_kind(self, kind: str) -> list[type[Plugin]]:
        """Return the usable classes of a kind, ours first."""
        return [e.cls for e in self.entries if e.kind == kind and e.cls and e.status == "ok"]


@cache
def installed() -> Registry:
    """Return the registry of everything installed here that the environment variable ``OATKIT_PLUGINS`` allows.

    It lists distributions, with commas; or it is ``none``. What ships with oatkit is always there.
    """
    return Registry(point for point in entry_points(group=GROUP) if allowed(_distribution(point)[0]))


def allowed(distribution: str) -> bool:
    """Say whether the plugins of a distribution are to be loaded."""
    chosen = os.environ.get(ALLOWED)
    if chosen is None or distribution == OURS:
        return True
    return _normal(distribution) in {_normal(name) for name in chosen.split(",")}


def distributions() -> list[str]:
    """Return the names of all distributions that declare plugins, ours first; nothing of theirs is loaded."""
    names = {_distribution(point)[0] for point in entry_points(group=GROUP)}
    return sorted(names, key=lambda name: (name != OURS, name))


def _normal(name: str) -> str:
    """Return the name of a distribution as packaging compares them."""
    return re.sub(r"[-_.]+", "-", name.strip()).lower()


def _distribution(point: EntryPoint) -> tuple[str, str]:
    return (point.dist.name, point.dist.version) if point.dist else ("unknown", "")


def _load(point: EntryPoint) -> Iterator[Entry]:
    """Yield what one entry point declares; whatever it does wrong becomes an entry with the reason."""
    distribution, version = _distribution(point)
    whole = Entry(None, point.name, distribution, version, "broken")
    manager = pluggy.PluginManager("oatkit")
    manager.add_hookspecs(hookspecs)
    try:
        module = point.load()
        _check_version(module)
        manager.register(module, name=point.name)
        manager.check_pending()
    except (Exception, SystemExit) as error:
        yield replace(whole, problem=_reason(error))
        return
    for kind in KINDS:
        for implementation in getattr(manager.hook, f"oatkit_{kind}s").get_hookimpls():
            try:
                classes = list(implementation.function())
            except (Exception, SystemExit) as error:
                yield replace(whole, kind=kind, problem=f"{implementation.function.__name__}: {_reason(error)}")
                continue
            for cls in classes:
                yield _entry(kind, cls, whole)


def _check_version(module: Any) -> None:
    """Raise `PluginError` for a module that was made for a version of the API that this oatkit does not have."""
    wanted = getattr(module, "OATKIT_API", API_VERSION)
    if not (isinstance(wanted, tuple) and len(wanted) == 2 and all(isinstance(part, int) for part in wanted)):
        raise PluginError(f"OATKIT_API is {wanted!r}; expected two whole numbers, as in {API_VERSION}")
    if wanted[0] != API_VERSION[0] or wanted[1] > API_VERSION[1]:
        made_for, here = (".".join(map(str, version)) for version in (wanted, API_VERSION))
        which = "oatkit" if wanted > API_VERSION else "the plugin"
        raise PluginError(f"made for version {made_for} of the plugin API, this oatkit has {here}: update {which}")


def _entry(kind: str, cls: Any, whole: Entry) -> Entry:
    """Check one declared class."""
    base = KINDS[kind]
    if not (isinstance(cls, type) and issubclass(cls, base)):
        return replace(whole, kind=kind, problem=f"oatkit_{kind}s returned {cls!r}, which is no {base.__name__} class")
    name = cls.name or cls.__name__
    entry = replace(whole, kind=kind, name=name)
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
        return replace(entry, problem=f"'{name}' is no plugin name: small letters, digits and single hyphens")
    if inspect.isabstract(cls):
        missing = ", ".join(sorted(cls.__abstractmethods__))
        return replace(entry, problem=f"{cls.__name__} lacks the method {missing}")
    try:
        cls()
    except (Exception, SystemExit) as error:
        return replace(entry, problem=f"{cls.__name__}() with its defaults: {_reason(error)}")
    return replace(entry, status="ok", cls=cls)


def _mark_ambiguous(entries: list[Entry]) -> list[Entry]:
    """Mark plugins that share kind and name, except ours, which nobody can shadow."""
    marked = []
    for entry in entries:
        twins = [e for e in entries if e is not entry and e.cls and (e.kind, e.name) == (entry.kind, entry.name)]
        if entry.cls and twins and entry.distribution != OURS:
            others = " and ".join(sorted({e.full_name for e in [entry, *twins]}))
            entry = replace(entry, status="ambiguous", problem=f"the name stands for {others}; write one of these")
            assert entry.cls
            entry.cls.written_as = entry.full_name
        marked.append(entry)
    return marked


def _reason(error: BaseException) -> str:
    """Say in one line what an exception says."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def plugin(kind: str, name: str) -> type[Plugin]:
    """Return the class of an installed plugin: ``plugin("solver", "maxent-nlcg")``. Raises as `Registry.find` does."""
    return installed().find(kind, name)
