"""Unmixing in which absorption, light and concentrations are made to agree."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from oatkit.api import Calibration, Image, UnmixProblem, ValidationError, param
from oatkit.builtin.unmixers.mixture import Mixture
from oatkit.builtin.unmixers.nonnegative import nonnegative
from oatkit.builtin.unmixers.saturation import total_and_saturation
from oatkit.builtin.unmixers.self_calibration import by_spectra, by_spectra_near
from oatkit.builtin.unmixers.spectral import Fit, SpectralUnmixer
from oatkit.light import CoarseLight, Passes, Settled, implausible


class FluenceCorrected(SpectralUnmixer):
    r"""Non-negative unmixing whose light follows from the concentrations found, after [Cox2006]_ and [Cox2009]_.

    A constant correction leaves the spectrum of deep tissue coloured by the blood above it. Here each pass computes the
    light that the absorption of the pass before leaves, at every wavelength, and unmixes again:

    .. math:: \mu_a^{(n)} = \frac{p_0}{K \Gamma \Phi[\mu_a^{(n-1)}]}, \qquad
        c^{(n)} = \arg\min_{c \ge 0} \| E c - \mu_a^{(n)} \|

    until the absorption rests. The first light is that of the homogeneous body of ``[optics]``. K is
    ``absorption.calibration`` times the Grueneisen parameter. Where it is not known, it is set in each pass, one number
    for all wavelengths, so that the mean absorption of the body is the one that ``[optics]`` states.

    With ``absorption.calibrated_by = "spectra"``, K is found once for a scan: it is the one at which chromophores and
    light explain the pressure best, for light of the wrong strength leaves a colour that no chromophore has. This needs
    more wavelengths than chromophores. A wrong mu_s' is then largely made up for by K, in its effect on so2.

    In the light, absorption is kept below mu_s', where the diffusion of light ends. A K that is too low makes the
    absorption of deep vessels run away to that limit: ``diagnostics["diverged"]`` and a note say so.
    ``so2_sensitivity_scattering`` and ``so2_sensitivity_calibration`` show the change of so2 where mu_s', or K, is
    higher by the share `probe`; where K comes from the spectra, it is found anew for the higher mu_s'.

    References:
        [Cox2006] Cox, Arridge, Koestli and Beard, Appl. Opt. 45, 1866 (2006), 10.1364/AO.45.001866.
        [Cox2009] Cox, Arridge and Beard, J. Opt. Soc. Am. A 26, 443 (2009), 10.1364/JOSAA.26.000443.
    """

    name: ClassVar[str] = "fluence-corrected"
    passes: int = param(30, "at most as many passes between absorption and light", at_least=1, at_most=1000)
    tolerance: float = param(
        1e-3, "largest relative change of the absorption, at any wavelength, that counts as rest", above=0, below=1
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
        settled = passes.settle(self.passes, self.tolerance)
        images = self._images(problem, mixture, settled)
        if self.probe and "so2" in images:
            refit = problem.calibrated_by == "spectra" and mixture.overdetermined
            images |= dict(self._sensitivities(passes, mixture, settled, images["so2"], refit))
        return images

    def calibrate(self, problem: UnmixProblem) -> Calibration:
        """Return the K at which chromophores and light explain the pressure best, where the spectra tell one."""
        mixture = self.mixture(problem.initial_pressure.wavelengths_nm)
        if not mixture.overdetermined:
            why = f"{len(mixture.names)} chromophores fit any spectrum of so few wavelengths"
            return Calibration(None, (), (f"the spectra tell no calibration: {why}",))
        passes = self._passes(problem, mixture)
        found = by_spectra(replace(passes, calibration=None))
        if found.value is None:
            return replace(found, notes=("the spectra tell no calibration: they fit as well without any light lost",))
        note = f"K = {found.value:.3g} a.u. m makes the spectra fit best"
        return replace(found, notes=(note,))

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

    def _images(self, problem: UnmixProblem, mixture: Mixture, settled: Settled) -> dict[str, Image]:
        pressure, state = problem.initial_pressure, settled.state
        facts = {
            "passes": settled.passes,
            "change": settled.largest,
            "settled": settled.converged,
            "diverged": settled.diverged,
            "calibration": state.calibration,
            "calibrated_by": "the mean of [optics]" if problem.calibration is None else problem.calibrated_by,
        }

        def image(values: np.ndarray, quantity: str, unit: str) -> Image:
            return Image(values.astype(np.float32), quantity, unit, pressure.grid, pressure.wavelengths_nm, (), facts)

        absorption = image(state.absorption, "absorption", "1/m")
        fit = Fit(mixture, state.concentrations, absorption)
        made = {"fluence": image(state.light, "fluence", ""), "absorption": absorption}
        return made | fit.images(self.so2_floor, facts, tuple(_notes(problem, settled)))

    def _sensitivities(
        self, passes: Passes, mixture: Mixture, settled: Settled, so2: Image, refit: bool
    ) -> Iterator[tuple[str, Image]]:
        """Yield the change of so2 for a higher mu_s', with K found anew where `refit`, and for a higher K."""
        factor, scale, start = 1 + self.probe, settled.state.calibration, settled.state.fitted
        scattering = replace(passes, scattering=factor)
        if refit:
            scattering = replace(scattering, calibration=by_spectra_near(scattering, scale, start).value)
        calibration = replace(passes, calibration=factor * scale)
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


def _notes(problem: UnmixProblem, settled: Settled) -> Iterator[str]:
    assert problem.optics is not None
    assert problem.boundary is not None
    inside = problem.boundary.values[0] < 0
    if problem.calibration is None:
        yield (
            "no calibration is known: absorption and concentrations are scaled so that the mean absorption of the body "
            f"is the {float(np.mean(problem.optics.absorption_per_m)):.3g} 1/m of [optics]"
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
            f"{settled.largest[-1]:.1%}; raise unmix.passes"
        )
