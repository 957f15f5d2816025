"""Change over time: means, errors, slopes and areas are what their formulas say, whatever the order and the gaps."""

import csv
import io
import json

import numpy as np
import pytest

import oatkit
from oatkit import Grid, Image, Result, ValidationError
from oatkit.kinetics import contrast_kinetics, curve_text, curves_csv, gas_challenge, region_curves
from oatkit.kinetics.statistics import Moments, Response
from oatkit.regions import EllipseRegion, MaskRegion, RectangleRegion
from oatkit.store.manifest import FrameEntry
from packages import run_oatkit
from results import make_result, write_frames

GRID = Grid((5, 6), 1e-3)
NAN = float("nan")


def frame(values: np.ndarray, index: int, time_s: float | None, name: str = "so2", nm: tuple = ()) -> Result:
    """A result of one image."""
    image = Image(np.asarray(values, float), name, "", GRID, nm, ({"step": "unmix"},))
    return Result({name: image}, scan={"name": "made"}, frame_index=index, time_s=time_s)


def series(path, values, times_s=None, **fields) -> Result:
    """A stored result with a frame for each array, or for each reason of a failure."""
    times = [float(i) for i in range(len(values))] if times_s is None else times_s
    pairs = zip(values, times, strict=True)
    frames = [v if isinstance(v, str) else frame(v, i, t, **fields) for i, (v, t) in enumerate(pairs)]
    return oatkit.load(write_frames(path / "frames.zarr", *frames))


def noise(count: int, seed: int = 0) -> np.ndarray:
    """Frames of noise in which a tenth of the pixels is undefined."""
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((count, *GRID.shape))
    return np.where(rng.random(values.shape) < 0.1, NAN, values)


def test_moments_are_those_of_numpy():
    """Mean and variance of the mean, taken one array at a time, are numpy's of all of them, NaN left out."""
    values = noise(9) + 1e6  # the naive sum of squares would lose six of its digits
    moments = Moments(GRID.shape)
    for one in values:
        moments.add(one)
    count = np.isfinite(values).sum(axis=0)
    assert np.array_equal(moments.count, count)
    assert np.allclose(moments.mean, np.nanmean(values, axis=0), rtol=1e-14)
    assert np.allclose(moments.variance_of_mean, np.nanvar(values, axis=0, ddof=1) / count, rtol=1e-8)


def test_a_constant_series_does_not_change(tmp_path):
    """Of frames that are all alike, the change and its standard error are exactly zero."""
    result = series(tmp_path, [np.full(GRID.shape, 0.7)] * 6)
    made = gas_challenge(result, range(3), range(3, 6))
    assert (made["so2_change"].values == 0).all()
    assert (made["so2_change_se"].values == 0).all()
    assert (made["so2_baseline"].values == 0.7).all()


def test_a_challenge_is_the_difference_of_means_with_its_error(tmp_path):
    """Change and standard error are Welch's, of the frames in which a pixel is defined, and these are counted."""
    values = noise(8)
    made = gas_challenge(series(tmp_path, values), range(4), range(5, 8))
    before, after = values[:4], values[5:]
    n, m = np.isfinite(before).sum(axis=0), np.isfinite(after).sum(axis=0)
    assert (n > 1).all()
    assert (m > 1).all()
    error = np.sqrt(np.nanvar(before, axis=0, ddof=1) / n + np.nanvar(after, axis=0, ddof=1) / m)
    assert np.allclose(made["so2_change"].values[0], np.nanmean(after, axis=0) - np.nanmean(before, axis=0))
    assert np.allclose(made["so2_change_se"].values[0], error)
    assert np.array_equal(made["so2_baseline_frames"].values[0], n)
    assert np.array_equal(made["so2_challenge_frames"].values[0], m)


