"""What a solver promises: the right image, step by step, and the truth about how it ended."""

import gc
from collections.abc import Iterator
from functools import partial
from itertools import islice
from typing import Any, Literal, get_args, get_origin

import numpy as np

from oatkit.api import Iterate, Problem, Solver, ValidationError
from oatkit.errors import OatkitError
from oatkit.parameters import bounds_of
from oatkit.testing.problems import Counting, rings, rings_image, rings_without, well_posed
from oatkit.testing.running import difference, refuses

WEAK = 1e-6
"""A weight at which the penalty should hardly count, for solvers that have one."""
MISFIT, ERROR = 0.05, 0.1
"""What may be left of the data, and of the image, where there is one solution and next to no penalty."""
MOST_BETWEEN = 12
"""Applications of A, or of its adjoint, between two iterates: more of them cannot be cancelled."""
AGREEMENT = 1e-3
"""To which two ways to the same image, or the same residual, must agree."""


def known_answers(plugin: Solver) -> Iterator[str]:
    """On small problems with one positive solution it comes near that as its weight vanishes.

    It may refuse one with a `ValidationError`: as no inversion of an operator it may need detectors, or other shapes.
    What it `sees` it must tell.
    """
    solver = _weak(plugin)
    for name, (problem, truth) in well_posed().items():
        try:
            state = solver.solve(problem)
        except ValidationError:
            continue
        misfit = difference(problem.forward(state.image), problem.data)
        error = difference(state.image, truth)
        if not (misfit <= MISFIT and error <= ERROR):
            yield f"on '{name}' {misfit:.1%} of the data are left, and the image is wrong by {error:.1%} of it"


def sees(plugin: Solver) -> Iterator[str]:
    """On a small acoustic problem the image is like what is there, and explains some of the data."""
    problem = rings()
    state = plugin.solve(problem)
    likeness = float(np.corrcoef(np.ravel(state.image), rings_image().ravel())[0, 1])
    if not likeness >= 0.5:
        yield f"the correlation of image and truth is {likeness:.2f}; expected 0.5 or more"
    misfit = difference(problem.forward(state.image), problem.data)
    if not misfit <= 0.9:
        yield f"the image leaves {misfit:.0%} of the data unexplained, at most 90 % expected"


def falls(plugin: Solver) -> Iterator[str]:
    """The objective of no iterate is above that of the first one that has it, nor are the data explained worse."""
    problem = rings()
    states = list(plugin.iterate(problem))
    known = [state.objective for state in states if np.isfinite(state.objective)]
    if known and not max(known) <= known[0] * (1 + 1e-9):
        yield f"the objective rises from {known[0]:.6g} to {max(known):.6g}"
    if not np.linalg.norm(problem.forward(states[-1].image) - problem.data) <= np.linalg.norm(problem.data):
        yield "the last image explains the data worse than an empty one"


def residuals(plugin: Solver) -> Iterator[str]:
    """``residual_norm`` is |A x - b| of the image, or of the one before a last step which ``details`` tells about."""
    problem = rings()
    state = plugin.solve(problem)
    told = state.details.get("residual_norm_after", state.residual_norm)
    found = float(np.linalg.norm(problem.forward(state.image) - problem.data))
    if np.isfinite(told) and not abs(told - found) <= AGREEMENT * float(np.linalg.norm(problem.data)):
        yield f"residual_norm is {told:.6g}, |A x - b| is {found:.6g}"


def repeats(plugin: Solver) -> Iterator[str]:
    """The same problem gives the same image to the last bit, in as many steps."""
    first, second = (list(plugin.iterate(rings())) for _ in range(2))
    if len(first) != len(second) or not np.array_equal(first[-1].image, second[-1].image):
        yield "the same problem gives another image the second time; seed what is random"


def scales(plugin: Solver) -> Iterator[str]:
    """Data that are zero, huge or tiny, and an operator that hears nothing, give a finite image or an error of ours.

    Of data that are zero the image is zero.
    """
    deaf, _ = rings_without(np.ones(24, bool))
    cases = {f"data of size {scale:g}": rings(scale) for scale in (0.0, 1e12, 1e-12)} | {"an operator of zeros": deaf}
    for name, problem in cases.items():
        try:
            state = plugin.solve(problem)
        except OatkitError:
            continue
        if not np.isfinite(state.image).all():
            yield f"{name} gives {(~np.isfinite(state.image)).sum()} pixels that are not finite"
        elif not problem.data.any() and not np.abs(state.image).max() <= 1e-9:
            yield f"{name}, without data, gives an image of up to {np.abs(state.image).max():.3g}"


