"""The two forward models against closed forms, identities and each other."""

import os
import pickle
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import analytic
import oatkit
from oatkit.builtin.forward.arc import Arc
from oatkit.builtin.forward.immi import Immi
from oatkit.data import Detectors, Geometry, Grid
from oatkit.errors import ValidationError

MODELS = [Arc, Immi]
PLACES_M = [(0.0, 0.0), (3e-3, -5.2e-3)]
GRID = Grid((256, 256), 25e-3 / 256)
COARSE = Grid((64, 64), 25e-3 / 64)


def arc_of(n_detectors, degrees=270.0, start_degrees=-45.0, **changes):
    """Detectors on an arc of 40.5 mm, as in a small-animal scanner, at 40 MHz."""
    angles = np.deg2rad(start_degrees + degrees * np.arange(n_detectors) / n_detectors)
    detectors = Detectors(0.0405 * np.column_stack([np.sin(angles), np.cos(angles)]))
    # Time zero itself is left out: the closed forms have no value at a distance of zero.
    standard = Geometry(detectors, 40e6, 2030, start_time_s=1 / 40e6, speed_of_sound_m_s=1500)
    return replace(standard, **changes)


def array_geometry(shared_data, name):
    """A measured array of `data/geometry`."""
    with h5py.File(shared_data / "geometry" / f"{name}.mat") as file:
        points = file["transducerPos"][()].T
    return replace(arc_of(1), detectors=Detectors.from_xyz(points))


@pytest.fixture(params=["arc", "ringCup", "multisegmentCup"])
def array(request):
    """The arc of 256 and the two measured arrays."""
    if request.param == "arc":
        return arc_of(256)
    return array_geometry(request.getfixturevalue("shared_data"), request.param)


def every(geometry, step):
    """The geometry with every `step`-th detector."""
    return replace(geometry, detectors=Detectors(geometry.detectors.positions_m[::step]))


def signals(model, geometry, grid, image):
    """What `model` predicts, shape (detector, sample)."""
    return model.operator(geometry, grid).matvec(np.ravel(image)).reshape(geometry.shape)


def gaussian_errors(model, geometry, grid, width_m):
    """Relative pressure errors below 7 MHz for a Gaussian at each of the `PLACES_M`."""
    operator = model.operator(geometry, grid)
    errors = []
    for place in PLACES_M:
        found = operator.matvec(analytic.gaussian_image(grid, place, width_m).ravel()).reshape(geometry.shape)
        expected = analytic.gaussian_pressure(geometry, place, width_m)
        errors.append(
            analytic.relative_error(analytic.low_pass(geometry, found, 7e6), analytic.low_pass(geometry, expected, 7e6))
        )
    return errors


@pytest.mark.parametrize("width_m", [0.3e-3, 1e-3])
def test_arc_gives_the_pressure_of_a_gaussian(array, width_m):
    """At 256 x 256 over 25 mm, `arc` is within 3e-4 of the analytic pressure below 7 MHz on every array."""
    assert max(gaussian_errors(Arc(), array, GRID, width_m)) <= 3e-4


@pytest.mark.parametrize(("width_m", "bound"), [(0.3e-3, 2e-2), (1e-3, 2e-3)])
def test_immi_gives_the_pressure_of_a_gaussian(array, width_m, bound):
    """At 256 x 256 over 25 mm, `immi` is within 2e-2 at 0.3 mm and 2e-3 at 1 mm below 7 MHz on every array."""
    assert max(gaussian_errors(Immi(), every(array, 16), GRID, width_m)) <= bound


@pytest.mark.parametrize("n", [128, 200, 300])
def test_arc_is_accurate_on_other_grids(n):
    """At other numbers of pixels too, `arc` is within 1e-3 for a Gaussian of 1 mm below 7 MHz."""
    assert max(gaussian_errors(Arc(), arc_of(64), Grid((n, n), 25e-3 / n), 1e-3)) <= 1e-3