def test_a_pixel_needs_values_on_both_sides(tmp_path):
    """A pixel never defined in a state has no change; one defined once there has a change and no error."""
    values = np.ones((4, *GRID.shape))
    values[:2, 0, 0] = NAN
    values[2, 1, 1] = NAN
    made = gas_challenge(series(tmp_path, values), range(2), range(2, 4))
    change, error = made["so2_change"].values[0], made["so2_change_se"].values[0]
    assert np.isnan(change[0, 0])
    assert np.isnan(error[0, 0])
    assert change[1, 1] == 0
    assert np.isnan(error[1, 1])
    assert np.isfinite(change).sum() == change.size - 1


def test_a_failed_frame_does_not_count(tmp_path):
    """A frame that failed is passed over, and the notes say so."""
    values = [*np.ones((2, *GRID.shape)), "no luck", 2 * np.ones(GRID.shape)]
    made = gas_challenge(series(tmp_path, values), range(2), range(2, 4))
    assert (made["so2_change"].values == 1).all()
    assert made.warnings == ("baseline: 2 frames", "challenge: 1 frame; failed, and not counted: frame 2")


WRONG = {
    "both": (([0, 1], [1, 2]), "in the baseline, too: frame 1; choose"),
    "empty": (([], [1, 2]), "baseline: no frame is chosen"),
    "beyond": (([0], [9]), "challenge: no frame 9; the result has frames 0 .. 3"),
    "failed": (([0], [3]), "challenge: all of its frames failed: frame 3"),
    "unknown": (([0], [1], "s02"), "no image 's02'; did you mean 'so2'"),
}


@pytest.mark.parametrize("what", WRONG)
def test_states_that_cannot_be_compared_are_refused(tmp_path, what):
    """States that overlap, are empty, do not exist or failed, and unknown images, are each a sentence."""
    arguments, sentence = WRONG[what]
    result = series(tmp_path, [*np.ones((3, *GRID.shape)), "no luck"])
    with pytest.raises(ValidationError, match=sentence):
        gas_challenge(result, *arguments)


def test_linear_growth_has_its_slope_and_its_area(tmp_path):
    """Of g t from the end of the baseline on, at uneven times, wash-in is g, the area g T^2 / 2, the peak g T at T."""
    times = [0.0, 1.5, 2.0, 3.7, 4.0, 7.25]
    slopes = np.linspace(0.5, 3, 30).reshape(GRID.shape)
    values = [5 + slopes * max(t - 1.5, 0) for t in times]
    made = contrast_kinetics(series(tmp_path, values, times), "so2", range(2))
    last = 7.25 - 1.5
    assert np.allclose(made["so2_wash_in"].values[0], slopes, rtol=1e-12)
    assert np.allclose(made["so2_auc"].values[0], slopes * last**2 / 2, rtol=1e-12)
    assert np.allclose(made["so2_peak"].values[0], slopes * last, rtol=1e-12)
    assert (made["so2_time_to_peak"].values == last).all()
    assert (made["so2_baseline"].values == 5).all()
    assert [made[f"so2_{k}"].unit for k in ("peak", "time_to_peak", "auc", "wash_in")] == ["", "s", "s", "1/s"]


def test_the_wash_in_ends_at_the_peak(tmp_path):
    """What comes after the peak bends the area but not the slope, which is that of numpy's line through the rise."""
    curve = np.array([0.0, 0.0, 1.0, 2.5, 3.0, 1.0, 0.5])
    made = contrast_kinetics(series(tmp_path, [np.full(GRID.shape, c) for c in curve]), "so2", range(2))
    line = np.polyfit([0, 1, 2, 3], [0, 1.0, 2.5, 3.0], 1)[0]
    assert np.allclose(made["so2_wash_in"].values, line)
    assert np.allclose(made["so2_auc"].values, np.trapezoid(curve[1:], dx=1.0))
    assert (made["so2_time_to_peak"].values == 3).all()


def test_gaps_are_bridged_and_what_is_never_defined_stays_so():
    """A value that is missing on a straight line changes neither slope nor area; without any value, all is NaN."""
    response = Response((3,))
    for time in (1.0, 2.0, 4.0):
        response.add(time, np.array([2 * time, NAN if time == 2.0 else 2 * time, NAN]))
    found = response.images()
    for name, expected in {"peak": 8.0, "time_to_peak": 4.0, "auc": 16.0, "wash_in": 2.0}.items():
        assert np.allclose(found[name], [expected, expected, NAN], equal_nan=True)


