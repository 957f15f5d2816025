"""The choice of weights: Shaw's problem, hold-out of detectors, and what is said of a choice."""

from dataclasses import replace

import numpy as np
import pytest

import oatkit
from oatkit import weights
from oatkit.api import Detectors, Geometry, Problem
from oatkit.checkpoint import at_checkpoints
from oatkit.cli.progress import ProgressBar
from oatkit.errors import PluginError, ValidationError
from oatkit.events import StepStarted
from oatkit.memo import Memo
from oatkit.weights import CANDIDATES, choose, l_curve_chord, l_curve_corner, resolve
from small_problems import blurred, circles, dense

SHAW_DATA = [
    8.7547455124379323e-04, 5.4996835885761936e-04, 1.7527999407005367e-06, 1.9552372913117047e-03,
    1.4411645433785081e-02, 5.2800013336393704e-02, 1.3609152023257112e-01, 2.7203484587635818e-01,
    4.3752225136193390e-01, 5.7547667319875240e-01, 6.2445052213539942e-01, 5.6252658286441348e-01,
    4.2322239923561566e-01, 2.6768469219560631e-01, 1.4337901162734543e-01, 6.5614569346074361e-02,
    2.6013851831752945e-02, 9.2336933089481269e-03, 3.2269066658993694e-03, 1.3999201459261811e-03,
]  # fmt: skip
"""The data of Shaw's problem with 20 slits, with errors of 1e-6, as in the tests of the GNU Scientific Library."""


@pytest.fixture(scope="module")
def shaw():
    """Singular values, coefficients of the data, and a thousand values of Tikhonov's lambda."""
    step = np.pi / 20
    angle = -np.pi / 2 + (np.arange(20) + 0.5) * step
    reach = np.sin(angle)[:, None] + np.sin(angle)
    matrix = step * ((np.cos(angle)[:, None] + np.cos(angle)) * np.sinc(reach)) ** 2
    left, singular, _ = np.linalg.svd(matrix)
    lambdas = np.geomspace(singular[0], max(singular[-1], 16 * np.finfo(float).eps * singular[0]), 1000)
    return singular, left.T @ SHAW_DATA, lambdas


def tikhonov(shaw, lambdas):
    """Residual norm and squared norm of the solution for each lambda."""
    singular, coefficients, _ = shaw
    total = singular**2 + lambdas[:, None] ** 2
    residuals = np.linalg.norm(lambdas[:, None] ** 2 / total * coefficients, axis=1)
    return residuals, ((singular / total * coefficients) ** 2).sum(axis=1)


def test_corner_of_shaws_l_curve(shaw):
    """The corner is the lambda that the GNU Scientific Library finds on the same thousand points."""
    lambdas = shaw[2]
    corner = l_curve_corner(lambdas**2, *tikhonov(shaw, lambdas))
    assert lambdas[corner] == pytest.approx(5.793190958069266e-06, rel=1e-12)


def test_corner_does_not_depend_on_the_order_of_the_weights(shaw):
    """Rising and falling weights give the same corner and the same furthest point from the chord."""
    lambdas = shaw[2]
    falling, rising = tikhonov(shaw, lambdas), tikhonov(shaw, lambdas[::-1])
    for rule in (l_curve_corner, l_curve_chord):
        assert lambdas[::-1][rule(lambdas[::-1], *rising)] == lambdas[rule(lambdas, *falling)]


def test_chord_lies_near_the_corner_of_an_l():
    """On two straight branches of slopes -10 and -1/10 both rules find the point where they meet."""
    t = np.arange(-5.0, 6.0)
    log_residual, log_norm = np.where(t < 0, t / 10, t), np.where(t < 0, -t, -t / 10)
    curve = np.exp(t), np.exp(log_residual), np.exp(2 * log_norm)
    assert l_curve_corner(*curve) == l_curve_chord(*curve) == 5


