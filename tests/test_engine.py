"""The engine: the same numbers everywhere, nothing computed twice, and no plugin's fault passed on in silence."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from oatkit import Memo, Pipeline, PluginError, SolverError, ValidationError, load, plugin, run, run_frames, steps
from oatkit.api import ForwardModel, Iterate, Problem, Segmenter, Solver, param
from oatkit.data import Image
from oatkit.engine.provenance import versions
from oatkit.engine.rules import resolve
from oatkit.events import StepDone, StepIterate
from oatkit.simulate import disc, simulate_scan

SMALL = ("grid.pixels=32", "grid.field_of_view_mm=9.0")


class Rogue(Solver):
    """A solver that returns what it may not."""

    name: ClassVar[str] = "rogue"
    what: str = param("nan", "what it does wrong")

    def iterate(self, problem: Problem) -> Iterator[Iterate]:
        """Yield what `what` says."""
        image = np.zeros(problem.shape)
        if self.what == "nan":
            image[0, 0] = np.nan
        if self.what == "huge":
            image[0, 0] = 1e39  # more than a float32 can hold
        if self.what == "foreign":
            raise ZeroDivisionError
        if self.what == "shape":
            image = image[1:]
        if self.what == "raises":
            raise SolverError("no luck today")
        if self.what == "exits":
            raise SystemExit(3)
        if self.what == "mutates":
            problem.data[0] = 7
        if self.what == "type":
            yield "an image"  # type: ignore[misc]
        if self.what == "complex":
            image = image + 1j
        if self.what == "inside":
            image = "zeros"  # type: ignore[assignment]
        if self.what != "nothing":
            yield Iterate(image, 1)


class Circle(Segmenter):
    """A circle about the middle."""

    name: ClassVar[str] = "circle"
    radius: float = param(2.0, "its radius", unit="mm", above=0)

    def segment(self, image: Image) -> Image:
        """Return the distance to the circle."""
        y, x = np.meshgrid(image.grid.y_m, image.grid.x_m, indexing="ij")
        return Image(np.hypot(y, x) - self.radius * 1e-3, "boundary", "m", image.grid)


class Heavy(ForwardModel):
    """The arc model, with operators that say that they hold more than the memo may."""

    name: ClassVar[str] = "heavy"
    built: ClassVar[list[int]] = []

    def operator(self, geometry, grid):
        """Return the operator of the arc model, and count."""
        self.built.append(1)
        operator = plugin("forward_model", "arc")().operator(geometry, grid)
        operator.nbytes = 10**12
        return operator


def small(preset: str, *changes: str) -> Pipeline:
    """A preset on a grid that takes a moment."""
    return Pipeline.load(preset, [*SMALL, *changes])


@pytest.fixture(scope="module")
def maxent(small_scan):
    """The result of the maxent preset on the small scan."""
    return run(small("maxent"), small_scan)


def test_a_result_says_how_it_came_about(maxent, small_scan):
    """A result carries the pipeline as run, versions, the input's fingerprint, seconds, certificate and negatives."""
    image = maxent["initial_pressure"]
    assert maxent.pipeline == small("maxent").model_dump()
    assert {"oatkit", "numpy", "python"} <= set(maxent.versions)
    assert maxent.scan["fingerprint"] == small_scan.fingerprint
    assert set(maxent.seconds) == {"preprocess", "reconstruct"}
    assert image.diagnostics["relative_gap"][0] <= 1e-4
    assert image.diagnostics["negative_pixels"] == (0,)
    assert [step["use"] for step in image.history][-2:] == ["arc", "maxent-nlcg"]


def test_many_frames_give_the_numbers_of_one(maxent, small_scan, tmp_path):
    """A frame run alone and the same frame of a run over all are equal to the last bit."""
    stored = run_frames(small("maxent"), small_scan, tmp_path / "out.zarr")
    assert stored.frames == 2
    assert np.array_equal(stored["initial_pressure"].values, maxent["initial_pressure"].values)
    second = load(tmp_path / "out.zarr").frame(1)["initial_pressure"].values
    assert np.array_equal(second, run(small("maxent"), small_scan, frame=1)["initial_pressure"].values)
    assert not np.array_equal(second, maxent["initial_pressure"].values)