def test_immi_is_of_second_order():
    """Halving the pixels divides the error of `immi` for a Gaussian of 0.5 mm by 3.5 to 4.5."""
    geometry = arc_of(16)
    coarse, fine = (max(gaussian_errors(Immi(), geometry, Grid((n, n), 25e-3 / n), 0.5e-3)) for n in (128, 256))
    assert 3.5 <= coarse / fine <= 4.5


def test_hat_line_integral_is_that_of_a_bilinear_pixel():
    """The closed form equals quadrature of the bilinear pixel along its axes, oblique, and within 2e-4 in between."""
    from oatkit.builtin.forward.immi_operator import hat_line_integral

    h = 0.7
    along = np.linspace(-2, 2, 400_001)
    for angle in (0.0, 5e-4, 0.1, 0.6, np.pi / 4, 1.2, np.pi / 2):
        normal = np.array([np.cos(angle), np.sin(angle)])
        for u in (0.0, 0.13, -0.41, 0.8):
            y, x = u * normal[0] - along * normal[1], u * normal[1] + along * normal[0]
            pixel = np.maximum(1 - abs(y) / h, 0) * np.maximum(1 - abs(x) / h, 0)
            a, b = (np.array([v]) for v in h * abs(normal))
            found = hat_line_integral(np.array([u]), a, b, h)[0]
            nearly_along_an_axis = 0 < angle < 1e-3
            bound = 2e-4 if nearly_along_an_axis else 1e-10
            assert found == pytest.approx(np.trapezoid(pixel, along), abs=bound, rel=0)


@pytest.mark.parametrize(("model", "bound"), [(Arc, 2e-2), (Immi, 4.5e-2)])
def test_a_disc_after_a_low_pass(model, bound):
    """Below 3 MHz both models give the pressure of a disc of 4 mm, as well as pixels can hold its edge."""
    geometry, centre, radius = arc_of(32), (1.3e-3, -2.1e-3), 4e-3
    image = analytic.disc_image(GRID, centre, radius, 16)
    found = analytic.low_pass(geometry, signals(model(), geometry, GRID, image), 3e6)
    integral = analytic.low_pass(geometry, analytic.disc_arc(geometry, centre, radius), 3e6)
    wavenumbers = 2 * np.pi * np.fft.rfftfreq(geometry.n_samples, 1 / 40e6) / geometry.speed_of_sound_m_s
    expected = np.fft.irfft(1j * wavenumbers * np.fft.rfft(integral), geometry.n_samples)
    assert analytic.relative_error(found, expected) <= bound


def dot_error(operator, seed=0):
    """|<Ax, y> - <x, A*y>| / (|Ax| |y|) for seeded vectors of both signs."""
    rng = np.random.default_rng(seed)
    x, y = rng.standard_normal(operator.shape[1]), rng.standard_normal(operator.shape[0])
    forward = operator.matvec(x).astype(float)
    back = operator.rmatvec(y).astype(float)
    return abs(forward @ y - x @ back) / (np.linalg.norm(forward) * np.linalg.norm(y))


SETTINGS = {
    "plain": (arc_of(24), COARSE),
    "one detector, one row": (arc_of(1), Grid((1, 37), 2e-4)),
    "one pixel": (arc_of(5), Grid((1, 1), 2e-4)),
    "oblong and off centre": (arc_of(24), Grid((31, 58), 3e-4, (4e-3, -6e-3))),
    "record ends inside the grid": (arc_of(24, n_samples=1000), COARSE),
    "record begins inside the grid": (arc_of(24, start_time_s=1050 / 40e6, n_samples=700), COARSE),
    "short response": (arc_of(24, impulse_response=np.array([0.2, -1.0, 3.0, 0.5])), COARSE),
    "response as long as the record": (
        arc_of(24, impulse_response=np.random.default_rng(3).standard_normal(2030)),
        COARSE,
    ),
    "pixels far wider than a sample": (arc_of(24), Grid((9, 8), 2.5e-3)),
    "pixels finer than a sample": (arc_of(8), Grid((60, 70), 3e-5)),
}


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("precision", "bound"), [("double", 1e-12), ("single", 1e-6)])
def test_adjoint_is_exact(model, precision, bound, setting):
    """<Ax, y> equals <x, A*y> to rounding in each precision, wherever grid, record and response lie."""
    geometry, grid = SETTINGS[setting]
    operator = model(precision=precision).operator(geometry, grid)
    assert np.linalg.norm(operator.matvec(np.ones(operator.shape[1]))) > 0
    assert dot_error(operator) <= bound


