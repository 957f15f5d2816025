"""The solvers `l1` and `tv` and their penalties against independent solutions, optimality conditions and identities."""

import sys

import numpy as np
import pylops
import pyproximal
import pytest
import pywt
from pyproximal.optimization.primaldual import PrimalDual

from oatkit import Pipeline, plugin
from oatkit.api import Problem
from oatkit.builtin.regularizers.analysis import Analysis, Ascent, Pixels, magnitudes
from oatkit.builtin.regularizers.dual_prox import proximal
from oatkit.builtin.regularizers.gradient import Gradient
from oatkit.builtin.regularizers.l1 import L1
from oatkit.builtin.regularizers.tv import TotalVariation
from oatkit.builtin.regularizers.wavelets import Wavelets
from oatkit.builtin.solvers.l1 import L1Solver
from oatkit.builtin.solvers.sparse_objective import SparseObjective
from oatkit.builtin.solvers.sparse_start import start
from oatkit.builtin.solvers.tv import TvSolver
from oatkit.errors import ValidationError
from oatkit.weights import CANDIDATES, resolve
from small_problems import Counting, blurred, circles, dense, minimised, noise_like, scaled, three_pixels, too_few_data

pytestmark = pytest.mark.filterwarnings("ignore:Level value of:UserWarning")  # the other library's, of small images

RNG = np.random.default_rng(0)
WAVELET = L1(basis="wavelet", wavelet="db2", levels=2)
FINE = {"weight": 1e-2, "tolerance": 1e-9, "n_iterations": 40_000}
SOLVERS = {
    "pixel": lambda **fields: L1Solver(**fields),
    "wavelet": lambda **fields: L1Solver(regularizer=WAVELET, **fields),
    "tv": lambda **fields: TvSolver(**fields),
}
SIGNS = pytest.mark.parametrize("non_negative", [True, False], ids=["non-negative", "signed"])
KINDS = pytest.mark.parametrize("kind", SOLVERS)
PENALTIES = pytest.mark.parametrize("penalty", [L1(), WAVELET, TotalVariation()], ids=["pixel", "wavelet", "tv"])


def columns(function, shape):
    """The matrix of a linear map of images, its results raveled."""
    return np.array([np.ravel(function(e.reshape(shape))) for e in np.eye(shape[0] * shape[1])]).T


def differences(image):
    """Forward differences along y and x, 0 across the last row and column."""
    return np.array([np.diff(image, axis=0, append=image[-1:]), np.diff(image, axis=1, append=image[:, -1:])])


def wavelet_coefficients(image):
    """Coefficients of PyWavelets' own multilevel transform."""
    levels = 2 if all(n % 4 == 0 for n in image.shape) else 1
    return pywt.coeffs_to_array(pywt.wavedec2(image, "db2", mode="periodization", level=levels))[0]


def seen(kind, shape):
    """The matrix K of a penalty, independent of the package; two parts one after the other for TV."""
    return columns({"pixel": np.copy, "wavelet": wavelet_coefficients, "tv": differences}[kind], shape)


def penalty_of(kind, coefficients):
    """Sum of magnitudes of raveled coefficients."""
    return np.hypot(*coefficients.reshape(2, -1)).sum() if kind == "tv" else abs(coefficients).sum()


def independent(problem, kind, w, non_negative):
    """The least value of |A x - b|^2 + w |K x|_1 that another library finds."""
    if kind == "pixel":
        return by_scipy(problem, w, non_negative)
    return min(by_pyproximal(problem, kind, w, non_negative, balance) for balance in (0.1, 1.0))


def by_scipy(problem, w, non_negative):
    """The least value for pixels, by L-BFGS-B over the positive and the negative part of the image."""
    matrix = dense(problem) if non_negative else np.hstack([dense(problem), -dense(problem)])

    def value_and_gradient(parts):
        misfit = matrix @ parts - problem.data
        return misfit @ misfit + w * parts.sum(), 2 * matrix.T @ misfit + w

    return minimised(value_and_gradient, np.full(matrix.shape[1], 0.1), 0.0)[1]


