"""What the engine tells while it works."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from oatkit.api import Iterate
from oatkit.data import Image


@dataclass(frozen=True)
class StepStarted:
    """A step begins."""

    step: str


@dataclass(frozen=True)
class StepIterate:
    """A solver has taken a step."""

    step: str
    wavelength_nm: float
    iterate: Iterate


@dataclass(frozen=True)
class StepDone:
    """A step has ended; `images` holds what it made, by name."""

    step: str
    seconds: float
    images: Mapping[str, Image]
    notes: tuple[str, ...] = ()


Event = StepStarted | StepIterate | StepDone
Listener = Callable[[Event], None]


def ignore(event: Event) -> None:
    """Listen to nothing."""