def iterates(pipeline: Pipeline, scan, memo: Memo) -> int:
    """How many steps the solver takes when the pipeline runs."""
    return sum(isinstance(event, StepIterate) for event in steps(pipeline, scan, 0, memo))


def test_only_what_changed_is_computed_again(small_scan):
    """With a memo, the same reconstruction is not run twice, nor when a later step changes; its parameters do count."""
    memo = Memo()
    pipeline = small("lsqr").model_copy(update={"segment": Circle()})
    assert iterates(pipeline, small_scan, memo) > 0
    assert iterates(pipeline, small_scan, memo) == 0
    assert iterates(pipeline.model_copy(update={"segment": Circle(radius=1.0)}), small_scan, memo) == 0
    assert iterates(small("lsqr", "reconstruct.weight=0.5"), small_scan, memo) > 0
    assert iterates(pipeline, small_scan.with_speed_of_sound(1510, "test"), memo) > 0


def test_a_segmenter_runs_after_the_reconstruction(small_scan):
    """A third party's segmenter yields the image `boundary` with the whole history."""
    result = run(small("lsqr").model_copy(update={"segment": Circle()}), small_scan)
    assert result["boundary"].unit == "m"
    assert [step["step"] for step in result["boundary"].history][-2:] == ["reconstruct", "segment"]


def test_a_run_can_be_left_at_any_iterate(small_scan):
    """Closing the generator ends the run at once, and the memo holds no half image."""
    memo = Memo()
    events = steps(small("lsqr"), small_scan, 0, memo)
    next(event for event in events if isinstance(event, StepIterate))
    events.close()
    done = [e for e in steps(small("lsqr"), small_scan, 0, memo) if isinstance(e, StepDone) and e.images]
    fresh = run(small("lsqr"), small_scan)
    assert np.array_equal(done[0].images["initial_pressure"].values, fresh["initial_pressure"].values)


@pytest.mark.parametrize(
    ("what", "error", "sentence"),
    [
        ("nan", SolverError, "solver 'rogue' returned 1 pixels of 'initial_pressure' that are not finite"),
        ("huge", SolverError, "solver 'rogue' returned 1 pixels of 'initial_pressure' that are not finite"),
        ("foreign", PluginError, "solver 'rogue' failed: ZeroDivisionError"),
        ("shape", PluginError, r"solver 'rogue' returned an image of shape \(31, 32\)"),
        ("nothing", PluginError, "solver 'rogue' ended without yielding an image"),
        ("raises", SolverError, "no luck today"),
        ("exits", PluginError, "solver 'rogue' failed: SystemExit: 3"),
        ("mutates", PluginError, "solver 'rogue' failed: ValueError: assignment destination is read-only"),
        ("type", PluginError, "solver 'rogue' yielded a str, not an Iterate"),
        ("complex", PluginError, "solver 'rogue' returned an image of complex128, not of real numbers"),
        ("inside", PluginError, "solver 'rogue' returned an image of"),
    ],
)
def test_what_a_plugin_returns_is_checked(small_scan, what, error, sentence):
    """A result that is not finite, of the wrong shape or missing is an error that names the plugin."""
    with pytest.raises(error, match=sentence):
        run(small("lsqr").with_solver(Rogue(what=what)), small_scan)


def test_a_frame_that_fails_leaves_the_others(small_scan, tmp_path):
    """A frame with samples that are not finite is recorded with its reason; the rest of the scan is reconstructed."""
    signals = np.array(small_scan.signals)
    signals[1, 0, 5, 100] = np.nan
    scan = replace(small_scan, signals=signals)
    pipeline = small("lsqr").model_copy(update={"preprocess": ()})
    stored = run_frames(pipeline, scan, tmp_path / "out.zarr")
    assert list(stored.failed) == [1]
    assert "not finite" in stored.failed[1]
    assert np.isfinite(stored.frame(0)["initial_pressure"].values).all()


