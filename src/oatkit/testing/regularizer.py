"""What a regularizer promises: a gradient, a proximal map and an operator that belong to its value."""

from collections.abc import Iterator

import numpy as np

from oatkit.api import Proximable, Quadratic, Regularizer, Smooth
from oatkit.testing.problems import random
from oatkit.testing.running import difference

SHAPE = (12, 10)
STEPS = (0.05, 0.7)
"""Of the proximal map."""
ROUNDING = 1e-9


def value(plugin: Regularizer) -> Iterator[str]:
    """The value of a positive image is a finite number, the same each time, and the image stays as it is."""
    image = _positive(0)
    before = image.copy()
    found = plugin.value(image)
    if not (isinstance(found, float | int) and np.isfinite(found)):
        yield f"the value of a positive image is {found!r}; expected a finite number"
    if plugin.value(image) != found or not np.array_equal(image, before):
        yield "value changes its image, or is another the second time"
    if not isinstance(plugin, Smooth | Proximable | Quadratic):
        yield "it has no ability: derive it from Smooth, Proximable or Quadratic"


def degree(plugin: Regularizer) -> Iterator[str]:
    """It grows with the power `degree` of the image: 1 or 2.

    One that does not vanish at zero, such as the entropy to a default model, is not homogeneous and is left alone.
    """
    if plugin.degree not in (1, 2):
        yield f"degree is {plugin.degree}, not 1 or 2"
    elif _homogeneous(plugin):
        image = _positive(0)
        ratio = plugin.value(3.0 * image) / plugin.value(image)
        if not abs(ratio / 3.0**plugin.degree - 1) <= ROUNDING:
            yield f"three times the image costs {ratio:.6g} times as much, by its degree {3**plugin.degree} times"


def gradient(plugin: Regularizer) -> Iterator[str]:
    """The gradient is that of the value, by central differences along random directions."""
    if not isinstance(plugin, Smooth):
        return
    for seed in range(3):
        image, direction = _positive(seed), random(*SHAPE, seed=seed + 10)
        found = plugin.gradient(image)
        if np.shape(found) != SHAPE:
            yield f"the gradient of an image of shape {SHAPE} has the shape {np.shape(found)}"
            return
        h = 1e-5
        slope = (plugin.value(image + h * direction) - plugin.value(image - h * direction)) / (2 * h)
        size = max(abs(slope), float(np.linalg.norm(found) * np.linalg.norm(direction)))
        told = float((found * direction).sum())
        if not abs(told - slope) <= 1e-6 * size:
            yield f"the slope along a direction is {slope:.9g}, by the gradient {told:.9g}"
            return


def proximal(plugin: Regularizer) -> Iterator[str]:
    """No image, near or far, has a lower |u - image|^2 / 2 + step value(u) than the proximal point.

    Where the value is convex it lies higher by at least half the squared distance from that point.
    """
    if not isinstance(plugin, Proximable):
        return
    for seed, step in enumerate(STEPS):
        image = random(*SHAPE, seed=seed)
        before = image.copy()
        point = np.asarray(plugin.prox(image, step))
        if point.shape != SHAPE or not np.isfinite(point).all() or not np.array_equal(image, before):
            yield f"prox returns the shape {point.shape}, values that are not finite, or changes its image"
            return
        lowest = _objective(plugin, point, image, step)
        for other in _around(point, image, seed):
            margin = 0.5 * float(((other - point) ** 2).sum()) if _convex(plugin) else 0.0
            lack = lowest + margin - _objective(plugin, other, image, step)
            if not lack <= ROUNDING * max(1.0, abs(lowest)):
                yield f"at a step of {step:g} another image lies lower than it may, by {lack:.3g} of {lowest:.6g}"
                return