def by_pyproximal(problem, kind, w, non_negative, balance):
    """The value after 20 000 steps of pyproximal's primal-dual method at a balance of its two step lengths."""
    matrix, k = dense(problem), seen(kind, problem.shape)
    q, r = np.linalg.qr(matrix)
    penalty = pyproximal.L21(2, sigma=w) if kind == "tv" else pyproximal.L1(sigma=w)
    data = pyproximal.L2(sigma=2.0, b=q.T @ problem.data)
    both = pyproximal.VStack([data, penalty], nn=[len(r), len(k)])
    stack = np.vstack([r, k])
    lowest = 0.0 if non_negative else -np.inf
    step = 1 / np.linalg.norm(stack, 2)
    lengths = {"tau": balance * step, "mu": step / balance}
    box, origin = pyproximal.Box(lowest, np.inf), np.zeros(stack.shape[1])
    x = PrimalDual(box, both, pylops.MatrixMult(stack), origin, niter=20_000, **lengths)
    return np.sum((matrix @ x - problem.data) ** 2) + w * penalty_of(kind, k @ x)


def small_circles():
    """Circles about fewer pixels: the pixel penalty takes many steps to nine digits."""
    return circles(n=14, samples=40)


def weight_of(problem, tau=1e-2):
    """The w of the formula."""
    return tau * problem.norm**2 * problem.reference.level


@SIGNS
@KINDS
@pytest.mark.parametrize("make", [too_few_data, blurred, small_circles])
def test_objective_is_that_of_an_independent_library(make, kind, non_negative):
    """Run to 1e-9, P equals to 1e-6 what another library finds, and what the image itself gives by dense matrices."""
    problem = make(shape=(8, 8)) if make is blurred else make()
    last = SOLVERS[kind](non_negative=non_negative, **FINE).solve(problem)
    w = weight_of(problem)
    coefficients = seen(kind, problem.shape) @ last.image.ravel()
    misfit = dense(problem) @ last.image.ravel() - problem.data
    assert last.converged
    assert not non_negative or last.image.min() >= 0
    assert last.penalty == pytest.approx(penalty_of(kind, coefficients), rel=1e-12)
    assert last.objective == pytest.approx(misfit @ misfit + w * last.penalty, rel=1e-12)
    assert last.objective == pytest.approx(independent(problem, kind, w, non_negative), rel=1e-6)


@SIGNS
@KINDS
def test_gap_bounds_the_distance_to_the_optimum(kind, non_negative):
    """At every step P is at most the gap times itself above the optimum; at the end the gap has become small."""
    problem = small_circles()
    states = [s for s in SOLVERS[kind](non_negative=non_negative, **FINE).iterate(problem) if s.objective > 0]
    optimum = states[-1].objective * (1 - states[-1].relative_gap)
    assert states[-1].relative_gap <= 1e-6
    for state in states[1:]:
        above = (state.objective - states[-1].objective) / state.objective
        assert above <= state.relative_gap
        assert state.objective * (1 - state.relative_gap) <= states[-1].objective
    assert optimum > 0


def test_bound_holds_for_any_image_and_any_guess():
    """From random images and dual variables no bound lies above P of the best image known."""
    problem = small_circles()
    for kind, analysis in {"pixel": Pixels(), "wavelet": WAVELET.analysis(), "tv": Gradient()}.items():
        for non_negative in (True, False):
            least = SOLVERS[kind](non_negative=non_negative, **FINE).solve(problem).objective
            objective = SparseObjective.of(problem, weight_of(problem), analysis, non_negative)
            bounds = []
            for size in (0.1, 1.0, 10.0):
                point = objective.at(abs(size * RNG.standard_normal(problem.shape)))
                guess = analysis.analyse(weight_of(problem) * size * RNG.standard_normal(problem.shape))
                bounds.append(point.bound(guess))
            assert max(bounds) <= least


@SIGNS
def test_pixels_meet_the_conditions_of_an_optimum(non_negative):
    """The gradient of the misfit is -w sign(x) where x is not zero; where it is, its size (its fall) is at most w."""
    problem = noise_like()
    last = L1Solver(non_negative=non_negative, **FINE).solve(problem)
    w, x = weight_of(problem), last.image.ravel()
    gradient = 2 * dense(problem).T @ (dense(problem) @ x - problem.data)
    np.testing.assert_allclose(gradient[x != 0], -w * np.sign(x[x != 0]), atol=1e-5 * w)
    assert (-gradient[x == 0] if non_negative else abs(gradient[x == 0])).max(initial=-np.inf) <= w * (1 + 1e-5)
    assert 0 < (x == 0).sum() < x.size


