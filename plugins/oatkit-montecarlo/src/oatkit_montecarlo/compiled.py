"""How the compiled part is compiled. Importing it imports numba."""

from collections.abc import Callable
from typing import Any

from numba import njit


def part(function: Callable[..., Any]) -> Any:
    """Compile as a part of the kernel that calls it: a call would copy every array's description."""
    return njit(inline="always", error_model="numpy")(function)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile, and keep the machine code where there is a folder to keep it in."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:
        return njit(**options)(function)
