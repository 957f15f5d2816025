"""Fields of an IPASC file, written by Python or by MATLAB, each missing or malformed one an error that names it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.errors import ReadError
from oatkit.hostile import hdf5_dataset, hdf5_text, holds_text, printable

MAX_FIELD_BYTES = 64 * 2**20
ABSENT = ("", "None")
"""Texts that stand for no value: the consortium's writer makes "None" of Python's None."""


@dataclass(frozen=True)
class Fields:
    """The datasets of one group that was reached by hard links."""

    group: Any
    turned: bool = False
    """Whether arrays have their axes in the reverse order, as MATLAB writes them."""

    def has(self, name: str) -> bool:
        """Say whether there is a field of that name with a value."""
        return self.group.get(name, getlink=True) is not None and not self._says_none(name)

    def array(self, name: str) -> np.ndarray | None:
        """Return the numbers of a field of at most 64 MiB, or None where it is missing."""
        if not self.has(name):
            return None
        values = np.asarray(hdf5_dataset(self.group, name, "iufb", range(5), MAX_FIELD_BYTES)[()])
        return values.T if self.turned else values

    def number(self, name: str) -> float | None:
        """Return the one finite number of a field, whatever its number of axes, or None where it is missing."""
        values = self.array(name)
        if values is None:
            return None
        if values.size != 1 or not np.isfinite(values).all():
            raise self.error(name, "one finite number", f"{values.size} of shape {values.shape}")
        return float(values.item())

    def text(self, name: str) -> str:
        """Return a text, its lines printable, or nothing where it is missing."""
        if not self.has(name):
            return ""
        return "\n".join(printable(line) for line in hdf5_text(self.group, name).split("\n"))

    def error(self, name: str, expected: str, found: str) -> ReadError:
        """Return the error of a field."""
        return ReadError(f"{self.group.file.filename} '{self.group.name}/{name}': expected {expected}, found {found}")

    def _says_none(self, name: str) -> bool:
        return holds_text(self.group, name) and hdf5_text(self.group, name).strip() in ABSENT
