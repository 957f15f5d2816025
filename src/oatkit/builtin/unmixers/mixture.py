"""Which chromophores are fitted to which wavelengths, and what one unit of each absorbs there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from oatkit.api import ValidationError
from oatkit.spectra import Chromophore, chromophore

DOUBTFUL_CONDITION = 100.0
"""Condition number of the normalised spectra above which noise is multiplied beyond use."""


@dataclass(frozen=True)
class Mixture:
    """The chromophores that are fitted, and their spectra."""

    chromophores: tuple[Chromophore, ...]
    spectra: np.ndarray
    """mu_a of one unit of each, 1/m, shape ``(wavelength, chromophore)``."""
    notes: tuple[str, ...]

    @classmethod
    def of(cls, names: Sequence[str], tables: Sequence[Path], wavelengths_nm: Sequence[float]) -> Self:
        """Look the chromophores up; as many of them, in their order, as there are different wavelengths.

        Raises `ValidationError` for an unknown name, one that stands twice, a wavelength beyond a table, and where no
        wavelength or no chromophore is given, or one absorbs nothing at all of them.
        """
        if not names or len(set(names)) < len(names):
            raise ValidationError(f"chromophores: expected one or more different names, got {list(names)}")
        if not wavelengths_nm:
            raise ValidationError("unmixing: the images belong to no wavelengths")
        different = sorted(set(wavelengths_nm))
        fitted = tuple(chromophore(name, tables) for name in names)[: len(different)]
        spectra = np.stack([one.spectrum(wavelengths_nm) for one in fitted], axis=1)
        for one, column in zip(fitted, spectra.T, strict=True):
            if not column.any():
                raise ValidationError(
                    f"chromophore '{one.name}' absorbs nothing at {_listed(different)} nm, so it cannot be found there"
                )
        mixture = cls(fitted, spectra, ())
        return cls(fitted, spectra, tuple(mixture._notes(names, different)))

    @property
    def names(self) -> tuple[str, ...]:
        """What the images are called."""
        return tuple(one.name for one in self.chromophores)

    @property
    def overdetermined(self) -> bool:
        """Whether there are more different wavelengths than chromophores, so that not every spectrum can be fitted."""
        return len(np.unique(self.spectra, axis=0)) > len(self.chromophores)

    @property
    def condition(self) -> float:
        """By how much noise can grow on its way through the unmixing: the condition number of normalised spectra."""
        return float(np.linalg.cond(self.spectra / np.linalg.norm(self.spectra, axis=0)))

    def _notes(self, names: Sequence[str], different: Sequence[float]) -> list[str]:
        notes = []
        left_out = names[len(self.chromophores) :]
        if left_out:
            notes.append(
                f"{len(names)} chromophores cannot be told apart at {len(different)} different "
                f"wavelength{'s' * (len(different) > 1)} ({_listed(different)} nm): {', '.join(left_out)} left out"
            )
        if not self.condition <= DOUBTFUL_CONDITION:
            notes.append(
                f"the spectra of {', '.join(self.names)} are hard to tell apart at {_listed(different)} nm: their "
                f"condition number is {self.condition:.2g}; take fewer chromophores or other wavelengths"
            )
        return notes


def _listed(wavelengths_nm: Sequence[float]) -> str:
    shown = [f"{w:g}" for w in wavelengths_nm]
    return ", ".join(shown if len(shown) <= 4 else [*shown[:2], "...", shown[-1]])
