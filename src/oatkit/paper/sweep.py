"""A solver at many weights: the best one, known since the truth is, and the one that a rule picks without it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from oatkit.api import Iterate, Problem
from oatkit.metrics import psnr
from oatkit.paper.methods import Method
from oatkit.weights import l_curve_chord, l_curve_corner, with_weight


@dataclass(frozen=True, eq=False)
class Sweep:
    """What a solver gave at each of several weights."""

    label: str
    weights: tuple[float, ...]
    """Rising."""
    ends: tuple[Iterate, ...]
    truth: np.ndarray

    @cached_property
    def scores(self) -> tuple[float, ...]:
        """PSNR at each weight, dB."""
        return tuple(psnr(end.image, self.truth) for end in self.ends)

    @property
    def best(self) -> int:
        """Index of the weight of highest PSNR."""
        return int(np.argmax(self.scores))

    @property
    def residual_norms(self) -> list[float]:
        """|A x - b| at each weight."""
        return [end.residual_norm for end in self.ends]

    @property
    def penalties(self) -> list[float]:
        """The unweighted penalty at each weight."""
        return [end.penalty for end in self.ends]

    @property
    def corner(self) -> int:
        """Index of the corner of the L-curve by curvature, which the rule "l-curve" takes."""
        return l_curve_corner(self.weights, self.residual_norms, self.penalties)

    @property
    def chord(self) -> int:
        """Index of the corner by the distance to the chord."""
        return l_curve_chord(self.weights, self.residual_norms, self.penalties)

    def thresholded(self, label: str) -> "Sweep":
        """Return the same with negative pixels set to zero; residuals and penalties stay those of the signed images."""
        ends = tuple(_without_negatives(end) for end in self.ends)
        return Sweep(label, self.weights, ends, self.truth)


def sweep(method: Method, problem: Problem, per_decade: int, truth: np.ndarray) -> Sweep:
    """Solve a problem at each weight of a method's range."""
    solver, weights = method.solver(), method.weights(per_decade)
    ends = tuple(with_weight(solver, weight).solve(problem) for weight in weights)
    return Sweep(method.label, weights, ends, truth)


def _without_negatives(end: Iterate) -> Iterate:
    return replace(end, image=np.maximum(end.image, 0))
