"""Unmixing in which absorption, light and concentrations are made to agree."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from oatkit.api import Image, UnmixProblem, ValidationError, param
from oatkit.builtin.unmixers.coarse_light import CoarseLight
from oatkit.builtin.unmixers.mixture import Mixture
from oatkit.builtin.unmixers.nonnegative import nonnegative
from oatkit.builtin.unmixers.saturation import total_and_saturation
from oatkit.builtin.unmixers.self_calibration import Calibration, by_spectra, by_spectra_near
from oatkit.builtin.unmixers.settling import Passes, Settled
from oatkit.builtin.unmixers.spectral import Fit, SpectralUnmixer
from oatkit.plausible import implausible


class FluenceCorrected(SpectralUnmixer):
    r"""Non-negative unmixing whose light follows from the concentrations found, after [Cox2006]_ and [Cox2009]_.

    A constant correction leaves the spectrum of deep tissue coloured by the blood above it. Here each pass computes the
    light that the absorption of the pass before leaves, at every wavelength, and unmixes again:

    .. math:: \mu_a^{(n)} = \frac{p_0}{K \Gamma \Phi[\mu_a^{(n-1)}]}, \qquad
        c^{(n)} = \arg\min_{c \ge 0} \| E c - \mu_a^{(n)} \|

    until the absorption rests. The first light is that of the homogeneous body of ``[optics]``. K is
    ``absorption.calibration`` times the Grueneisen parameter. Where it is not known, one number for all wavelengths
    takes its place: with ``calibrate = "spectra"`` the one at which chromophores and light explain the pressure best
    (light of the wrong strength leaves a colour that no chromophore has), with "mean" the one that makes the mean
    absorption of the body what ``[optics]`` states. The former needs more wavelengths than chromophores, and gives way
    to the latter, with a note, where the spectra do not tell.

    In the light, absorption is kept below mu_s', where the diffusion of light ends. A K that is too low makes the
    absorption of deep vessels run away to that limit: ``diagnostics["diverged"]`` and a note say so.
    ``so2_sensitivity_scattering`` and ``so2_sensitivity_calibration`` show the change of so2 where mu_s', or K, is
    higher by the share `probe`: what is not known well should not matter much.

    .. [Cox2006] B. T. Cox, S. R. Arridge, K. P. Koestli, P. C. Beard, Appl. Opt. 45, 1866 (2006),
       doi:10.1364/AO.45.001866.
    .. [Cox2009] B. T. Cox, S. R. Arridge, P. C. Beard, J. Opt. Soc. Am. A 26, 443 (2009),
       doi:10.1364/JOSAA.26.000443.
    """

    name: ClassVar[str] = "fluence-corrected"
    passes: int = param(30, "at most as many passes between absorption and light", at_least=1, at_most=1000)
    tolerance: float = param(
        1e-3, "largest relative change of the absorption, at any wavelength, that counts as rest", above=0, below=1
    )
    calibrate: Literal["spectra", "mean"] = param(
        "spectra",
        "what stands in for an unknown absorption.calibration: that the spectra fit best, or that the mean absorption "
        "of the body is the one of [optics]",
    )
    light_pixel: float = param(
        0.25, "pixel for changes of the light, rounded to whole pixels of the image", unit="mm", above=0
    )
    probe: float = param(
        0.2, "share by which mu_s' and K are raised to show the sensitivity of so2; 0 for none", at_least=0, at_most=1
    )

    def unmix(self, problem: UnmixProblem) -> Mapping[str, Image]:
        """Return what `nnls` returns, ``absorption`` and ``fluence`` as they settled, and the sensitivities of so2.

        Raises `ValidationError` where the pipeline has no outline or no model of light.
        """
        mixture = self.mixture(problem.initial_pressure.wavelengths_nm)
        passes = self._passes(problem, mixture)
        scale = self._scale(passes, mixture)
        scaled = replace(passes, calibration=scale.value)
        settled = scaled.settle(self.passes, self.tolerance)
        images = self._images(problem, mixture, settled, scale)
        if self.probe and "so2" in images:
            images |= dict(self._sensitivities(passes, mixture, settled, images["so2"]))
        return images

    def _by_spectra(self, passes: Passes, mixture: Mixture) -> bool:
        return passes.calibration is None and self.calibrate == "spectra" and mixture.overdetermined

    def _scale(self, passes: Passes, mixture: Mixture) -> Calibration:
        """Return the calibration to use; none where the mean absorption sets it in each pass."""
        return by_spectra(passes) if self._by_spectra(passes, mixture) else Calibration(passes.calibration, ())

    def _solve(self, spectra: np.ndarray, data: np.ndarray) -> np.ndarray:
        return nonnegative(spectra, data)

    def _passes(self, problem: UnmixProblem, mixture: Mixture) -> Passes:
        boundary, optics = problem.boundary, problem.optics
        if boundary is None or problem.fluence is None or problem.fluence_model is None or optics is None:
            raise ValidationError(
                "unmixer 'fluence-corrected' needs the outline of the body and a model of light: add [segment] and "
                "[fluence] to the pipeline, or take the unmixer 'nnls'"
            )
        factor = max(1, round(self.light_pixel * 1e-3 / boundary.grid.pixel_size_m))
        model = CoarseLight(problem.fluence_model, boundary, optics, problem.fluence.values.astype(float), factor)
        pressure = problem.initial_pressure.values.astype(float)
        fit = partial(self.fit, mixture)
        return Passes(pressure, model, fit, mixture.spectra, problem.calibration, problem.floor)

    def _images(
        self, problem: UnmixProblem, mixture: Mixture, settled: Settled, scale: Calibration
    ) -> dict[str, Image]:
        pressure, state = problem.initial_pressure, settled.state
        facts = {
            "passes": settled.passes,
            "change": settled.changes,
            "settled": settled.converged,
            "diverged": settled.diverged,
            "calibration": state.calibration,
            "calibrated_by": _origin(problem, scale),
            "calibration_curve": scale.curve,
        }

        def image(values: np.ndarray, quantity: str, unit: str) -> Image:
            return Image(values.astype(np.float32), quantity, unit, pressure.grid, pressure.wavelengths_nm, (), facts)

        absorption = image(state.absorption, "absorption", "1/m")
        fit = Fit(mixture, state.concentrations, absorption)
        made = {"fluence": image(state.light, "fluence", ""), "absorption": absorption}
        return made | fit.images(self.so2_floor, facts, tuple(_notes(problem, settled, scale)))

    def _sensitivities(
        self, passes: Passes, mixture: Mixture, settled: Settled, so2: Image
    ) -> Iterator[tuple[str, Image]]:
        """Yield the change of so2 for a higher mu_s', K found anew if it was found, and for a higher K."""
        factor, start = 1 + self.probe, settled.state
        scattering = replace(passes, scattering=factor)
        if self._by_spectra(passes, mixture):
            found = by_spectra_near(scattering, start.calibration, start)
            scattering = replace(scattering, calibration=found.value)
        calibration = replace(passes, calibration=factor * start.calibration)
        for name, altered in (
            ("so2_sensitivity_scattering", scattering),
            ("so2_sensitivity_calibration", calibration),
        ):
            again = altered.settle(self.passes, self.tolerance, start)
            by_name = dict(zip(mixture.names, again.state.concentrations, strict=True))
            other = {key: plane for key, plane, _ in total_and_saturation(by_name, self.so2_floor)}["so2"]
            facts = {"probe": self.probe, "settled": again.converged, "diverged": again.diverged}
            change = (other - so2.values[0]).astype(np.float32)
            yield name, Image(change, name, "", so2.grid, diagnostics=facts)


