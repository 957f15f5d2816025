"""Raw signals and all that belongs to them."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from oatkit.content import ByContent, check_range, read_only
from oatkit.data.geometry import Geometry
from oatkit.errors import ValidationError


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
