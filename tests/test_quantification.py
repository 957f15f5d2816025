"""The steps after the reconstruction: what they get, what they may return, and when they run again."""

from typing import ClassVar

import numpy as np
import pytest

from oatkit import Memo, Pipeline, PluginError, SolverError, ValidationError, load, run, steps
from oatkit.api import FluenceModel, Optics, Segmenter, Unmixer, param
from oatkit.data import Image
from oatkit.events import StepDone
from oatkit.tables import AbsorptionTable, OpticsTable

SMALL = ("grid.pixels=32", "grid.field_of_view_mm=9.0")
CALLS: list[str] = []


class Circle(Segmenter):
    """A circle about the middle, or what `wrong` says."""

    name: ClassVar[str] = "circle"
    radius: float = param(3.0, "its radius", unit="mm", above=0)
    wrong: str = param("", "what it does wrong")

    def segment(self, image: Image) -> Image:
        """Return the distance to the circle."""
        CALLS.append("segment")
        y, x = np.meshgrid(image.grid.y_m, image.grid.x_m, indexing="ij")
        distance = np.hypot(y, x) - self.radius * 1e-3
        if self.wrong == "nothing inside":
            distance = abs(distance) + 1e-3
        if self.wrong == "nan":
            distance[0, 0] = np.nan
        if self.wrong == "planes":
            return Image(np.stack([distance, distance]), "boundary", "m", image.grid, (1000.0, 2000.0))
        quantity = "mask" if self.wrong == "quantity" else "boundary"
        return Image(distance, quantity, "m", image.grid, diagnostics={"notes": ("it is only a circle",)})


class Exponential(FluenceModel):
    """Light that fades with depth, or what `wrong` says."""

    name: ClassVar[str] = "exponential"
    wrong: str = param("", "what it does wrong")

    def fluence(self, boundary: Image, optics: Optics) -> Image:
        """Return exp(-mu_a depth)."""
        CALLS.append("fluence")
        light = np.exp(-optics.absorption_per_m[:, None, None] * np.maximum(-boundary.values, 0))
        wavelengths = optics.wavelengths_nm
        if self.wrong == "negative":
            light = -light
        if self.wrong == "nan":
            light[0, 3, 3] = np.nan
        if self.wrong == "wavelengths":
            wavelengths = tuple(w + 1 for w in wavelengths)
        if self.wrong == "raises":
            raise KeyError("lamp")
        return Image(light, "fluence", "", boundary.grid, wavelengths)


class Everything(Unmixer):
    """Remembers what it was given."""

    name: ClassVar[str] = "everything"
    seen: ClassVar[list[object]] = []

    def unmix(self, problem):
        """Return the absorption under another name."""
        self.seen[:] = [problem.initial_pressure, problem.absorption, problem.boundary, problem.fluence_model]
        return {"copy": Image(problem.absorption.values, "copy", "a.u.", problem.absorption.grid, (700.0,))}


def pipeline(**parts: object) -> Pipeline:
    """A preset on a small grid, with outline, light and absorption unless said otherwise."""
    chain = {"segment": Circle(), "fluence": Exponential(), "absorption": AbsorptionTable(calibration=1.0)}
    return Pipeline.load("lsqr", SMALL).model_copy(update=chain | parts)


def test_the_chain_divides_pressure_by_gamma_and_light(small_scan):
    """Absorption equals pressure over fluence inside the outline and is NaN outside; each image tells its history."""
    result = run(pipeline(), small_scan)
    assert list(result) == ["initial_pressure", "boundary", "fluence", "absorption"]
    inside = result["boundary"].values[0] < 0
    expected = result["initial_pressure"].values[0][inside] / result["fluence"].values[0][inside]
    np.testing.assert_allclose(result["absorption"].values[0][inside], expected, rtol=1e-6)
    assert np.isnan(result["absorption"].values[0][~inside]).all()
    made_by = [step["step"] for step in result["absorption"].history]
    assert made_by[-5:] == ["forward", "reconstruct", "segment", "fluence", "absorption"]
    assert result["fluence"].history[-1]["optics"]["tissue"] == "soft-tissue"
    assert "boundary: it is only a circle" in result.warnings


def test_optics_of_the_pipeline_reach_the_light(small_scan):
    """The fluence model is handed mu_a of the table `[optics]`, in SI units."""
    dark = run(pipeline(optics=OpticsTable(absorption_per_cm=5.0, reduced_scattering_per_cm=10.0)), small_scan)
    depth = np.maximum(-dark["boundary"].values, 0)
    np.testing.assert_allclose(dark["fluence"].values, np.exp(-500.0 * depth))