def _origin(problem: UnmixProblem, scale: Calibration) -> str:
    """Say where the calibration comes from."""
    if problem.calibration is not None:
        return "absorption.calibration"
    return "the spectra" if scale.value is not None else "the mean absorption of the body in [optics]"


def _notes(problem: UnmixProblem, settled: Settled, scale: Calibration) -> Iterator[str]:
    assert problem.optics is not None
    assert problem.boundary is not None
    inside = problem.boundary.values[0] < 0
    stated, found = (float(np.mean(v)) for v in (problem.optics.absorption_per_m, settled.state.fitted[:, inside]))
    if scale.value is not None and problem.calibration is None:
        yield (
            f"no calibration is known: K = {scale.value:.3g} a.u. m makes the spectra fit best; the mean absorption of "
            f"the body is then {found:.3g} 1/m ([optics] says {stated:.3g})"
        )
    elif problem.calibration is None:
        why = ", since the spectra do not tell" if scale.curve else ""
        yield (
            "no calibration is known: absorption and concentrations are scaled so that the mean absorption of the body "
            f"is the {stated:.3g} 1/m of [optics]{why}"
        )
    yield from implausible(settled.state.fitted, problem.optics, inside)
    if settled.diverged:
        yield (
            f"the passes between absorption and light ran away in {settled.held:.1%} of the body, where only the limit "
            "mu_s' holds them: deep values are wrong; check absorption.calibration and the mu_a of [optics]"
        )
    elif settled.changes and not settled.converged:
        yield (
            f"the last of {settled.passes} passes between absorption and light changed the absorption by "
            f"{settled.changes[-1]:.1%}; raise unmix.passes"
        )