def test_the_order_of_frames_does_not_matter(tmp_path):
    """Frames stored in another order, each with its own time, give the same images to the last bit."""
    values, times = noise(8), np.cumsum([0.0, 1.2, 1, 0.7, 2, 1, 1, 0.4])
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    order = np.random.default_rng(1).permutation(8)
    first = contrast_kinetics(series(tmp_path / "a", values, list(times)), "so2", range(3))
    shuffled = series(tmp_path / "b", values[order], list(times[order]))
    second = contrast_kinetics(shuffled, "so2", [int(np.flatnonzero(order == i)[0]) for i in range(3)])
    assert list(first) == list(second)
    for name in first:
        assert np.array_equal(first[name].values, second[name].values, equal_nan=True)


def test_without_times_frames_are_counted(tmp_path):
    """A result that does not know when its frames were taken counts them as the scan does, and says so."""
    frames = [frame(np.full(GRID.shape, 2.0 * i), i, None) for i in (0, 1, 4, 6)]  # frames 2, 3 and 5 were left out
    result = oatkit.load(write_frames(tmp_path / "frames.zarr", *frames))
    made = contrast_kinetics(result, "so2", [0])
    assert np.allclose(made["so2_wash_in"].values, 2)
    assert made["so2_time_to_peak"].unit == "frames"
    assert made["so2_wash_in"].unit == "1/frame"
    assert "the unit of time is one frame" in made.warnings[1]


def test_a_baseline_needs_something_after_it(tmp_path):
    """Where no frame is later than the baseline there is no kinetics; earlier ones are noted."""
    result = series(tmp_path, np.ones((3, *GRID.shape)))
    with pytest.raises(ValidationError, match=r"frame 2 \(by the times of the scan; the result has 3 frames\)"):
        contrast_kinetics(result, "so2", [2])
    assert "no later than the baseline, and not counted: frame 0" in contrast_kinetics(result, "so2", [1]).warnings[1]


REGIONS = (
    EllipseRegion("all", (0.0, 0.0), (0.1, 0.1)),
    MaskRegion("corner", np.arange(30).reshape(GRID.shape) < 1, GRID),
)


def test_the_curve_of_a_region_is_the_mean_over_its_defined_pixels(tmp_path):
    """Curves hold numpy's nanmean, the number of pixels behind it, and the kinetics of a one-pixel region's image."""
    values = noise(6).reshape(6, 1, *GRID.shape) * np.array([1.0, 2.0]).reshape(1, 2, 1, 1)
    result = series(tmp_path, values, nm=(700.0, 800.0))
    curves = region_curves(result, "so2", range(2), REGIONS)
    assert [(c.region, c.wavelength_nm) for c in curves] == [
        (r, w) for r in ("all", "corner") for w in (700.0, 800.0)
    ]  # fmt: skip
    assert np.allclose(curves[1].mean, np.nanmean(values[:, 1], axis=(1, 2)))
    assert np.array_equal(curves[1].pixels, np.isfinite(values[:, 1]).sum(axis=(1, 2)))
    assert np.allclose(curves[1].change, curves[1].mean - curves[1].mean[:2].mean())
    assert np.array_equal(curves[1].times, np.arange(6.0) - 1)
    maps = contrast_kinetics(result, "so2", range(2))
    for name, value in curves[3].kinetics.items():
        assert value == maps[f"so2_{name}"].values[1, 0, 0]


def test_curves_are_written_as_a_table(tmp_path):
    """The CSV file has a row for each region, wavelength and frame, with names quoted as CSV wants them."""
    result = series(tmp_path, noise(4))
    curves = region_curves(result, "so2", [0], [EllipseRegion('a, "b"', (0.0, 0.0), (0.1, 0.1))])
    rows = list(csv.DictReader(io.StringIO(curves_csv(curves))))
    assert list(rows[0]) == ["region", "wavelength_nm", "frame", "time_s", "mean", "change", "pixels"]
    assert [row["region"] for row in rows] == ['a, "b"'] * 4
    assert np.allclose([float(row["change"]) for row in rows], curves[0].change, rtol=1e-8)