def test_a_result_with_undefined_pixels_survives_the_store(small_scan, tmp_path):
    """All four images come back from a folder to the last bit, NaN included."""
    result = run(pipeline(), small_scan)
    result.save(tmp_path / "out.zarr")
    again = load(tmp_path / "out.zarr")
    for name, image in result.items():
        np.testing.assert_array_equal(again[name].values, image.values)
    assert again["absorption"].diagnostics["calibration"] == 1.0


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"absorption": AbsorptionTable(floor=0.5)}, []),
        ({"optics": OpticsTable(absorption_per_cm=1.0)}, ["fluence"]),
        ({"fluence": Exponential(wrong="no")}, ["fluence"]),
        ({"segment": Circle(radius=2.0)}, ["segment", "fluence"]),
    ],
    ids=["floor", "optics", "fluence", "segment"],
)
def test_only_what_follows_a_change_runs_again(small_scan, change, expected):
    """With a memo, a change of one step runs that step and those after it, and nothing before."""
    memo = Memo()
    run(pipeline(), small_scan, memo=memo)
    CALLS.clear()
    run(pipeline(**change), small_scan, memo=memo)
    assert expected == CALLS


def test_a_mask_that_was_redrawn_is_read_again(small_scan, tmp_path):
    """With one memo, another mask under the same name gives another outline."""
    memo, path = Memo(), tmp_path / "mask.npy"
    areas = []
    for size in (8, 16):
        mask = np.zeros((32, 32), np.uint8)
        mask[8 : 8 + size, 8 : 8 + size] = 1
        np.save(path, mask)
        drawn = Pipeline.load("lsqr", (*SMALL, "segment.use=mask", f"segment.path={path}"))
        areas.append((run(drawn, small_scan, memo=memo)["boundary"].values < 0).sum())
    assert areas[1] == pytest.approx(4 * areas[0], rel=0.1)


@pytest.mark.parametrize(
    ("parts", "error", "sentence"),
    [
        ({"segment": Circle(wrong="nothing inside")}, SolverError, "segmenter 'circle' found no body"),
        ({"segment": Circle(wrong="nan")}, SolverError, "segmenter 'circle' returned 1 pixels of 'boundary'"),
        ({"segment": Circle(wrong="planes")}, PluginError, "2 planes of 'boundary'"),
        ({"segment": Circle(wrong="quantity")}, PluginError, "of 'mask', not one of 'boundary'"),
        ({"fluence": Exponential(wrong="negative")}, SolverError, "fluence model 'exponential' returned 1024 pixels"),
        ({"fluence": Exponential(wrong="nan")}, SolverError, "1 pixels of 'fluence' that are not finite"),
        ({"fluence": Exponential(wrong="wavelengths")}, PluginError, "other wavelengths"),
        ({"fluence": Exponential(wrong="raises")}, PluginError, "'exponential' failed: KeyError"),
    ],
)
def test_what_a_step_returns_is_checked(small_scan, parts, error, sentence):
    """An outline without inside, light that is negative or not finite, other wavelengths: the plugin is named."""
    with pytest.raises(error, match=sentence):
        run(pipeline(**parts), small_scan)


def test_an_unmixer_gets_all_that_the_pipeline_has(small_scan):
    """Pressure, absorption, outline and the model of light reach an unmixer."""
    result = run(pipeline(unmix=Everything()), small_scan)
    pressure, absorption, boundary, model = Everything.seen
    assert pressure == result["initial_pressure"]
    assert absorption == result["absorption"]
    assert boundary == result["boundary"]
    assert model == Exponential()


def test_a_step_without_what_it_builds_on_is_refused(small_scan):
    """Absorption without light and light without outline are refused, from a file all at once and before any work."""
    text = Pipeline.load("lsqr").to_toml()
    with pytest.raises(ValidationError) as caught:
        Pipeline.loads(f"{text}\n[fluence]\nuse = 'beer-lambert'\n", "p.toml")
    assert str(caught.value) == "p.toml [fluence] needs [segment], which is missing"
    lame = pipeline(segment=None, fluence=None)
    with pytest.raises(ValidationError, match=r"\[absorption\] needs \[fluence\]"):
        next(steps(lame, small_scan))


@pytest.mark.parametrize("preset", ["maxent-absorption", "lsqr-threshold-absorption"])
def test_the_shipped_chains_run_to_absorption(small_scan, preset):
    """The presets with absorption give outline, light and absorption of a disc, non-negative where it is defined."""
    changes = (*SMALL, "fluence.ring_radius=14")
    done = [e for e in steps(Pipeline.load(preset, changes), small_scan) if isinstance(e, StepDone)]
    assert [event.step for event in done] == ["preprocess", "reconstruct", "segment", "fluence", "absorption"]
    absorption = done[-1].images["absorption"]
    assert (absorption.values[np.isfinite(absorption.values)] >= 0).all()
    assert absorption.unit == "a.u."