def test_optimum_written_down_pixel_by_pixel():
    """For the identity the image is b moved towards zero by w / 2."""
    fields = {"scaling": "absolute", "weight": 0.5, "tolerance": 1e-12}
    assert L1Solver(**fields).solve(three_pixels()).image == pytest.approx(np.array([[0.75, 0, 0]]), abs=1e-10)
    signed = L1Solver(non_negative=False, **fields).solve(three_pixels())
    assert signed.image == pytest.approx(np.array([[0.75, 0, -0.75]]), abs=1e-10)


def test_total_variation_of_a_step_lowers_it():
    """For the identity a step between n and m pixels is lowered by w / 2 (1 / n + 1 / m), its sides staying flat."""
    data = np.repeat([5.0, 1.0], [4, 6])
    problem = Problem(np.eye(10), data, (1, 10))
    last = TvSolver(scaling="absolute", weight=0.8, tolerance=1e-12, n_iterations=2000).solve(problem)
    expected = np.repeat([5.0 - 0.4 / 4, 1.0 + 0.4 / 6], [4, 6])
    np.testing.assert_allclose(last.image[0], expected, atol=1e-9)


def test_cutting_off_negative_pixels_is_not_the_optimum():
    """The constrained optimum is lower than the positive part of the signed one, in wavelets and in TV."""
    for kind in ("wavelet", "tv"):
        problem = too_few_data()
        signed = SOLVERS[kind](non_negative=False, **FINE).solve(problem)
        best = SOLVERS[kind](**FINE).solve(problem)
        cut = np.maximum(signed.image, 0).ravel()
        misfit = dense(problem) @ cut - problem.data
        value = misfit @ misfit + weight_of(problem) * penalty_of(kind, seen(kind, problem.shape) @ cut)
        assert best.objective < 0.99 * value


@KINDS
def test_huge_weight_leaves_what_costs_nothing(kind):
    """At a weight of 1e6 the image is zero, and for TV the constant that fits best, certified."""
    problem = small_circles()
    last = SOLVERS[kind](weight=1e6, tolerance=1e-8, n_iterations=1000).solve(problem)
    signals = dense(problem).sum(axis=1)
    level = max(0.0, signals @ problem.data / (signals @ signals)) if kind == "tv" else 0.0
    np.testing.assert_allclose(last.image, level, atol=1e-6 * level)
    assert last.relative_gap <= 1e-6
    assert last.converged
    assert last.penalty == 0


@KINDS
def test_image_follows_the_scale(kind):
    """With dimensionless weights A -> a A and b -> k b turn the image into k/a times itself."""
    one = SOLVERS[kind](**FINE).solve(small_circles()).image
    other = SOLVERS[kind](**FINE).solve(scaled(small_circles(), 20.0, 1e-2)).image
    np.testing.assert_allclose(other * 20.0 / 1e-2, one, atol=1e-6 * one.max())


def test_relative_weight_is_in_units_of_norm_and_reference():
    """Weight w of the formula and w / (|A|^2 x_ref) give one image."""
    problem = small_circles()
    for cls in (L1Solver, TvSolver):
        relative = cls(weight=1e-2).solve(problem)
        absolute = cls(weight=weight_of(problem), scaling="absolute").solve(problem)
        np.testing.assert_allclose(absolute.image, relative.image, atol=1e-10 * relative.image.max())


@KINDS
def test_products_are_counted(kind):
    """Products are the applications of the operator, give or take one, and two at most lie between two images."""
    problem = small_circles()
    operator = Counting(problem)
    before = 0
    for state in SOLVERS[kind]().iterate(Problem(operator, problem.data, problem.shape)):
        assert operator.forwards - before <= 2
        before = operator.forwards
        assert abs(operator.forwards - state.products) <= 1
        assert abs(operator.adjoints - state.products) <= 1


@KINDS
def test_l_curve_chooses_a_weight(kind):
    """The rule "l-curve" gets both axes of every image and resolves the weight to a candidate."""
    solver, choice = resolve(SOLVERS[kind](weight="l-curve"), small_circles())
    assert solver.weight in CANDIDATES
    assert choice.curve[0].residual_norm < choice.curve[-1].residual_norm
    assert choice.curve[0].penalty > choice.curve[-1].penalty >= 0


