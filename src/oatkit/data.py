"""What flows through a pipeline: grids, detector arrays, scans and images.

All are frozen dataclasses in SI units (wavelengths in nm) whose arrays are read-only copies; they compare, hash and
pickle by content. Space has two axes in the order ``(y, x)``: y points up, x to the right, and row 0 of an image is at
the *bottom*. Only viewers and exporters flip.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np

from oatkit.content import ByContent, check_range, frozen, read_only
from oatkit.errors import ValidationError


@dataclass(frozen=True, eq=False)
class Grid(ByContent):
    """Square pixels in the image plane.

    Raises `ValidationError` for an empty shape or a pixel that is not between 1 um and 10 mm.
    """

    shape: tuple[int, int]
    """Rows and columns, ``(ny, nx)``."""
    pixel_size_m: float
    """Side of a pixel, m."""
    centre_m: tuple[float, float] = (0.0, 0.0)
    """Where the middle of the image lies, ``(y, x)``, m."""

    def __post_init__(self) -> None:
        if len(self.shape) != 2 or not all(n >= 1 and int(n) == n for n in self.shape):
            raise ValidationError(f"grid shape: expected (ny, nx) of at least (1, 1), got {self.shape}")
        object.__setattr__(self, "shape", (int(self.shape[0]), int(self.shape[1])))
        object.__setattr__(self, "pixel_size_m", float(self.pixel_size_m))
        object.__setattr__(self, "centre_m", (float(self.centre_m[0]), float(self.centre_m[1])))
        check_range("pixel_size_m", self.pixel_size_m, 1e-6, 1e-2, "the unit is m, so 0.1 mm is 1e-4")
        check_range("centre_m", self.centre_m, -1.0, 1.0, "the unit is m")

    @cached_property
    def y_m(self) -> np.ndarray:
        """Pixel centres along y, shape ``(ny,)``, m, rising with the row."""
        return self._centres(0)

    @cached_property
    def x_m(self) -> np.ndarray:
        """Pixel centres along x, shape ``(nx,)``, m, rising with the column."""
        return self._centres(1)

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """Outer edges ``(left, right, bottom, top)``, m, as matplotlib's ``extent`` wants them."""
        half_y, half_x = (0.5 * n * self.pixel_size_m for n in self.shape)
        y, x = self.centre_m
        return (x - half_x, x + half_x, y - half_y, y + half_y)

    def _centres(self, axis: int) -> np.ndarray:
        n = self.shape[axis]
        return read_only(self.centre_m[axis] + (np.arange(n) - (n - 1) / 2) * self.pixel_size_m)