def with_geometry(problem, detectors=16):
    """The problem with a geometry of so many detectors."""
    angle = np.linspace(0, 4, detectors)
    places = Detectors(0.04 * np.column_stack([np.sin(angle), np.cos(angle)]))
    geometry = Geometry(places, 40e6, problem.data.size // detectors)
    return Problem(problem.operator, problem.data, problem.shape, geometry)


def test_l_curve_weight_of_lsqr_is_the_corner_of_direct_solves():
    """For least squares the chosen weight is the corner of the curve of dense solutions at the same candidates."""
    problem = blurred()
    lsqr = oatkit.plugin("solver", "lsqr")(weight="l-curve", tolerance=1e-6, n_iterations=1000)
    choice = choose(lsqr, problem, "l-curve")
    matrix, rough = dense(problem), lsqr.regularizer.operator(problem.shape).matmat(np.eye(72))
    norm = np.linalg.norm(matrix, 2)
    curve = []
    for tau in CANDIDATES:
        x = np.linalg.solve(matrix.T @ matrix + tau * norm**2 * rough.T @ rough, matrix.T @ problem.data)
        curve.append((np.linalg.norm(matrix @ x - problem.data), np.sum((rough @ x) ** 2)))
    residuals, penalties = zip(*curve, strict=True)
    np.testing.assert_allclose([point.residual_norm for point in choice.curve], residuals, rtol=1e-3)
    np.testing.assert_allclose([point.penalty for point in choice.curve], penalties, rtol=1e-2)
    assert choice.weight == CANDIDATES[l_curve_corner(CANDIDATES, residuals, penalties)]
    assert choice.curve[choice.index].weight == choice.weight


def test_hold_out_takes_the_weight_that_predicts_best():
    """The chosen weight has the least misfit over every seventh detector, of images made without those detectors."""
    problem = with_geometry(circles())
    choice = choose(oatkit.plugin("solver", "lsqr")(), problem, "hold-out")
    held_out = np.repeat(np.arange(16) % 7 == 3, 60)
    errors = []
    for point in choice.curve:
        fit = Problem(dense(problem)[~held_out], problem.data[~held_out], problem.shape)
        image = oatkit.plugin("solver", "lsqr")(weight=point.weight).solve(fit).image
        errors.append(np.linalg.norm((dense(problem) @ image.ravel() - problem.data)[held_out]))
    np.testing.assert_allclose([point.prediction_error for point in choice.curve], errors, rtol=1e-3)
    assert choice.weight == CANDIDATES[int(np.argmin(errors))]


@pytest.mark.parametrize("rule", ["l-curve", "hold-out"])
@pytest.mark.parametrize("name", ["lsqr", "lsqr-threshold", "maxent-nlcg", "nnls"])
def test_every_solver_with_a_weight_takes_every_rule(name, rule):
    """The weight is resolved to one of the candidates, and the resolved solver solves."""
    solver, choice = resolve(oatkit.plugin("solver", name)(weight=rule), with_geometry(circles()))
    assert solver.weight == choice.weight
    assert choice.weight in CANDIDATES
    assert np.isfinite(solver.solve(circles()).image).all()
    assert set(dict(choice.picks)) == {"curvature", "chord"} | ({"prediction"} if rule == "hold-out" else set())


def test_detectors_kept_back_are_not_valid():
    """The problem that is solved at each weight counts neither the held-out detectors nor those out of use before."""
    seen = []

    class Watching(oatkit.plugin("solver", "lsqr")):
        def descend(self, problem, weight):
            seen.append(problem.valid)
            return super().descend(problem, weight)

    problem = replace(with_geometry(circles()), valid=np.arange(16) != 5)
    choose(Watching(), problem, "hold-out")
    assert len(seen) == len(CANDIDATES)
    assert all(valid.tolist() == [i not in (3, 5, 10) for i in range(16)] for valid in seen)


def test_number_is_left_alone():
    """A solver whose weight is a number, or that has none, comes back as it is."""
    for name, fields in {"lsqr": {"weight": 0.3}, "backprojection": {}}.items():
        solver = oatkit.plugin("solver", name)(**fields)
        assert resolve(solver, circles()) == (solver, None)


def test_unresolved_rule_is_refused_by_solvers():
    """Solving with the name of a rule says who applies it."""
    for name in ("lsqr", "lsqr-threshold", "maxent-nlcg", "nnls"):
        with pytest.raises(ValidationError, match=r"'l-curve' has not been applied.*oatkit\.weights\.resolve"):
            oatkit.plugin("solver", name)(weight="l-curve").solve(circles())


def test_choice_does_not_depend_on_the_scale_of_data_and_operator():
    """A -> 7 A and b -> 0.01 b leave the dimensionless weight as it is."""
    solver = oatkit.plugin("solver", "maxent-nlcg")(weight="l-curve")
    small = Problem(7 * dense(circles()), 0.01 * circles().data, circles().shape)
    assert resolve(solver, small)[1].weight == resolve(solver, circles())[1].weight


def test_doubts_are_noted():
    """A choice at the end of the range, and rules that differ by more than a decade, each get a sentence."""
    curve = tuple(weights.CurvePoint(w, r, p) for w, r, p in [(1e-3, 1, 3), (1e-2, 2, 2), (1.0, 3, 1)])
    noted = list(weights._notes(1e-3, curve, {"curvature": 1e-3, "chord": 1.0}))
    assert "disagree (curvature 0.001, chord 1)" in noted[0]
    assert "at the end of the range" in noted[1]
    assert list(weights._notes(1e-2, curve, {"curvature": 1e-2, "chord": 1e-2})) == []


@pytest.mark.parametrize(
    ("rule", "fields", "candidates", "message"),
    [
        ("gcv", {}, None, "no rule named 'gcv'; expected l-curve or hold-out"),
        ("l-curve", {}, [1, 2, 3, 4, float("nan")], "five or more different weights above 0"),
        ("l-curve", {}, [1, 2, 3, 4, 4], "five or more different weights above 0"),
        ("l-curve", {"scaling": "absolute"}, None, "dimensionless weights"),
        ("hold-out", {}, None, "needs a geometry of 14 or more detectors, got none"),
    ],
)
def test_bad_requests_get_a_sentence(rule, fields, candidates, message):
    """What cannot be chosen is refused before anything is solved."""
    with pytest.raises(ValidationError, match=message):
        choose(oatkit.plugin("solver", "lsqr")(**fields), circles(), rule, candidates)


def test_solver_without_a_weight_is_refused():
    """Back-projection has no weight to choose."""
    with pytest.raises(ValidationError, match="'backprojection' has no weight to choose"):
        choose(oatkit.plugin("solver", "backprojection")(), circles(), "l-curve")


def test_table_of_a_choice_is_plain():
    """What a result keeps of a choice holds the curve, the picks and their disagreement as plain values."""
    table = choose(oatkit.plugin("solver", "lsqr")(), blurred(), "l-curve").table()
    assert table["rule"] == "l-curve"
    assert len(table["curve"]) == len(CANDIDATES)
    assert table["disagreement"] == max(table["picks"].values()) / min(table["picks"].values())


def lsqr(**fields):
    """Least squares with a rule for its weight."""
    return oatkit.plugin("solver", "lsqr")(**{"weight": "l-curve", **fields})


@pytest.mark.parametrize("rule", ["l-curve", "hold-out"])
def test_who_listens_sees_each_point_and_changes_nothing(rule):
    """Listeners are told how many of 13 are done, and shown each point with its image; the choice stays the same."""
    problem, told, shown = with_geometry(circles()), [], []
    solver = lsqr(weight=rule)
    heard = resolve(solver, problem, told.append, lambda point, last: shown.append((point, last)))
    assert told == [StepStarted(f"choosing the weight, {done} of 13 done") for done in range(13)]
    assert heard == resolve(solver, problem)
    assert tuple(point for point, _ in shown[::-1]) == heard[1].curve  # from the strongest to the weakest
    for point, last in shown:
        assert (last.residual_norm, last.penalty) == (point.residual_norm, point.penalty)
    if rule == "l-curve":
        alone = lsqr(weight=shown[4][0].weight).solve(with_geometry(circles()))
        assert (shown[4][1].image == alone.image).all()


def test_choosing_passes_a_checkpoint_at_each_step_of_the_solver():
    """A choice can be stopped in the middle of any candidate, not only between two."""

    class Stop(BaseException):
        pass

    def stop_at_the_third():
        passed.append(True)
        if len(passed) == 3:
            raise Stop

    passed, shown = [], []
    with pytest.raises(Stop), at_checkpoints(stop_at_the_third):
        choose(lsqr(), circles(), "l-curve", on_point=lambda point, last: shown.append(point))
    assert shown == []


def test_a_failing_solver_is_named_and_a_failing_listener_is_not_its_fault():
    """What a solver raises becomes a `PluginError` with its name; what a listener raises passes as it is."""

    class Broken(oatkit.plugin("solver", "lsqr")):
        def descend(self, problem, weight):
            raise RuntimeError("out of luck")

    with pytest.raises(PluginError, match="solver 'lsqr' failed: RuntimeError: out of luck"):
        choose(Broken(), circles(), "l-curve")

    def deaf(event):
        raise BrokenPipeError("nobody reads")

    with pytest.raises(BrokenPipeError, match="nobody reads"):
        choose(lsqr(), circles(), "l-curve", on_event=deaf)


def test_zero_data_are_refused():
    """Where the data are zero no rule can choose."""
    zero = replace(circles(), data=np.zeros_like(circles().data))
    with pytest.raises(ValidationError, match="the data are zero"):
        choose(lsqr(), zero, "l-curve")


SMALL = ("grid.pixels=16", "grid.field_of_view_mm=9", "reconstruct.weight=l-curve", "reconstruct.n_iterations=12")


def choices_told(pipeline, scan, memo):
    """How many candidates a run has tried, and its result."""
    told = []
    result = oatkit.run(pipeline, scan, memo=memo, on_event=told.append)
    return sum(isinstance(e, StepStarted) and e.step.endswith("of 13 done") for e in told), result


def test_a_choice_is_made_once_for_what_it_depends_on(small_scan):
    """A second run with the same memo tries no weight and gives the same; another solver or scan is tried anew."""
    memo, pipeline = Memo(), oatkit.Pipeline.load("lsqr", SMALL)
    tried, first = choices_told(pipeline, small_scan, memo)
    assert tried == 13
    tried, second = choices_told(pipeline, small_scan, memo)
    assert tried == 0
    assert second == first
    assert second.weight_choice == first.weight_choice == oatkit.run(pipeline, small_scan).weight_choice
    for change in ("reconstruct.n_iterations=11", "reconstruct.weight=hold-out", "grid.pixels=17"):
        assert choices_told(oatkit.Pipeline.load("lsqr", (*SMALL, change)), small_scan, memo)[0] == 13
    louder = replace(small_scan, signals=2 * np.asarray(small_scan.signals))
    assert choices_told(pipeline, louder, memo)[0] == 13


def test_a_terminal_sees_how_many_weights_are_done(small_scan, monkeypatch):
    """The progress line of a run by rule counts the candidates."""

    class Terminal:
        text = ""

        def isatty(self):
            return True

        def write(self, text):
            self.text += text

        def flush(self): ...

    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with ProgressBar() as bar:
        oatkit.run(oatkit.Pipeline.load("lsqr", SMALL), small_scan, on_event=bar.show)
    assert "choosing the weight, 0 of 13 done" in terminal.text
    assert "choosing the weight, 12 of 13 done" in terminal.text