def test_start_fits_the_data_better_than_the_base_image():
    """The start mixes the base image and its blur in the shares of a least-squares fit, without a negative pixel."""
    from scipy.ndimage import gaussian_filter
    from scipy.optimize import nnls

    problem = small_circles()
    base = np.maximum(problem.reference.base, 0)
    point = start(SparseObjective.of(problem, 1.0, Pixels(), True))
    images = np.array([base.ravel(), gaussian_filter(base, 2.0).ravel()]).T
    assert point.residual_norm == pytest.approx(nnls(dense(problem) @ images, problem.data)[1], rel=1e-10)
    assert point.image.min() >= 0
    np.testing.assert_allclose(point.misfit, dense(problem) @ point.image.ravel() - problem.data, atol=1e-10)


@PENALTIES
@pytest.mark.parametrize("step", [1e-2, 0.5, 20.0])
def test_moreau_identity(penalty, step):
    """What the prox takes away, p = v - u, has <p, u> = step R(u) and <p, z> <= step R(z) for every z."""
    image = 3 * RNG.standard_normal((12, 8))
    u = penalty.prox(image, step)
    taken = image - u
    assert (taken * u).sum() == pytest.approx(step * penalty.value(u), rel=1e-9, abs=1e-9)
    for z in RNG.standard_normal((50, 12, 8)):
        assert (taken * z).sum() <= step * penalty.value(z)
    if penalty != TotalVariation():
        coefficients = penalty.analysis().analyse(image)
        np.testing.assert_allclose(penalty.analysis().analyse(taken), np.clip(coefficients, -step, step), atol=1e-12)


@PENALTIES
@SIGNS
def test_no_nearby_image_beats_the_proximal_point(penalty, non_negative):
    """No small change that the constraint allows makes |u - v|^2 / 2 + step R(u) smaller."""
    image, step = RNG.standard_normal((8, 12)), 0.4
    analysis = Gradient() if penalty == TotalVariation() else penalty.analysis()
    found = proximal(analysis, image, step, non_negative, 1e-14, 20_000)

    def objective(u):
        return ((u - image) ** 2).sum() / 2 + step * penalty.value(u)

    least = objective(found.image)
    assert found.gap <= 1e-13
    assert magnitudes(found.dual).max() <= step * (1 + 1e-12)
    for size in (1e-1, 1e-3, 1e-5):
        for change in size * RNG.standard_normal((20, *image.shape)):
            near = found.image + change
            assert objective(np.maximum(near, 0) if non_negative else near) > least


def test_proximal_point_of_total_variation_is_pyproximals():
    """On a random image the prox is that of pyproximal's TV."""
    image = RNG.standard_normal((10, 12))
    expected = pyproximal.TV((10, 12), sigma=0.3, niter=5000, rtol=0).prox(image.ravel(), 1.0)
    np.testing.assert_allclose(TotalVariation().prox(image, 0.3).ravel(), expected, atol=1e-5)


def test_total_variation_of_known_images():
    """A constant costs nothing, half a plane its edge, a single pixel inside 2 + sqrt 2, a ramp its height."""
    tv = TotalVariation()
    assert tv.value(np.full((4, 5), 7.0)) == 0
    half = np.repeat([[0.0], [3.0]], [2, 2], axis=0) * np.ones((1, 5))
    assert tv.value(half) == 15
    pixel = np.zeros((5, 5))
    pixel[2, 2] = 1
    assert tv.value(pixel) == pytest.approx(2 + np.sqrt(2))
    assert tv.value(np.arange(6.0)[None]) == 5


def test_long_step_of_total_variation_leaves_the_mean():
    """From some step on the proximal point is the mean of the image, to the last bit."""
    image = RNG.standard_normal((6, 7))
    np.testing.assert_array_equal(TotalVariation().prox(image, 1e3), np.full_like(image, image.mean()))


@pytest.mark.parametrize("shape", [(1, 3), (5, 7), (8, 8)])
@pytest.mark.parametrize("analysis", [Pixels(), Gradient(), Wavelets("db4", 3)], ids=lambda a: type(a).__name__)
def test_operators_keep_their_promises(analysis, shape):
    """K^T is the adjoint of K, |K|^2 lies below its bound, and K^T of the preimage is what K sees of the image."""
    if isinstance(analysis, Wavelets) and shape != (8, 8):
        pytest.skip("odd sides have no wavelet basis")
    image = RNG.standard_normal(shape)
    coefficients = RNG.standard_normal(analysis.analyse(image).shape)
    left, right = (analysis.analyse(image) * coefficients).sum(), (image * analysis.adjoint(coefficients)).sum()
    assert left == pytest.approx(right, rel=1e-12, abs=1e-12)
    assert np.linalg.norm(columns(analysis.analyse, shape), 2) ** 2 <= analysis.norm_squared * (1 + 1e-12)
    mean = image.mean() if isinstance(analysis, Gradient) else 0.0
    np.testing.assert_allclose(analysis.adjoint(analysis.preimage(image)), image - mean, atol=1e-12)