def cancelling(plugin: Solver) -> Iterator[str]:
    """It yields often, can be closed at each iterate, and then holds on to nothing."""
    count, last = 0, 0
    problem = rings()
    for count, _ in enumerate(plugin.iterate(problem), 1):
        done = _operator(problem).products
        if not done - last <= MOST_BETWEEN:
            yield f"{done - last} applications of A lie before iterate {count}; yield after each step"
            return
        last = done
    for steps in sorted({1, 2, 3, count // 2, count - 1, count} & set(range(1, count + 1))):
        problem = rings()
        iterates = plugin.iterate(problem)
        for _ in islice(iterates, steps):
            pass
        alive = _operator(problem).reference()
        if not hasattr(iterates, "close"):
            yield "iterate returns no generator, so that it cannot be closed"
            return
        try:
            iterates.close()
        except RuntimeError as error:
            yield f"closed after {steps} iterates, it goes on: {error}"
            return
        del iterates, problem
        gc.collect()
        if alive() is not None:
            yield f"closed after {steps} iterates, it still holds the operator"
            return


def honest(plugin: Solver) -> Iterator[str]:
    """Only the last iterate is ``converged`` or has a ``reason``; it has one or the other, and they are true.

    Stopped after one step by ``n_iterations`` it has not converged, unless the image is the final one already.
    """
    states = list(plugin.iterate(rings()))
    if any(state.converged or state.reason for state in states[:-1]):
        yield "an iterate before the last is converged, or has a reason"
    if not (states[-1].converged or states[-1].reason):
        yield "the last iterate is not converged, and gives no reason"
    if "n_iterations" in type(plugin).model_fields and not refuses(partial(_limited, plugin)):
        state = _limited(plugin).solve(rings())
        error = difference(state.image, states[-1].image)
        if state.converged and not error <= ERROR:
            yield f"after one step it says converged, {error:.0%} away from its final image"
        if not (state.converged or state.reason):
            yield "stopped after one step it gives no reason"


def iterates(plugin: Solver) -> Iterator[str]:
    """Each image is one of real numbers and the problem's shape, never modified later; steps are counted upwards."""
    problem = rings()
    data = problem.data.copy()
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    last = Iterate(np.zeros(0), 0)
    for state in plugin.iterate(problem):
        image = np.asarray(state.image)
        if image.shape != problem.shape or image.dtype.kind != "f":
            yield f"an image is {image.dtype} of shape {image.shape}, not float of {problem.shape}"
            return
        if state.iteration < last.iteration or state.products < last.products:
            yield "iteration or products fall from one iterate to the next"
            return
        seen.append((state.image, np.array(state.image)))
        last = state
    if not seen:
        yield "it ends without an iterate"
    if any(not np.array_equal(image, copy) for image, copy in seen):
        yield "an image is modified after it was yielded; yield a copy"
    if not np.array_equal(data, problem.data):
        yield "the data are modified"


def products(plugin: Solver) -> Iterator[str]:
    """``products`` are the applications of A and A^T, counted together, to one: what a method costs."""
    problem = rings()
    told, done = plugin.solve(problem).products, _operator(problem).products
    if not abs(told - done) <= 2:
        yield f"products is {told}, the operator was applied {done} times"


def valid_detectors(plugin: Solver) -> Iterator[str]:
    """Detectors that are not valid count for nothing: the image is the one without them."""
    bad = np.arange(24) % 5 == 2
    masked, fewer = (plugin.solve(problem).image for problem in rings_without(bad) if problem)
    error = difference(masked, fewer)
    if not error <= AGREEMENT:
        yield f"with detectors marked as not valid the image differs by {error:.1e} from the one without them"


def rules(plugin: Solver) -> Iterator[str]:
    """A weight that is still the name of a rule is a `ValidationError`."""
    for word in _words(type(plugin).model_fields["weight"].annotation) if _weighs(plugin) else ():
        solver = plugin.model_copy(update={"weight": word})
        if not refuses(partial(solver.solve, rings()), ValidationError):
            yield f"it runs with the weight '{word}', which stands for a number that was not put in"


def _weighs(plugin: Solver) -> bool:
    return "weight" in type(plugin).model_fields


def _weak(plugin: Solver) -> Solver:
    """Return the solver with a weight that hardly counts, where it has one that may be so."""
    if not _weighs(plugin) or not bounds_of(type(plugin).model_fields["weight"]).allow(WEAK):
        return plugin
    return plugin.model_copy(update={"weight": WEAK})


def _limited(plugin: Solver) -> Solver:
    """Return the solver stopped after one step. Raises `ValidationError` where that is out of its range."""
    return type(plugin)(**{**{name: getattr(plugin, name) for name in type(plugin).model_fields}, "n_iterations": 1})


def _words(annotation: Any) -> tuple[str, ...]:
    """Return the words that an annotation allows."""
    if get_origin(annotation) is Literal:
        return tuple(word for word in get_args(annotation) if isinstance(word, str))
    return tuple(word for part in get_args(annotation) for word in _words(part))


def _operator(problem: Problem) -> Counting:
    return problem.operator


CHECKS = (
    known_answers, sees, falls, residuals, repeats, scales, cancelling, honest, iterates, products, valid_detectors,
    rules,
)  # fmt: skip
