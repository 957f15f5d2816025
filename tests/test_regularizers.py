"""The penalties: their gradients, proximal maps and operators."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import lambertw

from oatkit.api import Proximable, Quadratic, Smooth
from oatkit.builtin.regularizers.entropy import Entropy, log_prox
from oatkit.builtin.regularizers.identity import Identity
from packages import built_in

RNG = np.random.default_rng(0)
IMAGE = RNG.uniform(0.1, 3.0, (5, 7))
OURS = [cls() for cls in built_in("regularizer")]
SMOOTH, PROXIMABLE, QUADRATIC = ([r for r in OURS if isinstance(r, a)] for a in (Smooth, Proximable, Quadratic))


def named(regularizer):
    """What pytest calls a regularizer."""
    return regularizer.name


@pytest.mark.parametrize("regularizer", SMOOTH, ids=named)
def test_gradient_is_the_derivative_of_the_value(regularizer):
    """The gradient agrees with central differences of the value."""
    for direction in RNG.standard_normal((3, *IMAGE.shape)):
        step = 1e-5
        above, below = (regularizer.value(IMAGE + sign * step * direction) for sign in (1, -1))
        slope = float((regularizer.gradient(IMAGE) * direction).sum())
        assert (above - below) / (2 * step) == pytest.approx(slope, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("regularizer", PROXIMABLE, ids=named)
@pytest.mark.parametrize("step", [1e-3, 0.3, 10.0])
def test_no_nearby_image_beats_the_prox(regularizer, step):
    """Any small change of the proximal point makes |u - v|^2 / 2 + step * value(u) larger."""
    image = RNG.standard_normal(IMAGE.shape)
    best = regularizer.prox(image, step)

    def objective(u):
        return 0.5 * float(((u - image) ** 2).sum()) + step * regularizer.value(u)

    for change in 1e-3 * RNG.standard_normal((20, *image.shape)):
        assert objective(best * np.exp(change) + np.where(best == 0, change, 0)) > objective(best)


@pytest.mark.parametrize("regularizer", PROXIMABLE, ids=named)
@given(arrays(float, (2, 3, 4), elements=st.floats(-50, 50)), st.floats(1e-3, 1e3))
def test_prox_brings_images_nearer_to_each_other(regularizer, pair, step):
    """A proximal map is firmly non-expansive: |Pu - Pv|^2 <= <Pu - Pv, u - v>."""
    u, v = pair
    change = regularizer.prox(u, step) - regularizer.prox(v, step)
    assert (change**2).sum() <= (change * (u - v)).sum() + 1e-10


@pytest.mark.parametrize("regularizer", QUADRATIC, ids=named)
def test_quadratic_is_the_squared_norm_of_its_operator(regularizer):
    """value(x) = |L x|^2 and gradient(x) = 2 L^T L x, and L^T is the adjoint of L."""
    operator = regularizer.operator(IMAGE.shape)
    applied = operator.matvec(IMAGE.ravel())
    assert regularizer.value(IMAGE) == pytest.approx(float(applied @ applied), rel=1e-13)
    np.testing.assert_allclose(regularizer.gradient(IMAGE).ravel(), 2 * operator.rmatvec(applied), atol=1e-12)
    other = RNG.standard_normal(operator.shape[0])
    assert applied @ other == pytest.approx(IMAGE.ravel() @ operator.rmatvec(other), abs=1e-12)


@pytest.mark.parametrize("regularizer", OURS, ids=named)
@given(st.floats(1e-3, 1e3))
def test_degree_says_how_the_penalty_grows(regularizer, factor):
    """value(k x) = k^degree value(x), the prior of the entropy growing along."""
    larger = type(regularizer)(prior=factor) if isinstance(regularizer, Entropy) else regularizer
    expected = factor**regularizer.degree * regularizer.value(IMAGE)
    assert larger.value(factor * IMAGE) == pytest.approx(expected, rel=1e-11)


def test_laplacian_of_known_images():
    """A constant costs nothing, a single pixel inside 4^2 + 4 * 1 = 20, one in a corner 2^2 + 2 * 1 = 6."""
    laplacian = next(r for r in QUADRATIC if r.name == "laplacian")
    assert laplacian.value(np.full((4, 5), 7.0)) == 0
    for place, cost in {(2, 2): 20, (0, 0): 6}.items():
        image = np.zeros((5, 5))
        image[place] = 1
        assert laplacian.value(image) == cost


def test_entropy_is_zero_at_the_prior_and_infinite_below_zero():
    """The divergence is 0 at x = m, m at x = 0, and infinite where a pixel is negative."""
    entropy = Entropy(prior=0.3)
    assert entropy.value(np.full((2, 2), 0.3)) == pytest.approx(0, abs=1e-16)
    assert entropy.value(np.zeros((1, 1))) == pytest.approx(0.3)
    assert entropy.value(np.array([[0.3, -1e-9]])) == np.inf


def test_entropy_prox_is_lamberts_function():
    """The proximal point is step * W(m / step * exp(v / step)), by scipy's Lambert W."""
    v, step, prior = np.linspace(-3, 5, 41), 0.7, 0.4
    expected = step * lambertw(prior / step * np.exp(v / step)).real
    np.testing.assert_allclose(Entropy(prior=prior).prox(v, step), expected, rtol=1e-14)


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_entropy_prox_meets_its_optimality_condition(image, step, prior):
    """U + step log(u / m) = v holds to rounding wherever u can be written, and the logarithm is always finite."""
    logs = float(log_prox(np.array([image]), step, prior)[0])
    assert np.isfinite(logs)
    found = prior * np.exp(logs) + step * logs
    terms = prior * np.exp(logs) + step * (abs(logs) + abs(np.log(prior / step)))
    assert abs(found - image) <= 1e-14 * (terms + abs(image)) + 1e-300


@given(arrays(float, (3, 4), elements=st.floats(-30, 30)), st.floats(1e-2, 1e2))
def test_moreau_identity_of_the_identity(image, step):
    """V = prox of |x|^2 + step * prox of its conjugate |y|^2 / 4 at v / step."""
    primal = Identity().prox(image, step)
    dual = (image / step) / (1 + 1 / (2 * step))
    np.testing.assert_allclose(primal + step * dual, image, atol=1e-12)


@given(arrays(float, (3, 4), elements=st.floats(-20, 20)), st.floats(0.1, 1e2))
def test_moreau_identity_of_the_entropy(image, step):
    """(v - u) / step is the proximal point of the conjugate m (exp(y) - 1) at v / step: its gradient there fits."""
    prior = 0.8
    y = (image - Entropy(prior=prior).prox(image, step)) / step
    slope = (y - image / step) * step + prior * np.exp(y)
    np.testing.assert_allclose(slope, 0, atol=1e-11 * (1 + abs(image).max()))
