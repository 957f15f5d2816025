"""The calibration that makes the spectra fit: light of the wrong strength leaves a colour that no chromophore has."""

from dataclasses import replace

import numpy as np

from oatkit.api import Calibration
from oatkit.light import Passes, Settled

STEP = 1.4
"""Factor between the calibrations that are tried."""
HIGHEST, LOWEST = 4, -4
"""Powers of `STEP`, relative to the calibration by the stated mean absorption, between which is searched."""
TOLERANCE = 3e-3
PASSES = 15
"""For each calibration that is tried."""
PRECISION, PRECISION_OF_PROBE = 0.01, 0.03
"""Of the logarithm of the calibration, and of that for a changed mu_s', where only the effect on so2 counts."""
SHALLOW = 0.9
"""Least misfit, relative to that without any effect of absorption on light, above which the spectra say nothing."""


def by_spectra(passes: Passes) -> Calibration:
    r"""Return the K at which light and chromophores explain the pressure best.

    .. math:: \min_K \| p_0 - K \Gamma \Phi[E c] \, E c \|, \qquad c = c(K) \text{ settled}

    K sets how much the blood dims its own light, and the dimming has a colour. For white noise in p0 this is the most
    likely K. It needs more wavelengths than chromophores; a wrong mu_s' moves K so that mu_a mu_s', which is what dims
    the light, stays nearly right.
    """
    # Where the minimum lies about, coarse light tells; where exactly, it does not: it misses the dips in the vessels.
    rough = _Search(replace(passes, model=replace(passes.model, factor=2 * passes.model.factor)))
    best = rough.sweep()
    if best is None:
        return Calibration(None, rough.curve)
    found = by_spectra_near(passes, best, rough.tried[best][1], PRECISION)
    return replace(found, curve=tuple(sorted((*rough.curve, *found.curve))))


def by_spectra_near(
    passes: Passes, known: float, start: np.ndarray, precision: float = PRECISION_OF_PROBE
) -> Calibration:
    """Return the same where it is known to lie within a factor `STEP` of `known`, at which `start` was fitted."""
    search = _Search(passes)
    search.refine(known, start, precision)
    return Calibration(min(search.tried, key=lambda k: search.tried[k][0]), search.curve)


class _Search:
    """Keeps what was tried."""

    def __init__(self, passes: Passes) -> None:
        self.passes = passes
        self.tried: dict[float, tuple[float, np.ndarray]] = {}
        """By calibration: its misfit, and the absorption that was fitted, from which others start."""

    @property
    def curve(self) -> tuple[tuple[float, float], ...]:
        """Calibrations and misfits in the order of the former."""
        return tuple(sorted((k, misfit) for k, (misfit, _) in self.tried.items()))

    def sweep(self) -> float | None:
        """Try calibrations from high to low until the absorption runs away, and return the best, if there is one."""
        settled = replace(self.passes, calibration=None).settle(PASSES, TOLERANCE)
        middle, start = settled.state.calibration, settled.state.fitted
        for power in range(HIGHEST, LOWEST - 1, -1):
            settled = self.settle(middle * STEP**power, start)
            start = settled.state.fitted
            if settled.diverged:
                break
        first = max(self.tried)
        best = min(self.tried, key=lambda k: self.tried[k][0])
        return None if self.tried[best][0] > SHALLOW * self.tried[first][0] else best

    def settle(self, calibration: float, start: np.ndarray) -> Settled:
        """Settle at one calibration and note its misfit."""
        passes = replace(self.passes, calibration=calibration)
        settled = passes.settle(PASSES, TOLERANCE, start)
        self.tried[calibration] = (passes.misfit(settled.state), settled.state.fitted)
        return settled

    def refine(self, best: float, start: np.ndarray, precision: float) -> None:
        """Try more calibrations about a good one."""
        from scipy.optimize import minimize_scalar

        def misfit(logarithm: float) -> float:
            calibration = float(np.exp(logarithm))
            nearest = min(self.tried, key=lambda k: abs(np.log(k) - logarithm), default=None)
            self.settle(calibration, start if nearest is None else self.tried[nearest][1])
            return self.tried[calibration][0]

        ends = np.log([best / STEP, best * STEP])
        minimize_scalar(misfit, bounds=tuple(ends), method="bounded", options={"xatol": precision})
