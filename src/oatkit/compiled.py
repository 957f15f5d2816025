"""How kernels are compiled: serial, without the GIL, so that our own threads and anybody's can call them.

Importing it imports numba: only modules of kernels do.
"""

from collections.abc import Callable
from typing import Any

from numba import njit

# Without the numpy error model every division is guarded by a branch and the loops are not vectorised. NaN keeps its
# meaning: images may hold it.
OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract", "arcp", "nsz", "afn"},
}


def fast(function: Callable[..., Any]) -> Any:
    """Compile a kernel, and keep the machine code where there is a folder to keep it in."""
    try:
        return njit(cache=True, **OPTIONS)(function)
    except RuntimeError:
        return njit(**OPTIONS)(function)