def moreau(plugin: Regularizer) -> Iterator[str]:
    """With u = prox(v), v splits as Moreau says (1965): (v - u) / step is a subgradient at u.

    For homogeneous penalties Euler's identity makes it an equation, <v - u, u> = degree * step * value(u); for smooth
    ones v - u is step times the gradient. Two proximal points are no further apart than what they are those of.
    """
    if not isinstance(plugin, Proximable) or not _convex(plugin):
        return
    images = [np.abs(random(*SHAPE, seed=seed)) + 0.2 for seed in (3, 4)]
    step = STEPS[0]
    points = [np.asarray(plugin.prox(image, step)) for image in images]
    (v, w), (u, z) = images, points
    if not float(((u - z) * (u - z)).sum()) <= float(((u - z) * (v - w)).sum()) * (1 + ROUNDING):
        yield "it moves two images apart: |prox(v) - prox(w)|^2 is above <prox(v) - prox(w), v - w>"
    if _homogeneous(plugin):
        left, right = float(((v - u) * u).sum()), plugin.degree * step * plugin.value(u)
        if not abs(left - right) <= 1e-6 * max(abs(right), float(np.linalg.norm(v - u) * np.linalg.norm(u))):
            yield f"<v - u, u> is {left:.9g}, not degree * step * value(u) = {right:.9g}"
    if isinstance(plugin, Smooth):
        error = difference(v - u, step * plugin.gradient(u))
        if not error <= 1e-6:
            yield f"v - u differs from step times the gradient at u by {error:.1e} of it"


def quadratic(plugin: Regularizer) -> Iterator[str]:
    """|L x|^2 is the value, and L has an exact adjoint."""
    if not isinstance(plugin, Quadratic):
        return
    operator = plugin.operator(SHAPE)
    image = random(*SHAPE)
    rows, columns = operator.shape
    if columns != image.size:
        yield f"L has {columns} columns for {image.size} pixels"
        return
    seen = np.asarray(operator.matvec(image.ravel()))
    squared, told = float((seen**2).sum()), plugin.value(image)
    if not abs(squared - told) <= ROUNDING * abs(told):
        yield f"|L x|^2 is {squared:.9g}, the value {told:.9g}"
    y = random(rows, seed=1)
    left, right = float(seen @ y), float(image.ravel() @ operator.rmatvec(y))
    if not abs(left - right) <= 1e-10 * float(np.linalg.norm(seen) * np.linalg.norm(y)):
        yield f"<L x, y> is {left:.12g} and <x, L^T y> is {right:.12g}"


def _positive(seed: int) -> np.ndarray:
    """Return an image between about 0.3 and 3."""
    return np.exp(0.5 * random(*SHAPE, seed=seed))


def _homogeneous(plugin: Regularizer) -> bool:
    return plugin.value(np.zeros(SHAPE)) == 0


def _convex(plugin: Regularizer) -> bool:
    """Say whether no chord between 20 pairs of positive images lies below the value."""
    pairs = [(_positive(seed), _positive(seed + 100)) for seed in range(20)]
    return all(plugin.value((a + b) / 2) <= (plugin.value(a) + plugin.value(b)) / 2 * (1 + ROUNDING) for a, b in pairs)


def _objective(plugin: Regularizer, u: np.ndarray, image: np.ndarray, step: float) -> float:
    return float(((u - image) ** 2).sum() / 2 + step * plugin.value(u))


def _around(point: np.ndarray, image: np.ndarray, seed: int) -> Iterator[np.ndarray]:
    """Yield images near the proximal point and far from it."""
    yield from (image, np.zeros_like(image), np.maximum(image, 0), 0.5 * (point + image), 0.9 * point, 1.1 * point)
    for size in (1.0, 1e-1, 1e-2, 1e-3):
        for trial in range(4):
            change = random(*point.shape, seed=1000 * seed + trial)
            yield point + size * change
            yield point * np.exp(size * change)
            one = np.zeros_like(point)
            one.flat[7 * trial + 3] = size
            yield from (point + one, point - one)


CHECKS = (value, degree, gradient, proximal, moreau, quadratic)