@SIGNS
def test_compiled_ascent_is_the_plain_one(non_negative):
    """Forty steps in compiled code give the dual variable of forty steps in numpy."""
    gradient, image = Gradient(), RNG.standard_normal((9, 13))
    first = Ascent(*np.zeros((2, 2, 9, 13)))
    compiled = gradient.ascend(first, image, 0.3, non_negative, 40)
    plain = Analysis.ascend(gradient, first, image, 0.3, non_negative, 40)
    np.testing.assert_allclose(compiled.dual, plain.dual, atol=1e-13)
    np.testing.assert_allclose(compiled.previous, plain.previous, atol=1e-13)
    assert compiled.momentum == plain.momentum
    assert not first.dual.any()


@pytest.mark.parametrize("wavelet", ["haar", "db2", "db4", "sym8", "coif2"])
@pytest.mark.parametrize("shape", [(2, 2), (4, 6), (16, 24), (40, 40)])
def test_wavelet_transform_is_orthonormal(wavelet, shape):
    """The matrix of the transform is orthonormal, even where the filter is longer than the image."""
    matrix = columns(Wavelets(wavelet, 3).analyse, shape)
    np.testing.assert_allclose(matrix.T @ matrix, np.eye(len(matrix)), atol=1e-9)
    image = RNG.standard_normal(shape)
    np.testing.assert_allclose(Wavelets(wavelet, 3).adjoint(Wavelets(wavelet, 3).analyse(image)), image, atol=1e-9)


def test_wavelet_coefficients_are_those_of_pywavelets():
    """Three levels give the very numbers of PyWavelets' multilevel transform in its own layout."""
    image = RNG.standard_normal((64, 48))
    expected = pywt.coeffs_to_array(pywt.wavedec2(image, "db2", mode="periodization", level=3))[0]
    np.testing.assert_allclose(Wavelets("db2", 3).analyse(image)[0], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("fields", "shape", "sentence"),
    [
        ({}, (6, 5), r"even number of rows and of columns, got 6 x 5; take 6 x 6 pixels"),
        ({"wavelet": "db_4"}, (4, 4), "no discrete wavelet named 'db_4'; 'db4' is one"),
        ({"wavelet": "bior2.2"}, (4, 4), "'bior2.2' is not orthonormal"),
        ({"wavelet": "dmey"}, (4, 4), "'dmey' is not orthonormal"),
    ],
)
def test_wavelets_that_do_not_fit_get_a_sentence(fields, shape, sentence):
    """Odd sides, unknown and other than orthonormal wavelets are refused with advice."""
    with pytest.raises(ValidationError, match=sentence):
        L1(basis="wavelet", **fields).value(np.zeros(shape))


def test_missing_pywavelets_is_said_with_the_remedy(monkeypatch):
    """Without PyWavelets the wavelet basis names the line that installs it; pixels need nothing."""
    monkeypatch.setitem(sys.modules, "pywt", None)
    with pytest.raises(ValidationError, match=r"pip install 'oatkit\[wavelet\]'"):
        L1Solver(regularizer=WAVELET).solve(small_circles())
    assert L1Solver(n_iterations=1).solve(small_circles()).iteration == 1


def test_pipeline_file_chooses_the_basis():
    """A table in the pipeline file sets the basis and survives the round trip; a penalty of another kind is refused."""
    text = 'version = 1\n[forward]\nuse = "arc"\n[reconstruct]\nuse = "l1"\n'
    text += 'regularizer = { use = "l1", basis = "wavelet" }\n'
    pipeline = Pipeline.loads(text)
    assert pipeline.reconstruct == L1Solver(regularizer=L1(basis="wavelet"))
    assert Pipeline.loads(pipeline.to_toml()) == pipeline
    with pytest.raises(ValidationError, match="regularizer"):
        Pipeline.loads(text.replace('use = "l1", basis = "wavelet"', 'use = "tv"'))


@pytest.mark.parametrize("name", ["l1", "tv"])
def test_preset_holds_the_solver_of_its_name(name):
    """The preset reconstructs with the solver's own defaults."""
    assert Pipeline.load(name).reconstruct == plugin("solver", name)()
