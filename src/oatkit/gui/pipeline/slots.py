"""The tables of a pipeline as the window lists them: in their order, with what may be put into each."""

from dataclasses import dataclass

from oatkit.api import FluenceModel, ForwardModel, Preprocessor, Segmenter, Solver, Unmixer
from oatkit.parameters import Parameters
from oatkit.pipeline import Pipeline
from oatkit.tables import AbsorptionTable, GridTable, MotionTable, OpticsTable, ScanTable


@dataclass(frozen=True)
class Slot:
    """A place for a table."""

    name: str
    title: str
    takes: type[Parameters]
    """The class, or for a plugin the base class of its kind."""
    optional: bool = False

    @property
    def is_plugin(self) -> bool:
        """Whether there is a plugin to choose."""
        return bool(self.takes.kind)


SLOTS = (
    Slot("scan", "Scan", ScanTable),
    Slot("motion", "Motion", MotionTable, optional=True),
    Slot("grid", "Grid", GridTable),
    Slot("preprocess", "Preprocess", Preprocessor),
    Slot("forward", "Forward model", ForwardModel),
    Slot("reconstruct", "Reconstruct", Solver),
    Slot("segment", "Segment", Segmenter, optional=True),
    Slot("optics", "Optics", OpticsTable),
    Slot("fluence", "Fluence", FluenceModel, optional=True),
    Slot("absorption", "Absorption", AbsorptionTable, optional=True),
    Slot("unmix", "Unmix", Unmixer, optional=True),
)
"""In the order of the window."""


@dataclass(frozen=True)
class Place:
    """One table of one pipeline: a slot, and within ``preprocess`` which of its steps."""

    slot: Slot
    index: int | None = None

    def part(self, pipeline: Pipeline) -> Parameters | None:
        """Return what stands there; None where nothing does."""
        found = getattr(pipeline, self.slot.name)
        if self.index is None:
            return found
        return found[self.index] if self.index < len(found) else None


def places(pipeline: Pipeline) -> list[Place]:
    """Return all places of a pipeline in the order of the window."""
    found = []
    for slot in SLOTS:
        if slot.name == "preprocess":
            found += [Place(slot, index) for index in range(len(pipeline.preprocess))]
        else:
            found.append(Place(slot))
    return found
