"""A speed of sound picked by focus."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from oatkit.content import ByContent
from oatkit.pipeline import Pipeline


@dataclass(frozen=True, eq=False)
class Focus(ByContent):
    """A speed of sound picked by the sharpness of the image, and all that was seen on the way."""

    speeds_m_s: tuple[float, ...]
    """All that were tried, rising: coarse over the whole range, fine about the maximum of `metric`."""
    scores: Mapping[str, tuple[float, ...]]
    """By metric, one for each speed; see `oatkit.focus.metrics`."""
    picks: Mapping[str, float]
    """By metric: the top of the parabola through the best speed and its neighbours, to 0.1 m/s."""
    metric: str
    header_m_s: float
    """What the scan says."""
    header_source: str
    """Where the scan has it from."""
    notes: tuple[str, ...] = ()
    """What to know before trusting the pick."""

    @property
    def speed_m_s(self) -> float:
        """The pick of the chosen metric."""
        return self.picks[self.metric]

    def apply(self, pipeline: Pipeline) -> Pipeline:
        """Return the same pipeline with the picked speed of sound."""
        table = pipeline.scan.model_copy(update={"speed_of_sound_m_s": self.speed_m_s})
        return pipeline.model_copy(update={"scan": table})

    def table(self) -> dict[str, Any]:
        """Return everything as plain values, for a result's record."""
        return {
            "speed_m_s": self.speed_m_s,
            "metric": self.metric,
            "header_m_s": self.header_m_s,
            "header_source": self.header_source,
            "picks": dict(self.picks),
            "speeds_m_s": list(self.speeds_m_s),
            "scores": {name: list(scores) for name, scores in self.scores.items()},
            "notes": list(self.notes),
        }
