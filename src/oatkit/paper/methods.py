"""The methods that the experiments compare, as the paper names them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from oatkit.api import Solver
from oatkit.registry import plugin


@dataclass(frozen=True)
class Method:
    """A solver with its parameters, under the name that a figure gives it."""

    label: str
    use: str
    range: tuple[float, float] = (1e-4, 1e-1)
    """Of the weights that are tried."""
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def weights(self, per_decade: int) -> tuple[float, ...]:
        """Return the weights that are tried, rising."""
        low, high = self.range
        return tuple(float(w) for w in np.geomspace(low, high, 1 + round(per_decade * np.log10(high / low))))

    def solver(self) -> Solver:
        """Return the solver."""
        made = plugin("solver", self.use)(**self.parameters)
        assert isinstance(made, Solver)
        return made


L2 = Method("L2", "lsqr", (1e-6, 1e-1))
L2_THRESHOLD = Method("L2, thresholded", "lsqr-threshold", (1e-6, 1e-1))
NNLS = Method("L2, x ≥ 0", "nnls", (1e-6, 1e-1), {"tolerance": 3e-4})
MAXENT = Method("MaxEnt, structural prior", "maxent-nlcg")
MAXENT_FLAT = Method("MaxEnt, flat prior", "maxent-nlcg", parameters={"prior": 0.01})
L1 = Method("L1, x ≥ 0", "l1")
TV = Method("TV, x ≥ 0", "tv")
