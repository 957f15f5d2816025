"""Images, and the optical properties of what they show."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from oatkit.content import ByContent, check_range, frozen, read_only
from oatkit.data.grid import Grid
from oatkit.errors import ValidationError


@dataclass(frozen=True, eq=False)
class Image(ByContent):
    """One quantity on a grid, at each wavelength of one frame.

    Raises `ValidationError` where values do not have the shape of the grid or are not of a floating type.
    """

    values: np.ndarray
    """Shape ``(wavelength, y, x)``, float32 or float64, a read-only copy; ``(1, y, x)`` where there is no wavelength.

    A single plane ``(y, x)`` is taken as ``(1, y, x)``."""
    quantity: str
    """Name of what is shown: ``"initial_pressure"``, ``"boundary"``, ``"fluence"``, ``"absorption"``, ..."""
    unit: str
    """SI unit, ``"a.u."`` where the scale is unknown, ``""`` for a pure number."""
    grid: Grid
    wavelengths_nm: tuple[float, ...] = ()
    """One for each plane of `values`; empty for an image that belongs to no wavelength."""
    history: tuple[Mapping[str, Any], ...] = ()
    """The steps that made the image, first one first, each with its parameters as run."""
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    """What the last step measured: certificate, reason for stopping, negative pixels, by wavelength."""

    def __post_init__(self) -> None:
        values = np.asarray(self.values)
        if values.dtype not in (np.float32, np.float64):
            raise ValidationError(f"image {self.quantity}: expected float32 or float64, got {values.dtype}")
        values = read_only(values[None] if values.ndim == 2 else values)
        planes = max(1, len(self.wavelengths_nm))
        if values.shape != (planes, *self.grid.shape):
            raise ValidationError(
                f"image {self.quantity}: expected shape {(planes, *self.grid.shape)}, got {values.shape}"
            )
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "wavelengths_nm", tuple(float(w) for w in self.wavelengths_nm))
        object.__setattr__(self, "history", tuple(frozen(step) for step in self.history))
        object.__setattr__(self, "diagnostics", frozen(self.diagnostics))

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "history": tuple(dict(step) for step in self.history)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__({**state, "history": tuple(frozen(step) for step in state["history"])})


@dataclass(frozen=True, eq=False)
class Optics(ByContent):
    """Optical properties of the body, by wavelength.

    Raises `ValidationError` where the lengths differ or a value is not finite and positive.
    """

    wavelengths_nm: tuple[float, ...]
    absorption_per_m: np.ndarray
    """mu_a: shape ``(wavelength,)`` for a homogeneous body or ``(wavelength, y, x)``, 1/m."""
    reduced_scattering_per_m: np.ndarray
    """mu_s': of either shape, 1/m."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelengths_nm", tuple(float(w) for w in self.wavelengths_nm))
        for name in ("absorption_per_m", "reduced_scattering_per_m"):
            values = read_only(getattr(self, name), float)
            if values.ndim not in (1, 3) or len(values) != len(self.wavelengths_nm):
                raise ValidationError(
                    f"{name}: expected shape (wavelength,) or (wavelength, y, x) with {len(self.wavelengths_nm)} "
                    f"wavelengths, got {values.shape}"
                )
            check_range(name, values, 0.0, 1e7, "the unit is 1/m, so 1 per cm is 100")
            object.__setattr__(self, name, values)
