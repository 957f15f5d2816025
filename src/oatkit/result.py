"""What a pipeline gives: images, and how they came about."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from oatkit.data import Image
from oatkit.errors import ValidationError
from oatkit.names import did_you_mean


class Frames(Protocol):
    """Where the frames of a result are that are not in memory."""

    @property
    def path(self) -> Path:
        """The folder."""
        ...

    @property
    def count(self) -> int:
        """Number of frames, failed ones included."""
        ...

    @property
    def failed(self) -> Mapping[int, str]:
        """Why frames failed."""
        ...

    def image(self, index: int, name: str) -> Image:
        """Read one image of one frame."""
        ...

    def read(self, index: int) -> "Result":
        """Read one frame."""
        ...

    def when(self, index: int) -> tuple[int, float | None]:
        """Say which frame of the scan a frame is, and its time, s."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Result(Mapping[str, Image]):
    """The images of one frame by name, with their provenance: ``result["initial_pressure"]``.

    One that was loaded shows the first of its frames that did not fail, read when asked for, and knows the others.
    Equal results have equal images; provenance (which holds timings) is not compared.
    """

    images: Mapping[str, Image]
    pipeline: Mapping[str, Any] = field(default_factory=dict)
    """The pipeline as run, nested as in its TOML file: rules for weights replaced by the numbers that they gave."""
    requested: Mapping[str, Any] = field(default_factory=dict)
    """The pipeline as asked for."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Version of each package that took part, and of ``python`` and ``platform``."""
    scan: Mapping[str, Any] = field(default_factory=dict)
    """``name``, ``source``, ``fingerprint``, ``speed_of_sound_m_s``, ``speed_of_sound_source``, ``wavelengths_nm``,
    ``notes``."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """How long each step took, s."""
    warnings: tuple[str, ...] = ()
    frame_index: int = 0
    """Which frame of the scan this is."""
    time_s: float | None = None
    """Mean time of the frame's pulses, s; None where the scan does not know it."""
    weight_choice: Mapping[str, Any] = field(default_factory=dict)
    """How a rule chose the weight; empty where the weight was given as a number."""
    speed_choice: Mapping[str, Any] = field(default_factory=dict)
    """How the speed of sound was found by focus; empty where it was not."""
    calibration_choice: Mapping[str, Any] = field(default_factory=dict)
    """How the calibration was found by the spectra; empty where it was not."""
    stored: Frames | None = None
    """The folder that the result was loaded from."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, dict):
                object.__setattr__(self, entry.name, MappingProxyType(dict(value)))
        object.__setattr__(self, "warnings", tuple(self.warnings))

    def __getitem__(self, name: str) -> Image:
        if name not in self.images:
            raise KeyError(f"no image named '{name}'{did_you_mean(name, self.images)}")
        return self.images[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.images)

    def __len__(self) -> int:
        return len(self.images)

    def __repr__(self) -> str:
        return f"<Result: {', '.join(self)}; {self.frames} frame{'s' * (self.frames > 1)}>"

    def __reduce__(self) -> tuple[Any, ...]:
        values = [getattr(self, entry.name) for entry in fields(self)]
        return type(self), tuple(dict(v) if isinstance(v, MappingProxyType) else v for v in values)

    @property
    def frames(self) -> int:
        """Number of frames, failed ones included."""
        return self.stored.count if self.stored else 1

    @property
    def failed(self) -> Mapping[int, str]:
        """Why frames failed, by their number in this result."""
        return self.stored.failed if self.stored else {}

    def frame(self, index: int) -> "Result":
        """Return frame `index`, counted within this result, its images in memory.

        Raises `ValidationError` where there is none, `ResultError` where it failed, with the reason, or is damaged.
        """
        self._check_frame(index)
        return self.stored.read(index) if self.stored else self

    def when(self, index: int) -> tuple[int, float | None]:
        """Return which frame of the scan frame `index` of this result is, and its `time_s`; no image is read.

        Raises as `frame` does.
        """
        self._check_frame(index)
        return self.stored.when(index) if self.stored else (self.frame_index, self.time_s)

    def _check_frame(self, index: int) -> None:
        if not 0 <= index < self.frames:
            raise ValidationError(f"frame {index}: the result has frames 0 .. {self.frames - 1}")

    def save(self, path: str | Path, overwrite: bool = False) -> None:
        """Write all frames to a result folder; see `oatkit.store`. Raises `ResultError`."""
        # The one import upwards: a result is below the store that writes it, and `result.save` is what users call.
        from oatkit.store import save

        save(self, path, overwrite)
