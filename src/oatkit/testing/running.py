"""How checks run: each yields a sentence for what is wrong, and what a plugin raises is a sentence, too."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from oatkit.errors import OatkitError

Check = Callable[[Any], Iterator[str]]
"""Takes a plugin and yields a sentence for each promise that it breaks; its docstring states them."""


def run(checks: Iterable[Check], plugin: Any) -> list[str]:
    """Return the sentences of all checks, each behind the name of its check."""
    found: list[str] = []
    for check in checks:
        try:
            found += [f"{check.__name__}: {sentence}" for sentence in check(plugin)]
        except (Exception, SystemExit) as error:
            text = " ".join(str(error).split())
            found.append(f"{check.__name__}: it raised {type(error).__name__}: {text}")
    return found


def refuses(action: Callable[[], Any], errors: type[BaseException] = OatkitError) -> bool:
    """Say whether `action` raises one of `errors`."""
    try:
        action()
    except errors:
        return True
    return False


def difference(found: Any, expected: Any) -> float:
    """Return |found - expected| / |expected|; |found| where the latter is zero, infinity where shapes differ."""
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    if found.shape != expected.shape:
        return float("inf")
    size = float(np.linalg.norm(expected))
    return float(np.linalg.norm(found - expected)) / (size or 1.0)


def rounding(dtype: Any) -> float:
    """Return how exact identities must hold in numbers of a type, relative: 1e-10 in double, 1e-6 in single."""
    return 1e-6 if np.dtype(dtype).itemsize <= 4 else 1e-10
