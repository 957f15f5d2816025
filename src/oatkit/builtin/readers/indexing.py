"""The index of signals that lie in a file."""

from typing import Any

import numpy as np


def expanded(index: Any) -> list[Any]:
    """Return an index of four entries. Raises `IndexError` for what is no whole number, slice or ellipsis."""
    entries = list(index) if isinstance(index, tuple) else [index]
    if any(not (e is Ellipsis or isinstance(e, int | np.integer | slice)) or isinstance(e, bool) for e in entries):
        raise IndexError("signals of a file take whole numbers, slices and '...' as index")
    gap = next((i for i, e in enumerate(entries) if e is Ellipsis), len(entries))
    after = entries[gap + 1 :]
    missing = 4 - gap - len(after)
    if missing < 0 or any(e is Ellipsis for e in after):
        raise IndexError(f"signals have 4 axes, the index has {len(entries)} entries")
    return entries[:gap] + [slice(None)] * missing + after
