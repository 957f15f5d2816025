"""What one run has told so far: where it is, how it converges, what is to be known of it."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from oatkit.events import StepDone, StepStarted
from oatkit.gui.session import Converging, Finished
from oatkit.result import Result

LONGEST = 2000
"""Points of a curve; of longer ones every second is left out."""


@dataclass
class Curve:
    """How a solver converges at one wavelength: by iteration."""

    wavelength_nm: float
    points: list[Converging] = field(default_factory=list)

    def add(self, point: Converging) -> None:
        """Add a point, if its iteration is a new one; a solver that begins again begins a new curve."""
        last = self.points[-1].iteration if self.points else 0
        if point.iteration == last:
            return
        if point.iteration < last:
            self.points = []
        self.points.append(point)
        if len(self.points) > LONGEST:
            self.points = self.points[::2]

    def series(self, name: str) -> list[tuple[float, float]]:
        """Return (iteration, value) of ``"residual_norm"``, ``"relative_gap"`` or ``"negative_share"``, finite ones."""
        pairs = ((float(point.iteration), float(getattr(point, name))) for point in self.points)
        return [pair for pair in pairs if math.isfinite(pair[1])]


@dataclass
class RunLog:
    """The story of a run."""

    step: str = ""
    """What is at work, in words."""
    curve: Curve | None = None
    """Of the wavelength at work, or the last one."""
    notes: list[str] = field(default_factory=list)
    result: Result | None = None
    wavelengths: list[float] = field(default_factory=list)
    """That were begun."""

    def take(self, items: Iterable[Any]) -> None:
        """Read what a job has yielded."""
        for item in items:
            if isinstance(item, StepStarted):
                self.step = item.step
            elif isinstance(item, Converging):
                self._converge(item)
            elif isinstance(item, StepDone):
                self._note(item.notes)
            elif isinstance(item, Finished):
                self.result = item.result
                self._note(item.result.warnings)

    def text(self, wavelengths: int = 0) -> str:
        """Return where the run is, for one line; `wavelengths` is how many the scan has."""
        return ", ".join(self._words(wavelengths))

    def _words(self, wavelengths: int) -> Iterator[str]:
        yield self.step or "starting"
        if self.curve is None or self.step != "reconstruct":
            return
        count = f" ({len(self.wavelengths)} of {wavelengths})" if wavelengths > 1 else ""
        yield f"{self.curve.wavelength_nm:g} nm{count}"
        if not self.curve.points:
            yield "setting the scale"
            return
        last = self.curve.points[-1]
        yield f"iteration {last.iteration}"
        if math.isfinite(last.relative_gap):
            yield f"gap {last.relative_gap:.1e}"

    def _converge(self, point: Converging) -> None:
        if self.curve is None or self.curve.wavelength_nm != point.wavelength_nm:
            self.curve = Curve(point.wavelength_nm)
            self.wavelengths.append(point.wavelength_nm)
        self.curve.add(point)

    def _note(self, notes: Iterable[str]) -> None:
        self.notes += [note for note in notes if note not in self.notes]
