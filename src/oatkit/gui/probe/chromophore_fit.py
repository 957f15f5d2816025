"""Which mixture of known chromophores a spectrum looks like. No Qt, no napari."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oatkit.errors import SolverError, ValidationError
from oatkit.spectra import Chromophore, chromophore

OXY, DEOXY = "oxyhaemoglobin", "deoxyhaemoglobin"
SHORT = {OXY: "HbO₂", DEOXY: "Hb", "icg": "ICG"}
"""What chromophores are called where there is little room."""


@dataclass(frozen=True, eq=False)
class ChromophoreFit:
    """Concentrations, none of them negative, that explain a spectrum best."""

    chromophores: tuple[Chromophore, ...]
    concentrations: np.ndarray
    """Of each, shape ``(chromophore,)``."""
    wavelengths_nm: np.ndarray
    """Shape ``(wavelength,)``."""
    fitted: np.ndarray
    """The spectrum of the mixture, shape ``(wavelength,)``."""
    misfit: float
    """Norm of what is left over, relative to that of the spectrum."""
    in_units: bool
    """Whether the spectrum is in 1/m, so that concentrations have units."""

    @property
    def saturation(self) -> float | None:
        """Share of the oxygenated in all haemoglobin; None where there is none, or not both were fitted."""
        found = dict(zip((one.name for one in self.chromophores), self.concentrations, strict=True))
        if OXY not in found or DEOXY not in found or not found[OXY] + found[DEOXY] > 0:
            return None
        return float(found[OXY] / (found[OXY] + found[DEOXY]))

    @property
    def text(self) -> str:
        """All of it in one line."""
        parts = [
            f"{short(one.name)} {value:.3g}{self._unit(one)}"
            for one, value in zip(self.chromophores, self.concentrations, strict=True)
        ]
        more = [] if self.saturation is None else [f"sO₂ {self.saturation:.3f}"]
        return " · ".join([", ".join(parts), *more, f"misfit {100 * self.misfit:.2g} %"])

    def _unit(self, one: Chromophore) -> str:
        unit = one.unit.replace("^3", "³") if self.in_units else "a.u."
        return f" {unit}" if unit else ""


def short(name: str) -> str:
    """Return a short name of a chromophore."""
    return SHORT.get(name, name)


def fit_spectrum(
    wavelengths_nm: Sequence[float] | np.ndarray, values: np.ndarray, names: Sequence[str], unit: str
) -> ChromophoreFit:
    """Fit chromophores, named as in `oatkit.spectra.CHROMOPHORES`, to a spectrum by non-negative least squares.

    Wavelengths without a value are left out. Raises `ValidationError` for fewer different wavelengths than
    chromophores, for one that a table does not reach, and for a chromophore that absorbs nothing at any of them.
    """
    known = np.isfinite(values)
    at, data = np.asarray(wavelengths_nm, float)[known], np.asarray(values, float)[known]
    if len(set(at)) < len(names):
        raise ValidationError(
            f"{len(names)} chromophores need as many wavelengths with a value; there are {len(set(at))}"
        )
    fitted = tuple(chromophore(name) for name in names)
    spectra = np.stack([one.spectrum(at) for one in fitted], axis=1)
    size = np.linalg.norm(spectra, axis=0)
    if not size.all():
        raise ValidationError(f"{fitted[int(np.argmin(size))].name} absorbs nothing at these wavelengths")
    concentrations = _nonnegative(spectra / size, data) / size
    mixture, norm = spectra @ concentrations, float(np.linalg.norm(data))
    misfit = float(np.linalg.norm(data - mixture)) / norm if norm > 0 else 0.0
    return ChromophoreFit(fitted, concentrations, at, mixture, misfit, unit == "1/m")


def _nonnegative(matrix: np.ndarray, data: np.ndarray) -> np.ndarray:
    from scipy.optimize import nnls

    try:
        return np.asarray(nnls(matrix, data)[0])
    except RuntimeError as error:
        raise SolverError(f"the fit of chromophores found no end: {error}") from None