@pytest.mark.parametrize("model", MODELS)
def test_single_precision_is_double_rounded(model):
    """Single and double precision agree to 2e-5 of the largest signal."""
    geometry, image = arc_of(24), np.random.default_rng(1).standard_normal(COARSE.shape)
    single, double = (signals(model(precision=p), geometry, COARSE, image) for p in ("single", "double"))
    assert single.dtype == np.float32
    assert double.dtype == np.float64
    assert abs(single - double).max() <= 2e-5 * abs(double).max()


@pytest.mark.parametrize("model", MODELS)
def test_linear(model):
    """A(2x - 3y) = 2Ax - 3Ay to rounding in double precision."""
    operator = model(precision="double").operator(arc_of(16), COARSE)
    x, y = np.random.default_rng(2).standard_normal((2, operator.shape[1]))
    found, expected = operator.matvec(2 * x - 3 * y), 2 * operator.matvec(x) - 3 * operator.matvec(y)
    assert analytic.relative_error(found, expected) <= 1e-13


@pytest.mark.parametrize("model", MODELS)
def test_time_zero_only_moves_the_record(model):
    """A record that begins 123 samples later is the same record without its first 123 samples."""
    geometry, image = arc_of(16), np.random.default_rng(3).standard_normal(COARSE.shape)
    later = replace(geometry, start_time_s=124 / 40e6)
    whole, moved = (signals(model(precision="double"), g, COARSE, image) for g in (geometry, later))
    assert analytic.relative_error(moved[:, :-123], whole[:, 123:]) <= 1e-12


def test_a_fraction_of_a_sample_counts():
    """With time zero 0.37 samples later the signals of `arc` still are those of the Gaussian, within 3e-4."""
    geometry = arc_of(32, start_time_s=1.37 / 40e6)
    assert max(gaussian_errors(Arc(), geometry, GRID, 0.3e-3)) <= 3e-4


@pytest.mark.parametrize("model", MODELS)
def test_turning_the_image_rolls_the_channels(model):
    """On a full ring of 64, an image turned by 90 degrees gives the signals of 16 channels further."""
    ring = arc_of(64, degrees=360.0, start_degrees=0.0)
    image = np.random.default_rng(4).standard_normal(COARSE.shape)
    # Row 0 is at the bottom and detectors run counter-clockwise, so this turns counter-clockwise as well.
    turned = np.rot90(image, -1)
    before, after = (signals(model(precision="double"), ring, COARSE, i) for i in (image, turned))
    assert analytic.relative_error(after, np.roll(before, 16, axis=0)) <= 1e-11


