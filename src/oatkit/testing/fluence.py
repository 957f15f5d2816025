"""What a model of light promises: more light where less is absorbed, and none from nowhere.

Bounds leave room for a model that computes with random numbers: 3 % on means over large parts of the body.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from oatkit.api import FluenceModel, Image, Optics
from oatkit.testing.problems import body, boundary_of, slab, tissue
from oatkit.testing.running import difference, refuses

NOISE = 0.03
MU_A = (50.0, 5.0, 400.0)
"""At three wavelengths, 1/m; neither rising nor falling."""


@lru_cache(maxsize=8)
def light_in(plugin: FluenceModel, boundary: Image, optics: Optics) -> Image:
    """Return what a model says; several checks ask the same, which may take long."""
    return plugin.fluence(boundary, optics)


def form_of_image(plugin: FluenceModel) -> Iterator[str]:
    """It returns ``fluence`` on the grid of the boundary at the wavelengths of the optics, finite and not negative."""
    boundary, optics = body(), tissue(MU_A)
    found = light_in(plugin, boundary, optics)
    if not isinstance(found, Image) or found.grid != boundary.grid or found.quantity != "fluence":
        yield "it returns no image 'fluence' on the grid of the boundary"
    elif found.wavelengths_nm != optics.wavelengths_nm:
        yield f"its wavelengths are {found.wavelengths_nm}, not {optics.wavelengths_nm}"
    elif not (np.isfinite(found.values).all() and (found.values >= 0).all()):
        yield "there are pixels that are negative or not finite"


def absorption(plugin: FluenceModel) -> Iterator[str]:
    """The more the body absorbs the less light is in it, each wavelength by its own mu_a."""
    boundary = body()
    inside = boundary.values[0] < 0
    means = light_in(plugin, boundary, tissue(MU_A)).values[:, inside].mean(axis=1)
    order = np.argsort(MU_A)
    if not (np.diff(means[order]) < 0).all():
        told = ", ".join(f"{mean:.3g} at mu_a = {mu_a:g}/m" for mean, mu_a in zip(means, MU_A, strict=True))
        yield f"the mean light in the body does not fall with absorption: {told}"


def depth(plugin: FluenceModel) -> Iterator[str]:
    """Light falls with depth in an absorbing body, by a tenth or more from the wall to the middle."""
    boundary = body()
    distance = boundary.values[0]
    light = light_in(plugin, boundary, tissue(MU_A)).values[0]
    shells = [
        light[(distance < -near) & (distance >= -far)].mean()
        for near, far in ((5e-4, 2e-3), (2.5e-3, 4e-3), (5e-3, 8e-3))
    ]
    if not (shells[0] > shells[1] > shells[2] and shells[2] <= 0.9 * shells[0]):
        yield f"the mean light in shells of growing depth is {', '.join(f'{shell:.3g}' for shell in shells)}"


def energy(plugin: FluenceModel) -> Iterator[str]:
    """The body absorbs no more than falls onto it: the sum of mu_a times fluence is at most the length of its wall.

    Fluence is relative to the incident one, and a fluence of 1 brings at most the power 1 to each m of wall.
    """
    boundary = body()
    inside = boundary.values[0] < 0
    light = light_in(plugin, boundary, tissue(MU_A)).values
    for mu_a, plane in zip(MU_A, light, strict=True):
        absorbed = mu_a * float(plane[inside].sum()) * boundary.grid.pixel_size_m**2
        fallen = 2 * np.pi * 8e-3
        if not absorbed <= fallen * (1 + NOISE):
            yield f"at mu_a = {mu_a:g}/m the body absorbs {absorbed / fallen:.2f} times what can fall onto it"


def slab_between_walls(plugin: FluenceModel) -> Iterator[str]:
    """Between two straight walls light is the same on both sides, is the same all along, and falls to the middle."""
    boundary = slab()
    inside = boundary.values[0, :, 0] < 0
    # The columns next to the edge of the field of view see what lies beyond it.
    light = light_in(plugin, boundary, tissue((80.0,))).values[0][inside, 6:-6]
    rows = light.mean(axis=1)
    if not difference(rows[::-1], rows) <= NOISE:
        yield f"the two sides differ by {difference(rows[::-1], rows):.1%}"
    halves = light[:, : light.shape[1] // 2].mean(), light[:, light.shape[1] // 2 :].mean()
    if not abs(halves[0] / halves[1] - 1) <= NOISE:
        yield f"light differs by {abs(halves[0] / halves[1] - 1):.1%} from one half along the walls to the other"
    thirds = [part.mean() for part in np.array_split(rows[: (len(rows) + 1) // 2], 3)]
    if not thirds[0] > thirds[1] > thirds[2]:
        yield f"from the wall to the middle the mean light is {', '.join(f'{third:.3g}' for third in thirds)}"


def images_of_optics(plugin: FluenceModel) -> Iterator[str]:
    """Optics given as images of equal pixels give the light of the same numbers."""
    boundary, optics = body(), tissue(MU_A[:1])
    planes = np.ones((1, *boundary.grid.shape))
    pictured = Optics(
        optics.wavelengths_nm,
        optics.absorption_per_m[:, None, None] * planes,
        optics.reduced_scattering_per_m[:, None, None] * planes,
    )
    inside = boundary.values[0] < 0
    one = light_in(plugin, boundary, tissue(MU_A)).values[0, inside].mean()
    other = light_in(plugin, boundary, pictured).values[0, inside].mean()
    if not abs(other / one - 1) <= NOISE:
        yield f"mu_a and mu_s' as images change the mean light by {abs(other / one - 1):.1%}"


def place(plugin: FluenceModel) -> Iterator[str]:
    """A body moved together with its grid has the same light, and the outline counts, not the grid."""
    boundary, optics = body(), tissue(MU_A[:1])
    light = light_in(plugin, boundary, tissue(MU_A)).values[0]
    moved = replace(boundary, grid=replace(boundary.grid, centre_m=(3e-3, -2e-3)))
    inside = boundary.values[0] < 0
    ratio = light_in(plugin, moved, optics).values[0, inside].mean() / light[inside].mean()
    if not abs(ratio - 1) <= NOISE:
        yield f"moved with its grid the body has {ratio:.3f} times the light"
    core = np.hypot(boundary.grid.y_m[:, None], boundary.grid.x_m) < 2e-3
    shallow, deep = light_in(plugin, body(radius_m=4e-3), optics).values[0, core].mean(), light[core].mean()
    if not shallow > deep:
        yield f"the middle of a small body gets {shallow:.3g}, not more than that of a large one, {deep:.3g}"


def no_body(plugin: FluenceModel) -> Iterator[str]:
    """Where no pixel lies inside of the boundary, or it is no distance, an error of oatkit's says so."""
    grid = body().grid
    for name, values in (("a boundary without a body", np.ones(grid.shape)), ("NaN", np.full(grid.shape, np.nan))):
        if not refuses(partial(plugin.fluence, boundary_of(values, grid), tissue((50.0,)))):
            yield f"it takes {name}; raise SolverError or ValidationError"


CHECKS = (form_of_image, absorption, depth, energy, slab_between_walls, images_of_optics, place, no_body)