def test_no_name_in_curves_becomes_a_formula_or_steers_the_terminal(tmp_path):
    """What a spreadsheet would run gets an apostrophe in the CSV; controls become question marks on the screen, too."""
    everywhere = [EllipseRegion(name, (0.0, 0.0), (0.1, 0.1)) for name in ("=1+1", "\t@SUM(A1)", "red\x1b[31m")]
    curves = region_curves(series(tmp_path, noise(3)), "so2", [0], everywhere)
    rows = list(csv.DictReader(io.StringIO(curves_csv(curves))))
    assert list(dict.fromkeys(row["region"] for row in rows)) == ["'=1+1", "'@SUM(A1)", "red?[31m"]
    assert all(curve_text(curve).isprintable() for curve in curves)


def test_a_region_without_a_pixel_is_refused(tmp_path):
    """A region beside the image is a sentence, not a curve of NaN."""
    result = series(tmp_path, noise(3))
    with pytest.raises(ValidationError, match="region 'far': no pixel"):
        region_curves(result, "so2", [0], [RectangleRegion("far", (0.5, 0.5), (1e-3, 1e-3))])


def test_what_is_made_can_be_stored(tmp_path):
    """Maps of real results, NaN and several wavelengths included, are saved, verified and read back unchanged."""
    frames = [make_result(seed, time_s=float(seed)) for seed in range(4)]
    result = oatkit.load(write_frames(tmp_path / "frames.zarr", *frames))
    for name in ("absorption", "initial_pressure"):
        for made in (gas_challenge(result, [0, 1], [2, 3], name), contrast_kinetics(result, name, [0])):
            made.save(tmp_path / "maps.zarr", overwrite=True)
            assert oatkit.verify(tmp_path / "maps.zarr") == []
            read = oatkit.load(tmp_path / "maps.zarr")
            assert all(np.array_equal(read[key].values, image.values, equal_nan=True) for key, image in made.items())
            assert read[f"{name}_baseline"].history[-1]["image"] == name


def test_a_manifest_without_times_is_read():
    """What was stored before frames knew their times is read, with no time."""
    table = json.loads(FrameEntry.of(make_result(time_s=3.5), {}).model_dump_json())
    assert table.pop("time_s") == 3.5
    assert FrameEntry.model_validate_json(json.dumps(table)).time_s is None


def test_the_commands_write_what_the_functions_return(tmp_path):
    """`challenge` and `kinetics` write what the functions return, curves included, and refuse a wrong slice with 2."""
    values = noise(8)
    result = series(tmp_path, values)
    done = run_oatkit(
        "challenge", "frames.zarr", "--baseline", ":3", "--challenge", "4:", "-o", "change.zarr", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    expected = gas_challenge(result, range(3), range(4, 8))["so2_change"].values
    assert np.array_equal(oatkit.load(tmp_path / "change.zarr")["so2_change"].values, expected, equal_nan=True)
    np.save(tmp_path / "mask.npy", np.ones(GRID.shape, np.uint8))
    common = ("kinetics", "frames.zarr", "--image", "so2")
    arguments = (*common, "--baseline", "0:3", "-o", "maps.zarr", "-r", "mask.npy", "--curves", "curves.csv")
    done = run_oatkit(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "peak" in done.stdout
    assert len((tmp_path / "curves.csv").read_text().splitlines()) == 1 + 8
    assert "so2_auc" in oatkit.load(tmp_path / "maps.zarr")
    done = run_oatkit(*common, "--baseline", "9:", "-o", "other.zarr", cwd=tmp_path)
    assert done.returncode == 2
    assert "--baseline 9:: expected A:B or one number within the result's frames 0 .. 7" in done.stderr
