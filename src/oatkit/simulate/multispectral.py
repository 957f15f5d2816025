"""Scans at many wavelengths of a body that dims its own light."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from oatkit.api import ForwardModel
from oatkit.content import check_range
from oatkit.data import Geometry, Grid, Image, Scan
from oatkit.simulate.finite_elements import Band, diffuse_light
from oatkit.simulate.oxygen import SKIN_INDEX, OxygenBody
from oatkit.simulate.phantoms import Phantom
from oatkit.simulate.polar_mesh import PolarMesh
from oatkit.simulate.scan import simulate_scan
from oatkit.threads import for_each

WAVELENGTHS_NM = tuple(range(680, 901, 20))
"""Those of [Prakash2019]_."""
SPACING_M = 0.08e-3
"""Between the rings of the mesh, m."""
BAND = Band()

Saturations = Callable[[int], Mapping[str, float]]
"""From the number of a frame to the saturations of vessels, by name; the others keep theirs."""
Displacement = Callable[[int], tuple[float, float]]
"""From the number of a frame to how far the body has moved, ``(y, x)``, m."""


@dataclass(frozen=True, eq=False)
class LitBody:
    """A body and the light in it, on any grid; the light does not come from a grid."""

    body: OxygenBody
    wavelengths_nm: tuple[float, ...]
    mesh: PolarMesh
    at_nodes: np.ndarray
    """Fluence relative to the incident one, shape ``(wavelength, node)``."""

    def fluence(self, grid: Grid) -> Image:
        """Return the fluence; outside of the body, that of the wall in the same direction."""
        values = self.mesh.interpolate(self.at_nodes, grid.y_m[:, None], grid.x_m[None, :])
        return Image(values, "fluence", "", grid, self.wavelengths_nm)

    def pressure(self, grid: Grid, calibration: float = 1.0) -> Image:
        """Return the initial pressure K Gamma mu_a Phi with Gamma = 1 and the `calibration` K, in "a.u.".

        Raises `ValidationError` for a calibration that is not a positive number.
        """
        check_range("calibration", calibration, 1e-12, 1e12, "a positive number")
        values = calibration * self.body.absorption(grid, self.wavelengths_nm).values * self.fluence(grid).values
        return Image(values, "initial_pressure", "a.u.", grid, self.wavelengths_nm)


def illuminate(
    body: OxygenBody,
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    *,
    band: Band | None = BAND,
    spacing_m: float = SPACING_M,
) -> LitBody:
    """Return the body with its light at each wavelength, its own absorption and scattering fed into it.

    The light falls on a `band`, or on all of z where that is None, unattenuated: the water is clear. It is solved on
    triangles with rings at most `spacing_m` apart. Raises what `diffuse_light` raises.
    """
    mesh = PolarMesh.with_spacing(body.reach, spacing_m)
    found = body.which(*np.moveaxis(mesh.samples_m, 2, 0))
    # Where the outline is hollow, the side of a triangle runs just outside of it: that is skin, too.
    found = np.where(found < 0, SKIN_INDEX, found)
    shares = np.stack([(found == number).mean(axis=0) for number in range(len(body.tissues))])
    absorption, scattering = body.absorption_of_tissues(wavelengths_nm), body.scattering_of_tissues(wavelengths_nm)
    at_nodes = np.zeros((len(absorption), len(mesh.points_m)))

    def solve(index: int) -> None:
        at_nodes[index] = diffuse_light(mesh, absorption[index] @ shares, scattering[index] @ shares, band)

    for_each(solve, range(len(at_nodes)))
    return LitBody(body, tuple(float(w) for w in wavelengths_nm), mesh, at_nodes)


def simulate_multispectral(
    body: OxygenBody,
    forward_model: ForwardModel,
    *,
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    calibration: float = 1.0,
    band: Band | None = BAND,
    spacing_m: float = SPACING_M,
    saturations: Saturations | None = None,
    displacement_m: Displacement | None = None,
    geometry: Geometry | None = None,
    field_of_view_m: float = 25e-3,
    pixels: int = 541,
    snr_db: float | None = 32.0,
    snr_window: Literal["useful", "record"] = "useful",
    frames: int = 1,
    seed: int = 0,
) -> Scan:
    """Return the noisy signals of a lit body as a scan, ``(frame, wavelength, detector, sample)``.

    `saturations` changes the blood from frame to frame (a gas challenge), `displacement_m` moves the body with its
    light and all (breathing). Frames in the same state share light and noise-free signals; the light is solved once for
    each set of saturations. The other arguments are those of `illuminate` and `simulate_scan`, where the noise is
    explained; its level is set for each state, and a state's noise is drawn by `seed` plus the number of states before.

    Raises what these raise.
    """
    check_range("frames", frames, 1, 1_000_000, "a scan has at least one frame")
    states = [(_items(saturations, frame), _moved(displacement_m, frame)) for frame in range(frames)]
    lit = {
        key: illuminate(body.with_saturations(dict(key)), wavelengths_nm, band=band, spacing_m=spacing_m)
        for key in dict.fromkeys(blood for blood, _ in states)
    }
    scans = {
        (blood, moved): simulate_scan(
            oxygen_phantom(lit[blood], calibration, moved), forward_model, geometry=geometry,
            field_of_view_m=field_of_view_m, pixels=pixels, snr_db=snr_db, snr_window=snr_window,
            frames=states.count((blood, moved)), seed=seed + number,
        )
        for number, (blood, moved) in enumerate(dict.fromkeys(states))
    }  # fmt: skip
    first = scans[states[0]]
    left = {state: iter(np.asarray(scan.signals)) for state, scan in scans.items()}
    signals = np.stack([next(left[state]) for state in states])
    notes = (*first.notes, *_notes(calibration, band, spacing_m, len(scans)))
    return replace(first, signals=signals, valid=np.ones(signals.shape[:3], bool), notes=notes)


def _notes(calibration: float, band: Band | None, spacing_m: float, n_states: int) -> tuple[str, ...]:
    where = "all of z" if band is None else f"a band of {band.width_m * 1e3:g} mm, {band.n_terms} terms"
    return (
        f"light on {where}, finite elements between rings {spacing_m * 1e3:g} mm apart; p0 = {calibration:g} mu_a Phi",
        f"{n_states} state(s) of blood and place, the seed of the noise one higher for each",
    )


def oxygen_phantom(
    lit: LitBody, calibration: float = 1.0, displacement_m: tuple[float, float] = (0.0, 0.0)
) -> Phantom:  # fmt: skip
    """Return the initial pressure of a lit body as a phantom, moved by ``(y, x)`` m."""

    def oxygen(grid: Grid) -> Image:
        seen = replace(grid, centre_m=(grid.centre_m[0] - displacement_m[0], grid.centre_m[1] - displacement_m[1]))
        return replace(lit.pressure(seen, calibration), grid=grid)

    return oxygen


def _items(saturations: Saturations | None, frame: int) -> tuple[tuple[str, float], ...]:
    return () if saturations is None else tuple(sorted(saturations(frame).items()))


def _moved(displacement_m: Displacement | None, frame: int) -> tuple[float, float]:
    if displacement_m is None:
        return (0.0, 0.0)
    y, x = displacement_m(frame)
    check_range("displacement_m", (y, x), -0.05, 0.05, "the unit is m, so 0.3 mm is 3e-4")
    return (float(y), float(x))