def test_a_scan_of_which_every_frame_fails_leaves_no_result(small_scan, tmp_path):
    """Where nothing could be reconstructed there is an error and no folder."""
    with pytest.raises(SolverError):
        run_frames(small("lsqr").with_solver(Rogue(what="raises")), small_scan, tmp_path / "out.zarr")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("broken", [1, 2])
def test_a_frame_that_preprocessing_refuses_leaves_the_others(small_scan, tmp_path, broken):
    """A frame refused by a preprocessor (an energy of zero) is recorded, be it the first or another one."""
    energy = np.ones((2, 1))
    energy[broken - 1] = 0
    stored = run_frames(small("lsqr"), replace(small_scan, pulse_energy=energy), tmp_path / "out.zarr")
    assert list(stored.failed) == [broken - 1]
    assert stored.frame(2 - broken)["initial_pressure"].values.any()


def test_an_operator_is_built_once_for_all_frames(small_scan, tmp_path):
    """However large an operator says it is, frames share it."""
    pipeline = small("lsqr").model_copy(update={"forward": Heavy()})
    Heavy.built.clear()
    run_frames(pipeline, small_scan, tmp_path / "out.zarr")
    assert len(Heavy.built) == 1


def test_a_dead_channel_does_not_count(small_scan):
    """Whatever a channel marked invalid holds, the image is that without this channel."""
    valid = np.ones((2, 1, 48), bool)
    valid[0, 0, 7] = False
    quiet, loud = (np.array(small_scan.signals) for _ in range(2))
    quiet[0, 0, 7], loud[0, 0, 7] = 0, 1e6
    pipeline = small("lsqr").model_copy(update={"preprocess": ()})
    images = [run(pipeline, replace(small_scan, signals=s, valid=valid)) for s in (quiet, loud)]
    first, second = (result["initial_pressure"].values for result in images)
    assert np.array_equal(first, second)
    assert not np.array_equal(first, run(pipeline, small_scan)["initial_pressure"].values)


def test_a_weight_rule_is_resolved_once_and_recorded(small_scan, tmp_path):
    """With `l-curve` the result holds the pipeline asked for, the number that was chosen, and the curve."""
    result = run(small("lsqr", "reconstruct.weight=l-curve"), small_scan)
    assert result.requested["reconstruct"]["weight"] == "l-curve"
    chosen = result.pipeline["reconstruct"]["weight"]
    result.save(tmp_path / "out.zarr")
    choice = load(tmp_path / "out.zarr").weight_choice
    assert choice["curve"][3]["residual_norm"] == result.weight_choice["curve"][3]["residual_norm"]
    assert choice["rule"] == "l-curve"
    assert choice["weight"] == chosen
    assert len(choice["curve"]) >= 10
    again = run(small("lsqr", f"reconstruct.weight={chosen!r}"), small_scan)
    assert np.array_equal(again["initial_pressure"].values, result["initial_pressure"].values)


def test_a_weight_is_chosen_on_the_strongest_wavelength(small_scan):
    """Beside weaker signals, and a channel of larger ones that is not valid, the L-curve is that of the strongest."""
    quick = ("reconstruct.weight=l-curve", "reconstruct.n_iterations=5")
    pipeline = small("lsqr", *quick).model_copy(update={"preprocess": ()})
    valid = np.ones((2, 2, 48), bool)
    valid[:, 0, 7] = False
    both = np.repeat(np.asarray(small_scan.signals), 2, axis=1)
    both[:, 0] *= 0.5
    both[:, 0, 7] = 1e6
    two = replace(small_scan, signals=both, wavelengths_nm=(700.0, 800.0), valid=valid)
    assert resolve(pipeline, two).weight == resolve(pipeline, small_scan).weight


