"""What a forward model promises: an exact adjoint, and signals that come when and from where they should."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from oatkit.api import Detectors, ForwardModel, Geometry, Grid, ValidationError
from oatkit.simulate import arc_detectors
from oatkit.testing.problems import random
from oatkit.testing.running import difference, refuses, rounding

GEOMETRY = Geometry(arc_detectors(9, 0.03, 270.0), 10e6, 320, 0.0, 1500.0)
GRID = Grid((20, 17), 3e-4, (5e-4, -8e-4))
RESPONSE = np.array([0.5, 0.0, 1.0, -0.25, 0.1])
"""Of no symmetry, its time zero at index 2."""
MODEL = 1e-2
"""To which two ways to the same signals must agree where a model may interpolate otherwise."""


def operator(plugin: ForwardModel) -> Iterator[str]:
    """The operator maps images (y, x) to records (detector, sample), real and finite, and leaves its input alone."""
    made = plugin.operator(GEOMETRY, GRID)
    expected = (GEOMETRY.shape[0] * GEOMETRY.shape[1], GRID.shape[0] * GRID.shape[1])
    if tuple(made.shape) != expected:
        yield f"its shape is {tuple(made.shape)}, not {expected}"
        return
    for name, apply, size in (("matvec", made.matvec, expected[1]), ("rmatvec", made.rmatvec, expected[0])):
        given = random(size)
        before = given.copy()
        product = np.asarray(apply(given))
        if product.dtype.kind != "f" or not np.isfinite(product).all():
            yield f"{name} returns {product.dtype} with {(~np.isfinite(product)).sum()} values that are not finite"
        if not np.array_equal(given, before):
            yield f"{name} changes its argument"
        if not np.array_equal(product, apply(given)):
            yield f"{name} returns something else when it is called again"
    if not np.any(made.matvec(random(expected[1]))):
        yield "the signals of a random image are zero"


def adjoint(plugin: ForwardModel) -> Iterator[str]:
    """<A x, y> equals <x, A^T y> to rounding, with and without an impulse response and at both ends of the record."""
    cut = replace(GEOMETRY, start_time_s=19e-6, n_samples=20)
    for name, geometry in (
        ("", GEOMETRY),
        (" with an impulse response", replace(GEOMETRY, impulse_response=RESPONSE)),
        (" where the record begins and ends in the signals", cut),
    ):
        made = plugin.operator(geometry, GRID)
        for seed in range(3):
            x, y = random(made.shape[1], seed=seed), random(made.shape[0], seed=seed + 10)
            forward, back = np.asarray(made.matvec(x)), np.asarray(made.rmatvec(y))
            left, right = float(forward.astype(float) @ y), float(x @ back.astype(float))
            size = float(np.linalg.norm(forward.astype(float)) * np.linalg.norm(y))
            if not abs(left - right) <= max(rounding(forward.dtype), rounding(back.dtype)) * size:
                yield f"<A x, y> is {left:.12g} and <x, A^T y> is {right:.12g}{name}"
                break


def linearity(plugin: ForwardModel) -> Iterator[str]:
    """A (2 x - 3 y) is 2 A x - 3 A y to rounding."""
    made = plugin.operator(GEOMETRY, GRID)
    x, y = random(made.shape[1]), random(made.shape[1], seed=1)
    parts = 2 * np.asarray(made.matvec(x), float) - 3 * np.asarray(made.matvec(y), float)
    error = difference(made.matvec(2 * x - 3 * y), parts)
    if not error <= 10 * rounding(made.matvec(x).dtype):
        yield f"A (2 x - 3 y) differs from 2 A x - 3 A y by {error:.1e} of it"


def translation(plugin: ForwardModel) -> Iterator[str]:
    """Nothing depends on the origin: moved together, detectors and grid, or detectors and image, give equal signals."""
    h = GRID.pixel_size_m
    image = np.zeros(GRID.shape)
    image[3:-3, 3:-3] = random(GRID.shape[0] - 6, GRID.shape[1] - 6)
    signals = _signals(plugin, GEOMETRY, GRID, image)
    shift = np.array([7e-4, -4e-4])
    grid = replace(GRID, centre_m=tuple(np.add(GRID.centre_m, shift)))
    error = difference(_signals(plugin, _moved(shift), grid, image), signals)
    if not error <= MODEL:
        yield f"detectors and grid moved together change the signals by {error:.1e}"
    for axis, name in enumerate("yx"):
        step = h * np.eye(2)[axis]
        error = difference(_signals(plugin, _moved(step), GRID, np.roll(image, 1, axis)), signals)
        if not error <= MODEL:
            yield f"detectors and image moved by a pixel along {name} change the signals by {error:.1e}"


def arrival(plugin: ForwardModel) -> Iterator[str]:
    """A pixel is heard loudest at its time of flight to within two pixels, and not before it can be heard."""
    h, c = GRID.pixel_size_m, GEOMETRY.speed_of_sound_m_s
    for row, column in ((4, 13), (16, 3)):
        image = np.zeros(GRID.shape)
        image[row, column] = 1.0
        signals = np.abs(_signals(plugin, GEOMETRY, GRID, image))
        distance = np.hypot(*(GEOMETRY.detectors.positions_m - (GRID.y_m[row], GRID.x_m[column])).T)
        late = c * GEOMETRY.times_s[signals.argmax(axis=1)] - distance
        if not np.abs(late).max() <= 2 * h:
            worst = late[np.abs(late).argmax()]
            yield (
                f"pixel (row {row}, column {column}) is loudest {1e3 * worst:.3g} mm of sound from its time of flight; "
                "row 0 is at the bottom, axes are (y, x), time is that of one way"
            )
        early = c * GEOMETRY.times_s < distance[:, None] - 20 * h
        before = np.where(early, signals, 0).max(axis=1) / signals.max(axis=1)
        if not before.max() <= MODEL:
            yield f"it is heard with {before.max():.1e} of its loudness 20 pixels before its sound arrives"


def record(plugin: ForwardModel) -> Iterator[str]:
    """A record that starts later holds the same signals from there on; what no sample reaches is zero."""
    image = random(*GRID.shape)
    signals = _signals(plugin, GEOMETRY, GRID, image)
    later = replace(GEOMETRY, start_time_s=GEOMETRY.times_s[180], n_samples=100)
    error = difference(_signals(plugin, later, GRID, image), signals[:, 180:280])
    if not error <= MODEL:
        yield f"a record that starts 180 samples later differs by {error:.1e} from that part of the whole one"
    near, far = GEOMETRY.reach(GRID)
    margin = 20 * GRID.pixel_size_m
    radii = GEOMETRY.speed_of_sound_m_s * GEOMETRY.times_s
    silent = (radii < near[:, None] - margin) | (radii > far[:, None] + margin)
    outside = np.linalg.norm(signals[silent]) / np.linalg.norm(signals)
    if not outside <= MODEL:
        yield f"{outside:.1e} of the signals lie where no pixel is heard"


def impulse_response(plugin: ForwardModel) -> Iterator[str]:
    """The impulse response of the geometry is convolved into the signals, its time zero at index ``n // 2``."""
    image = random(*GRID.shape)
    ideal = _signals(plugin, GEOMETRY, GRID, image)
    found = _signals(plugin, replace(GEOMETRY, impulse_response=RESPONSE), GRID, image)
    middle = len(RESPONSE) // 2
    expected = np.stack([np.convolve(row, RESPONSE)[middle : middle + len(row)] for row in ideal])
    error = difference(found, expected)
    if not error <= MODEL:
        yield f"signals differ by {error:.1e} from the ideal ones convolved with the impulse response"


def blind(plugin: ForwardModel) -> Iterator[str]:
    """A grid that holds a detector, or that no sample reaches, is refused with a `ValidationError`."""
    wide = Grid((7, 7), 9e-3)
    if not refuses(lambda: plugin.operator(GEOMETRY, wide), ValidationError):
        yield "it takes a grid with detectors inside; call geometry.check_grid(grid)"
    if not refuses(lambda: plugin.operator(replace(GEOMETRY, n_samples=20), GRID), ValidationError):
        yield "it takes a record that ends before any sound arrives; call geometry.check_grid(grid)"


def _signals(plugin: ForwardModel, geometry: Geometry, grid: Grid, image: Any) -> np.ndarray:
    """Return the signals of an image as float64, shape ``(detector, sample)``."""
    return np.asarray(plugin.operator(geometry, grid).matvec(np.ravel(image)), float).reshape(geometry.shape)


def _moved(shift_m: np.ndarray) -> Geometry:
    return replace(GEOMETRY, detectors=Detectors(GEOMETRY.detectors.positions_m + shift_m))


CHECKS = (operator, adjoint, linearity, translation, arrival, record, impulse_response, blind)
