"""What the unmixers share: their chromophores, and the images that they return."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from oatkit.api import Image, Unmixer, UnmixProblem, ValidationError, param
from oatkit.builtin.unmixers.mixture import Mixture
from oatkit.builtin.unmixers.saturation import total_and_saturation


class SpectralUnmixer(Unmixer):
    """Fits the spectra of chromophores to each pixel."""

    chromophores: tuple[str, ...] = param(
        ("oxyhaemoglobin", "deoxyhaemoglobin"),
        "what is fitted, in the order of importance: with too few wavelengths the last ones are left out",
    )
    tables: tuple[Path, ...] = param(
        (), "CSV files of further spectra: wavelength_nm, and a column of mu_a in 1/m for each chromophore"
    )
    noise: tuple[float, ...] = param(
        (),
        "relative standard deviation of the noise at each wavelength, in the order of the scan; none: all equal",
        above=0,
    )
    normalise: bool = param(True, "scale each spectrum to length one before solving, and back after it")
    so2_floor: float = param(
        0.02, "total haemoglobin below which so2 is undefined, relative to its 99th percentile", at_least=0, below=1
    )

    @abstractmethod
    def _solve(self, spectra: np.ndarray, data: np.ndarray) -> np.ndarray:
        """Return concentrations, shape ``(pixel, chromophore)``, from data of shape ``(pixel, wavelength)``."""

    def unmix(self, problem: UnmixProblem) -> Mapping[str, Image]:
        """Return images of the chromophores, ``total_haemoglobin``, ``so2`` and the relative ``residual``.

        They are fitted to the absorption where the pipeline has it, else to the initial pressure.
        """
        data = problem.absorption or problem.initial_pressure
        mixture = self.mixture(data.wavelengths_nm)
        return Fit(mixture, self.fit(mixture, data.values), data).images(self.so2_floor, {})

    def mixture(self, wavelengths_nm: tuple[float, ...]) -> Mixture:
        """Return what is fitted at some wavelengths. Raises `ValidationError` where the noise does not fit them."""
        if self.noise and len(self.noise) != len(wavelengths_nm):
            raise ValidationError(
                f"noise: {len(self.noise)} numbers for {len(wavelengths_nm)} wavelengths; give one for each"
            )
        return Mixture.of(self.chromophores, self.tables, wavelengths_nm)

    def fit(self, mixture: Mixture, absorption: np.ndarray) -> np.ndarray:
        """Return concentrations, ``(chromophore, y, x)``, from mu_a, ``(wavelength, y, x)``; NaN where it is NaN."""
        weight = 1 / np.array(self.noise) if self.noise else np.ones(len(absorption))
        length = np.linalg.norm(weight[:, None] * mixture.spectra, axis=0) if self.normalise else 1.0
        defined = np.isfinite(absorption).all(0)
        found = np.full((len(mixture.names), *defined.shape), np.nan)
        data = absorption[:, defined].T.astype(float) * weight
        found[:, defined] = (self._solve(weight[:, None] * mixture.spectra / length, data) / length).T
        return found


@dataclass(frozen=True)
class Fit:
    """Concentrations that were fitted to the absorption."""

    mixture: Mixture
    concentrations: np.ndarray
    """Shape ``(chromophore, y, x)``."""
    absorption: Image
    """What they were fitted to, ``(wavelength, y, x)``, "1/m" or "a.u."."""

    def images(self, so2_floor: float, found: Mapping[str, Any], notes: tuple[str, ...] = ()) -> dict[str, Image]:
        """Return an image of each chromophore, of what follows from haemoglobin, and of the residual.

        `found` joins the diagnostics of ``so2`` and of the first, `notes` those of the first.
        """
        by_name = dict(zip(self.mixture.names, self.concentrations, strict=True))
        scaled = self.absorption.unit == "1/m"
        units = {one.name: one.unit if scaled else "a.u." for one in self.mixture.chromophores}
        units |= {"total_haemoglobin": units.get("oxyhaemoglobin", ""), "so2": ""}
        facts = {"fitted_to": self.absorption.quantity, "condition": self.mixture.condition}
        made = {name: self._image(name, units[name], plane, facts) for name, plane in by_name.items()}
        for name, plane, least in total_and_saturation(by_name, so2_floor):
            more = found if name == "so2" else {}
            made[name] = self._image(name, units[name], plane, {**facts, **more, "least_haemoglobin": least})
        made["residual"] = self._image("residual", "", self.residual(), facts)
        first = next(iter(made))
        made[first] = self._image(
            first, units[first], by_name[first], {**facts, **found, "notes": (*self.mixture.notes, *notes)}
        )
        return made

    def residual(self) -> np.ndarray:
        """Return |fit - data| / |data| over the wavelengths, shape ``(y, x)``; NaN where there are no data."""
        data = self.absorption.values.astype(float)
        misfit = np.tensordot(self.mixture.spectra, self.concentrations, 1) - data
        size = np.linalg.norm(data, axis=0)
        out = np.full(size.shape, np.nan)
        return np.divide(np.linalg.norm(misfit, axis=0), size, out=out, where=size > 0)

    def _image(self, name: str, unit: str, plane: np.ndarray, diagnostics: Mapping[str, Any]) -> Image:
        return Image(plane.astype(np.float32), name, unit, self.absorption.grid, diagnostics=diagnostics)