def test_a_speed_of_sound_by_focus_is_resolved_once_and_recorded(small_scan, tmp_path):
    """With `focus` the result holds the word, the number that was found, the curve, and what the file says."""
    result = run(small("lsqr", "scan.speed_of_sound_m_s=focus"), small_scan)
    assert result.requested["scan"]["speed_of_sound_m_s"] == "focus"
    found = result.pipeline["scan"]["speed_of_sound_m_s"]
    assert found == result.speed_choice["speed_m_s"] == result.scan["speed_of_sound_m_s"]
    assert result.scan["speed_of_sound_source"].startswith("focus; the file's is 1500.0 m/s")
    result.save(tmp_path / "out.zarr")
    kept = load(tmp_path / "out.zarr").speed_choice["scores"]["variance"]
    assert kept == tuple(result.speed_choice["scores"]["variance"])
    again = run(small("lsqr", f"scan.speed_of_sound_m_s={found!r}"), small_scan)
    assert np.array_equal(again["initial_pressure"].values, result["initial_pressure"].values)


def test_solving_with_an_unresolved_rule_is_refused(small_scan):
    """A solver handed the word instead of a number says so."""
    solver = small("lsqr", "reconstruct.weight=l-curve").reconstruct
    problem = Problem(np.eye(4), np.ones(4), (2, 2))
    with pytest.raises(ValidationError, match="l-curve"):
        solver.solve(problem)


def test_overrides_of_the_scan_are_in_the_result(small_scan):
    """A speed of sound set in the pipeline is used, and the result says that it came from there."""
    result = run(small("lsqr", "scan.speed_of_sound_m_s=1480"), small_scan)
    assert result.scan["speed_of_sound_m_s"] == 1480
    assert result.scan["speed_of_sound_source"] == "pipeline"


def test_a_frame_that_does_not_exist_is_refused(small_scan, tmp_path):
    """Asking for a frame beyond the scan is a ValidationError that names those there are."""
    with pytest.raises(ValidationError, match=r"frames 0 \.\. 1"):
        run(small("lsqr"), small_scan, frame=2)
    with pytest.raises(ValidationError, match=r"frames 0 \.\. 1"):
        run_frames(small("lsqr"), small_scan, tmp_path / "x.zarr", frames=[5])


def test_the_memo_forgets_the_least_recently_used():
    """Beyond its limit the memo drops what was not asked for longest, and keeps the newest whatever its size."""
    memo = Memo(limit_bytes=20)
    for key in "abc":
        memo.put(key, key, 8)
    assert memo.peek("a") is None
    assert memo.peek("b") == "b"
    memo.put("d", "d", 8)
    assert memo.peek("c") is None
    memo.put("big", "big", 100)
    assert len(memo) == 1
    assert memo.peek("big") == "big"


def test_rules_may_run_anew_on_each_frame(small_scan, tmp_path):
    """With scan.rules = "frame" each frame has a weight of its own, and the stored result keeps each choice."""
    arc = plugin("forward_model", "arc")()
    noisy = simulate_scan(
        lambda grid: disc(grid, radius_m=2e-3), arc, geometry=small_scan.geometry, field_of_view_m=1e-2, pixels=91,
        snr_db=0.0,
    )  # fmt: skip
    signals = np.concatenate([np.asarray(small_scan.signals)[:1], np.asarray(noisy.signals)])
    scan = replace(small_scan, signals=signals)
    changes = ["reconstruct.weight=l-curve", "scan.rules=frame", "grid.pixels=24", "grid.field_of_view_mm=9"]
    stored = run_frames(Pipeline.load("maxent", changes), scan, tmp_path / "out.zarr")
    weights = [stored.frame(i).pipeline["reconstruct"]["weight"] for i in range(2)]
    assert weights[0] != weights[1]
    for index, weight in enumerate(weights):
        frame = stored.frame(index)
        assert frame.weight_choice["weight"] == weight
        again = run(Pipeline.load("maxent", changes), scan, frame=index)
        assert again.pipeline["reconstruct"]["weight"] == weight
        assert (again["initial_pressure"].values == frame["initial_pressure"].values).all()


def test_versions_know_the_package_of_a_penalty(monkeypatch):
    """The version of a package is kept, too, where only the penalty within a solver comes from it."""
    pipeline = Pipeline.load("lsqr")
    entry = SimpleNamespace(cls=type(pipeline.reconstruct.regularizer), distribution="theirs", version="2.3")
    monkeypatch.setattr("oatkit.engine.provenance.installed", lambda: SimpleNamespace(entries=[entry]))
    assert versions(pipeline)["theirs"] == "2.3"
