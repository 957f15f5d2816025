"""What was found about motion in a scan."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from oatkit.content import read_only


@dataclass(frozen=True, eq=False)
class Motion:
    """How well each pulse fits to those beside it, and which ones do not."""

    wavelengths_nm: tuple[float, ...]
    compared: Literal["frames", "wavelengths", "nothing"]
    """What a pulse was compared with: the same wavelength of other frames, other wavelengths of its frame, nothing."""
    correlation: np.ndarray
    """Shape ``(frame, wavelength)``, -1 .. 1; NaN where there was nothing to compare with."""
    typical: np.ndarray
    """What a pulse at rest has: the median over the pulses it is judged with, shape ``(frame, wavelength)``."""
    limit: np.ndarray
    """A pulse below it is out of place, shape ``(frame, wavelength)``; NaN where nothing can be said."""
    shifts: tuple[tuple[int, int], ...] = ()
    """Lasting changes: after which frame, and at how many wavelengths. The body lay elsewhere from then on, or what
    absorbs in it had changed: signals alone do not tell."""

    def __post_init__(self) -> None:
        for name in ("correlation", "typical", "limit"):
            object.__setattr__(self, name, read_only(getattr(self, name), float))

    @property
    def moved(self) -> np.ndarray:
        """Which pulses are out of place: bool, shape ``(frame, wavelength)``."""
        return np.asarray(self.correlation < self.limit)

    @property
    def frames(self) -> tuple[int, ...]:
        """Frames with a pulse out of place."""
        return tuple(int(f) for f in np.flatnonzero(self.moved.any(axis=1)))

    @property
    def notes(self) -> tuple[str, ...]:
        """What the curve says of the scan as a whole, and what it cannot say."""
        if self.compared == "nothing":
            return (f"motion: {self.correlation.size} pulses are too few to tell which of them moved",)
        notes = [
            f"motion: after frame {frame} the signals of {count} of {len(self.wavelengths_nm)} wavelengths changed for "
            "good: the body moved, or what absorbs in it changed; no pulse counts as out of place by that"
            for frame, count in self.shifts
        ]
        unknown = ~np.isfinite(self.limit - self.correlation)
        if unknown.any():
            notes.append(
                f"motion: nothing can be said of {unknown.sum()} of {unknown.size} pulses: too much noise, or no "
                "channel that can be trusted"
            )
        return tuple(notes)

    def of_frame(self, frame: int) -> tuple[str, ...]:
        """Return a sentence for each pulse of a frame that is out of place."""
        return tuple(
            f"frame {frame}: {self.wavelengths_nm[i]:g} nm moved, correlation {self.correlation[frame, i]:.2f} "
            f"against {self.typical[frame, i]:.2f}"
            for i in np.flatnonzero(self.moved[frame])
        )

    def table(self) -> dict[str, Any]:
        """Return all of it as plain values; None where nothing can be said."""
        arrays = {name: _plain(getattr(self, name)) for name in ("correlation", "typical", "limit")}
        return {
            "wavelengths_nm": list(self.wavelengths_nm),
            "compared": self.compared,
            "frames": list(self.frames),
            "moved": [{"frame": int(f), "wavelength_nm": self.wavelengths_nm[i]} for f, i in np.argwhere(self.moved)],
            "shifts": [{"after_frame": f, "wavelengths": count} for f, count in self.shifts],
            **arrays,
            "notes": list(self.notes),
        }


def _plain(values: np.ndarray) -> list[list[float | None]]:
    return [[float(v) if np.isfinite(v) else None for v in row] for row in values]