@dataclass(frozen=True, eq=False)
class Detectors(ByContent):
    """Point detectors in the image plane, anywhere and in any order.

    Raises `ValidationError` where positions are not of shape ``(n, 2)``, not finite, or further than 2 m from the
    origin. `from_xyz` takes points in the order in which most files hold them.
    """

    positions_m: np.ndarray
    """Shape ``(n, 2)``, each ``(y, x)``, m."""

    def __post_init__(self) -> None:
        positions = np.asarray(self.positions_m, dtype=float)
        if positions.ndim != 2 or positions.shape[1] != 2 or len(positions) == 0:
            raise ValidationError(
                f"detector positions: expected shape (n, 2) in the order (y, x), got {positions.shape}; "
                "Detectors.from_xyz takes points of shape (n, 3) in the order (x, y, z)"
            )
        check_range("detector positions", positions, -2.0, 2.0, "the unit is m, so 40 mm is 0.04")
        object.__setattr__(self, "positions_m", read_only(positions))

    @classmethod
    def from_xyz(cls, points_m: Any) -> Self:
        """Take points of shape ``(n, 3)`` in the order ``(x, y, z)``, all in one plane of constant z.

        Raises `ValidationError` where z varies by more than 0.1 mm: this package images planes.
        """
        points = np.asarray(points_m, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValidationError(f"detector points: expected shape (n, 3) in the order (x, y, z), got {points.shape}")
        if not np.ptp(points[:, 2]) <= 1e-4:
            raise ValidationError(
                f"detector points: z varies by {np.ptp(points[:, 2]) * 1e3:.3g} mm; they must lie in one plane"
            )
        return cls(points[:, [1, 0]])

    @property
    def count(self) -> int:
        """Number of detectors."""
        return len(self.positions_m)


@dataclass(frozen=True, eq=False)
class Geometry(ByContent):
    """Where and when the signals were taken: all that an acoustic operator depends on.

    Sample k is taken at ``start_time_s + k / sampling_rate_hz`` after the light pulse. Raises `ValidationError` for
    values out of their physical range, with a hint at the unit.
    """

    detectors: Detectors
    sampling_rate_hz: float
    n_samples: int
    start_time_s: float = 0.0
    speed_of_sound_m_s: float = 1500.0
    impulse_response: np.ndarray | None = None
    """Convolved with every ideal signal: shape ``(n,)``, at the sampling rate, time zero at index ``n // 2``.

    It holds the electrical impulse response of the detectors and whatever filter was applied to the data."""

    def __post_init__(self) -> None:
        for name in ("sampling_rate_hz", "start_time_s", "speed_of_sound_m_s"):
            object.__setattr__(self, name, float(getattr(self, name)))
        check_range("sampling_rate_hz", self.sampling_rate_hz, 1e5, 1e10, "the unit is Hz, so 40 MHz is 40e6")
        check_range("n_samples", self.n_samples, 1, 10_000_000, "a record has at least one sample")
        if int(self.n_samples) != self.n_samples:
            raise ValidationError(f"n_samples: must be a whole number, got {self.n_samples}")
        object.__setattr__(self, "n_samples", int(self.n_samples))
        check_range("start_time_s", self.start_time_s, -1e-2, 1e-2, "the unit is s, so 10 us is 1e-5")
        check_range("speed_of_sound_m_s", self.speed_of_sound_m_s, 300, 7000, "the unit is m/s; water has about 1500")
        if self.impulse_response is not None:
            response = np.asarray(self.impulse_response, dtype=float)
            if response.ndim != 1 or response.size == 0 or not np.isfinite(response).all() or not response.any():
                raise ValidationError("impulse_response: expected a finite, non-zero array of shape (n,)")
            object.__setattr__(self, "impulse_response", read_only(response))

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of one record, ``(detector, sample)``."""
        return (self.detectors.count, self.n_samples)

    @cached_property
    def times_s(self) -> np.ndarray:
        """Time of each sample after the light pulse, shape ``(sample,)``, s."""
        return read_only(self.start_time_s + np.arange(self.n_samples) / self.sampling_rate_hz)

    def reach(self, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
        """Return the distance of each detector from the nearest and the farthest point of `grid`, m."""
        left, right, bottom, top = grid.extent_m
        y, x = self.detectors.positions_m.T
        near = np.hypot(np.maximum(np.maximum(bottom - y, y - top), 0), np.maximum(np.maximum(left - x, x - right), 0))
        far = np.hypot(np.maximum(abs(y - bottom), abs(y - top)), np.maximum(abs(x - left), abs(x - right)))
        return near, far

    def check_grid(self, grid: Grid) -> None:
        """Raise `ValidationError` where no image on `grid` could be seen by these detectors.

        That is: a detector lies on or inside the grid, or no sample of the record reaches any pixel.
        """
        near, far = self.reach(grid)
        height, width = (1e3 * n * grid.pixel_size_m for n in grid.shape)
        inside = int((near <= grid.pixel_size_m).sum())
        if inside:
            raise ValidationError(
                f"grid: {inside} of {self.detectors.count} detectors lie inside the field of view of "
                f"{height:.4g} x {width:.4g} mm; take a smaller one (the unit is mm)"
            )
        first, last = self.times_s[[0, -1]] * self.speed_of_sound_m_s
        if not ((far >= first) & (near <= last)).any():
            raise ValidationError(
                f"grid: the record reaches distances of {1e3 * first:.4g} .. {1e3 * last:.4g} mm, but the field of "
                f"view is {1e3 * near.min():.4g} .. {1e3 * far.max():.4g} mm from the detectors; "
                "check its centre and the start time"
            )


@runtime_checkable
class Signals(Protocol):
    """Raw signals of shape ``(frame, wavelength, detector, sample)``: a numpy array, or a file read lazily.

    A lazy one pickles as its reader, path and fingerprint, never as its content.
    """

    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def dtype(self) -> np.dtype: ...
    def __getitem__(self, index: Any) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Scan(ByContent):
    """Raw pressure signals of a detector array, with all that is known about them.

    Two scans with the same data are equal, whatever they are called and wherever they lie.

    Raises `ValidationError` where the shapes of its parts do not fit together or a wavelength is out of range.
    """

    texts: ClassVar[frozenset[str]] = frozenset({"name", "source", "reader", "speed_of_sound_source", "notes"})

    signals: Signals
    """Shape ``(frame, wavelength, detector, sample)``, any real dtype, in arbitrary units."""
    geometry: Geometry
    wavelengths_nm: tuple[float, ...]
    """One for each index of the wavelength axis, in the order of the file."""
    valid: np.ndarray = None  # type: ignore[assignment]
    """Which channels can be trusted: shape ``(frame, wavelength, detector)``; all of them unless said otherwise."""
    pulse_energy: np.ndarray | None = None
    """Relative energy of the light pulses, by which signals are divided: shape ``(frame, wavelength)``."""
    temperature_c: np.ndarray | None = None
    """Temperature of the coupling medium, shape ``(frame, wavelength)``, degrees Celsius."""
    timestamps_s: np.ndarray | None = None
    """Time of each pulse, shape ``(frame, wavelength)``, s."""
    position_m: np.ndarray | None = None
    """Where along the scan axis each frame was taken, shape ``(frame, wavelength)``, m."""
    name: str = ""
    source: str = ""
    """The path that was read, or what made the signals."""
    reader: str = ""
    """Name of the plugin that read it."""
    speed_of_sound_source: str = "default"
    """Where ``geometry.speed_of_sound_m_s`` comes from, in words."""
    notes: tuple[str, ...] = ()
    """What the reader found odd or had to assume, and what later steps did to the data."""

    def __post_init__(self) -> None:
        shape = tuple(self.signals.shape)
        object.__setattr__(self, "wavelengths_nm", tuple(float(w) for w in self.wavelengths_nm))
        if len(shape) != 4 or 0 in shape:
            raise ValidationError(f"signals: expected shape (frame, wavelength, detector, sample), got {shape}")
        if shape[1] != len(self.wavelengths_nm):
            raise ValidationError(
                f"signals: {shape[1]} wavelengths in the data, {len(self.wavelengths_nm)} in the list"
            )
        if shape[2:] != self.geometry.shape:
            raise ValidationError(
                f"signals: (detector, sample) is {shape[2:]}, the geometry says {self.geometry.shape}"
            )
        check_range("wavelengths_nm", self.wavelengths_nm, 100, 20_000, "the unit is nm, so 700e-9 m is 700")
        if isinstance(self.signals, np.ndarray):
            if self.signals.dtype.kind not in "iuf":
                raise ValidationError(f"signals: expected real numbers, got dtype {self.signals.dtype}")
            object.__setattr__(self, "signals", read_only(self.signals))
        valid = np.ones(shape[:3], bool) if self.valid is None else self.valid
        self._hold("valid", valid, shape[:3], bool)
        for name in ("pulse_energy", "temperature_c", "timestamps_s", "position_m"):
            if getattr(self, name) is not None:
                self._hold(name, getattr(self, name), shape[:2], float)

    def _hold(self, name: str, values: Any, shape: tuple[int, ...], dtype: type) -> None:
        array = read_only(values, dtype)
        if array.shape != shape:
            raise ValidationError(f"{name}: expected shape {shape}, got {array.shape}")
        object.__setattr__(self, name, array)

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.signals.shape[0])

    def frame(self, index: int) -> "Scan":
        """Return the one-frame scan of frame `index`, its signals read into memory.

        Raises `ValidationError` where there is no such frame.
        """
        if not 0 <= index < self.frames:
            raise ValidationError(f"frame {index}: the scan has frames 0 .. {self.frames - 1}")
        one = slice(index, index + 1)
        per_frame = ("valid", "pulse_energy", "temperature_c", "timestamps_s", "position_m")
        parts = {k: v[one] for k in per_frame if (v := getattr(self, k)) is not None}
        return replace(self, signals=np.asarray(self.signals[one]), **parts)

    def with_start_time(self, start_time_s: float) -> "Scan":
        """Return the same scan with another time of the first sample, s."""
        return replace(self, geometry=replace(self.geometry, start_time_s=start_time_s))

    def with_speed_of_sound(self, speed_of_sound_m_s: float, source: str) -> "Scan":
        """Return the same scan with another speed of sound (m/s) and where it came from."""
        geometry = replace(self.geometry, speed_of_sound_m_s=speed_of_sound_m_s)
        return replace(self, geometry=geometry, speed_of_sound_source=source)


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
