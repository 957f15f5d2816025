"""Simulated data of the experiments: a body in light, its signals, and the inverse problem that they pose."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from oatkit.api import FluenceModel, ForwardModel, Problem
from oatkit.data import Grid, Image, Optics, Scan
from oatkit.memo import Memo
from oatkit.paper.setting import Setting
from oatkit.pipeline import Pipeline
from oatkit.reconstruction import preprocess, problems
from oatkit.registry import plugin
from oatkit.simulate import Body, arc_detectors, msot_geometry, simulate_scan

Pressure = Callable[[Grid], Image]
"""What makes the initial pressure of a body on any grid."""

SCATTERING_PER_CM = 12.0
"""mu_s' of the bodies, that of the paper's Fig. 1."""
BACKGROUND_PER_CM = 0.2
"""mu_a that light is attenuated with in the paper's Fig. 1."""


def light_model() -> FluenceModel:
    """Return the paper's: diffusion in the plane, the light at the wall unattenuated."""
    return _made("fluence_model", "diffusion-fvm", FluenceModel)


def lit(body: Body, grid: Grid) -> tuple[Image, Image]:
    """Return initial pressure and fluence of a body on a grid, in the light of a homogeneous one, as in Fig. 1."""
    return body.lit(grid, light_model(), 100 * SCATTERING_PER_CM, 100 * BACKGROUND_PER_CM)


def lit_by_itself(body: Body, grid: Grid, scattering_per_cm: float) -> tuple[Image, Image]:
    """Return the same with the light that the body's own absorption leaves: dark tubes cast shadows."""
    absorption = body.absorption(grid)
    optics = Optics((700.0,), absorption.values, np.array([100 * scattering_per_cm]))
    fluence = light_model().fluence(body.boundary(grid), optics)
    values = absorption.values * fluence.values
    return Image(values, "initial_pressure", "a.u.", grid, fluence.wavelengths_nm), fluence


def scan_of(pressure: Pressure, setting: Setting) -> Scan:
    """Return the noisy signals of an initial pressure that exists on any grid."""
    geometry = replace(msot_geometry(), detectors=arc_detectors(setting.detectors, 0.0405, setting.coverage_deg))
    return simulate_scan(
        pressure,
        _made("forward_model", "arc", ForwardModel),
        geometry=geometry,
        field_of_view_m=setting.field_of_view_mm * 1e-3,
        pixels=setting.fine_pixels,
        snr_db=setting.snr_db,
        seed=setting.seed,
    )


def pipeline_for(preset: str, setting: Setting, *changes: str) -> Pipeline:
    """Return a preset on the grid of the setting, in the band that its pixels hold."""
    band_mhz = 0.4 * 1500 / setting.grid.pixel_size_m * 1e-6
    return Pipeline.load(
        preset,
        [
            f"grid.pixels={setting.pixels}",
            f"grid.field_of_view_mm={setting.field_of_view_mm}",
            f"preprocess.band-pass.high={min(7.0, band_mhz):.3g}",
            *changes,
        ],
    )


def problem_of(pipeline: Pipeline, scan: Scan) -> Problem:
    """Return the inverse problem of the first frame and wavelength."""
    memo = Memo()
    clean = preprocess(pipeline, scan, 0, memo)
    return next(problems(pipeline, clean, pipeline.grid.grid(), memo))[1]


def _made(kind: str, name: str, base: Any) -> Any:
    made = plugin(kind, name)()
    assert isinstance(made, base)
    return made