@pytest.mark.parametrize("n_response", [1, 2, 40, 201, 2030])
@pytest.mark.parametrize("model", MODELS)
def test_the_impulse_response_is_convolved(model, n_response):
    """Signals with a response are those without, convolved with it, time zero at index n // 2, without wrap-around."""
    response = np.random.default_rng(5).standard_normal(n_response)
    geometry, image = arc_of(12), analytic.gaussian_image(COARSE, (1e-3, 4e-3), 1.2e-3)
    plain = signals(model(precision="double"), geometry, COARSE, image)
    found = signals(model(precision="double"), replace(geometry, impulse_response=response), COARSE, image)
    middle = slice(n_response // 2, n_response // 2 + geometry.n_samples)
    expected = np.array([np.convolve(row, response)[middle] for row in plain])
    assert analytic.relative_error(found, expected) <= 2e-8


@pytest.mark.parametrize("model", MODELS)
def test_a_response_brings_in_what_lies_outside_the_record(model):
    """With a response, a record that begins inside the grid is the last part of a record that begins before it."""
    response = np.random.default_rng(6).standard_normal(300)
    geometry = arc_of(12, impulse_response=response)
    later = replace(geometry, start_time_s=1001 / 40e6, n_samples=1030)
    image = np.random.default_rng(7).standard_normal(COARSE.shape)
    whole, part = (signals(model(precision="double"), g, COARSE, image) for g in (geometry, later))
    assert analytic.relative_error(part, whole[:, 1000:]) <= 1e-11


@pytest.mark.parametrize("model", MODELS)
def test_detectors_in_any_order(model):
    """Shuffled detectors give shuffled channels."""
    geometry, image = arc_of(24), np.random.default_rng(8).standard_normal(COARSE.shape)
    order = np.random.default_rng(9).permutation(24)
    shuffled = replace(geometry, detectors=Detectors(geometry.detectors.positions_m[order]))
    straight, mixed = (signals(model(precision="double"), g, COARSE, image) for g in (geometry, shuffled))
    assert analytic.relative_error(mixed, straight[order]) <= 1e-12


@pytest.mark.parametrize("model", MODELS)
def test_a_grid_is_a_part_of_a_larger_one(model):
    """An oblong grid off centre gives the signals of the larger grid of which it is a part, zero elsewhere."""
    h, geometry = 2e-4, arc_of(24)
    part = Grid((41, 60), h, (20.5 * h - 5e-3, 30 * h - 8e-3))
    whole = Grid((60, 90), h, (30 * h - 5e-3, 45 * h - 8e-3))
    image = analytic.gaussian_image(part, (-1e-3, -1.4e-3), 0.7e-3)
    padded = np.zeros(whole.shape)
    padded[:41, :60] = image
    found, expected = (signals(model(precision="double"), geometry, g, i) for g, i in ((part, image), (whole, padded)))
    assert analytic.relative_error(found, expected) <= 5e-8


@pytest.mark.parametrize("model", MODELS)
def test_what_the_grid_cannot_reach_is_zero(model):
    """Before the first and after the last arrival, 17 pixels and 9 samples apart, the record is exactly zero."""
    geometry, image = arc_of(24), np.ones(COARSE.shape)
    record = signals(model(), geometry, COARSE, image)
    y, x = geometry.detectors.positions_m.T
    distance = np.hypot(COARSE.y_m[:, None] - y[:, None, None], COARSE.x_m - x[:, None, None]).reshape(24, -1)
    margin = 17 * COARSE.pixel_size_m + 9 * 1500 / 40e6
    radius = geometry.speed_of_sound_m_s * geometry.times_s
    near, far = distance.min(axis=1)[:, None], distance.max(axis=1)[:, None]
    # All windows are as long as the longest.
    reach = (radius >= near - margin) & (radius <= near + (far - near).max() + margin)
    assert not record[~reach].any()
    assert (record != 0).mean() <= 0.65


def test_the_models_agree():
    """On smooth random images below 7 MHz, `arc` and `immi` differ by less than 1.5 %."""
    from scipy.ndimage import gaussian_filter

    geometry = arc_of(32)
    image = gaussian_filter(np.random.default_rng(10).standard_normal(GRID.shape), 4.0)
    image *= np.outer(np.hanning(256), np.hanning(256))
    arc, immi = (analytic.low_pass(geometry, signals(m(), geometry, GRID, image), 7e6) for m in MODELS)
    assert analytic.relative_error(immi, arc) <= 1.5e-2


@pytest.mark.parametrize("model", MODELS)
def test_equal_to_the_last_bit_for_any_number_of_threads(model, monkeypatch):
    """One, two and five threads give the same bits, forward and backward."""
    geometry = arc_of(37, impulse_response=np.array([1.0, -2.0, 0.5]))
    found = []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv("OATKIT_THREADS", threads)
        operator = model().operator(geometry, COARSE)
        x, y = (np.random.default_rng(12).standard_normal(n) for n in operator.shape[::-1])
        found.append((operator.matvec(x).tobytes(), operator.rmatvec(y).tobytes()))
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("model", MODELS)
def test_any_real_dtype_is_taken(model):
    """Images and records of whole numbers, float32 and float64 give one result."""
    operator = model().operator(arc_of(8), COARSE)
    image = np.random.default_rng(13).integers(-50, 50, operator.shape[1])
    record = np.random.default_rng(14).integers(-50, 50, operator.shape[0])
    for apply, vector in ((operator.matvec, image), (operator.rmatvec, record)):
        results = [apply(vector.astype(dtype)) for dtype in (np.int16, np.float32, np.float64)]
        assert all(np.array_equal(results[0], other) for other in results)


@pytest.mark.parametrize("model", MODELS)
def test_operators_leave_their_input_alone_and_pickle(model):
    """A read-only image is accepted, and a pickled operator gives the same bits."""
    operator = model().operator(arc_of(8), COARSE)
    image = np.random.default_rng(15).standard_normal(operator.shape[1]).astype(np.float32)
    image.setflags(write=False)
    copy = pickle.loads(pickle.dumps(operator))
    assert np.array_equal(copy.matvec(image), operator.matvec(image))


@pytest.mark.parametrize("model", MODELS)
def test_a_grid_that_cannot_be_seen_is_refused(model):
    """A field of view with detectors inside it is a `ValidationError` that gives its size."""
    with pytest.raises(ValidationError, match="lie inside the field of view of 100 x 100 mm"):
        model().operator(arc_of(8), Grid((100, 100), 1e-3))


def test_arc_works_where_no_machine_code_can_be_kept(tmp_path):
    """With neither the package's folder nor the user's fit for a cache, `arc` compiles in memory to the same bits."""
    package = tmp_path / "oatkit"
    shutil.copytree(Path(oatkit.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    # A file where a folder should be keeps out even the superuser.
    (package / "builtin" / "forward" / "__pycache__").write_text("")
    nowhere = os.fspath(package / "errors.py" / "nowhere")
    left_out = {"NUMBA_CACHE_DIR", "LOCALAPPDATA"}
    environment = {k: v for k, v in os.environ.items() if k not in left_out}
    environment |= {"HOME": nowhere, "XDG_CACHE_HOME": nowhere, "PYTHONPATH": os.fspath(tmp_path)}
    code = (
        "import numpy as np, oatkit\n"
        "from oatkit.builtin.forward import arc, arc_kernels\n"
        "angles = np.arange(5.0)\n"
        "detectors = oatkit.Detectors(0.04 * np.column_stack([np.sin(angles), np.cos(angles)]))\n"
        "grid = oatkit.Grid((9, 8), 1e-3)\n"
        "operator = arc.Arc().operator(oatkit.Geometry(detectors, 40e6, 1500), grid)\n"
        "print(arc_kernels.scatter._cache.cache_path, operator.matvec(np.arange(72.0)).tobytes().hex())\n"
    )
    run = [sys.executable, "-c", code]
    found = subprocess.run(run, env=environment, capture_output=True, text=True, check=True, cwd=tmp_path)
    here = subprocess.run(run, capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["None", here.stdout.split()[-1]]


def test_distances_that_single_precision_cannot_resolve_are_refused():
    """At 10 GHz single precision is a `ValidationError` that names the way out, and double precision works."""
    geometry, grid = arc_of(2, sampling_rate_hz=1e10, n_samples=300_000), Grid((2, 2), 1e-5)
    with pytest.raises(ValidationError, match='precision = "double"'):
        Arc().operator(geometry, grid)
    assert dot_error(Arc(precision="double").operator(geometry, grid)) <= 1e-12
