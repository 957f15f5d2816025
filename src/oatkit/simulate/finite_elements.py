"""Diffuse light in a star-shaped body by finite elements, to simulate with.

What corrects a scan for its light must not have made it: nothing here is shared with the models of light that
pipelines use, neither mesh, nor method, nor the number of terms of the lit band.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from oatkit.content import check_range
from oatkit.errors import SolverError, ValidationError
from oatkit.simulate.polar_mesh import PolarMesh

WALL_FACTOR = 1.167158365
"""A = (1 + R_eff) / (1 - R_eff) of a body of index 1.4 in water of 1.33, from the Fresnel integrals of Haskell et al.,
J. Opt. Soc. Am. A 11, 2727 (1994)."""
FEW_TERMS = 8
"""So many terms are solved one by one; of more, those between some snapshots are expanded in them."""
PER_OCTAVE = 2
"""Snapshots per factor of two in the wave number."""
LARGEST_RESIDUAL = 1e-4
"""Of a term expanded in the snapshots, relative to the light that comes in."""


@dataclass(frozen=True)
class Band:
    """The light falls on a band around the body, repeated along z, and is a Fourier series in z."""

    width_m: float = 8e-3
    period_m: float = 80e-3
    n_terms: int = 24

    def __post_init__(self) -> None:
        check_range("band period_m", self.period_m, 1e-4, 10.0, "the unit is m, so 80 mm is 0.08")
        check_range("band width_m", self.width_m, 1e-5, self.period_m, "the unit is m, and a period is the limit")
        check_range("band n_terms", self.n_terms, 2, 10_000, "terms of the series, the constant one counted")

    @property
    def wave_numbers_per_m(self) -> np.ndarray:
        """2 pi n / L, shape ``(term,)``, 1/m."""
        return 2 * np.pi * np.arange(self.n_terms) / self.period_m

    @property
    def weights(self) -> np.ndarray:
        """Share of each term in the fluence at z = 0, shape ``(term,)``; they sum up to 1.

        W / L, then 2 sin(pi n W / L) / (pi n); what the terms left out would add goes to the last one.
        """
        n = np.arange(1, self.n_terms)
        share = self.width_m / self.period_m
        weights = np.concatenate([[share], 2 * np.sin(np.pi * n * share) / (np.pi * n)])
        weights[-1] += 1 - weights.sum()
        return weights


def diffuse_light(
    mesh: PolarMesh,
    absorption_per_m: np.ndarray,
    reduced_scattering_per_m: np.ndarray,
    band: Band | None = None,
    wall_factor: float = WALL_FACTOR,
) -> np.ndarray:
    r"""Return the fluence in the middle plane, relative to the incident one, at the nodes, shape ``(node,)``.

    .. math::
        -\nabla \cdot D \nabla \Phi + (\mu_a + D k^2) \Phi = 0, \quad D = \frac{1}{3 (\mu_a + \mu_s')}, \qquad
        \Phi + 2 A D \, \partial \Phi / \partial n = 1

    with linear elements. `absorption_per_m` and `reduced_scattering_per_m` are the means over each triangle, shape
    ``(triangle,)``: D of the means is the harmonic mean of D. Without a `band` the light falls on all of z, k = 0.
    With one, the fluence is the sum of its terms. Of many, only those at a few wave numbers are solved for; the others
    are the combinations of these that are best in energy (Galerkin), and their residuals are checked.

    Raises `ValidationError` for properties that are not those of a medium, `SolverError` where a residual is above
    `LARGEST_RESIDUAL`.
    """
    plane, along = matrices(mesh, absorption_per_m, reduced_scattering_per_m, wall_factor)
    source = incoming(mesh, wall_factor)
    if band is None:
        return _solved(plane, source)
    return _series(plane, along, source, band)


def matrices(
    mesh: PolarMesh, absorption_per_m: np.ndarray, reduced_scattering_per_m: np.ndarray, wall_factor: float
) -> tuple[Any, Any]:
    """Return the matrix for k = 0 and the one that k^2 multiplies, both symmetric CSC, m and m3.

    Raises `ValidationError` where a property is negative or not finite, or both are zero.
    """
    total = _checked(mesh, absorption_per_m) + _checked(mesh, reduced_scattering_per_m)
    if not (total > 0).all():
        raise ValidationError("light: mu_a and mu_s' are both 0 1/m in a triangle, where diffusion has no meaning")
    diffusion = 1 / (3 * total)
    inside = diffusion[:, None, None] * stiffness(mesh) + absorption_per_m[:, None, None] * mass(mesh)
    along_wall = wall_lengths(mesh)[:, None, None] * (1 + np.eye(2)) / 6 / (2 * wall_factor)
    plane = _assembled(mesh, (mesh.triangles, inside), (mesh.wall, along_wall))
    return plane, _assembled(mesh, (mesh.triangles, diffusion[:, None, None] * mass(mesh)))


def incoming(mesh: PolarMesh, wall_factor: float) -> np.ndarray:
    """Return the light that comes in at each node, shape ``(node,)``, m; its sum is the wall over 2 A."""
    halves = np.repeat(wall_lengths(mesh) / 2, 2) / (2 * wall_factor)
    return np.bincount(mesh.wall.ravel(), halves, len(mesh.points_m))


def stiffness(mesh: PolarMesh) -> np.ndarray:
    """Return the integrals of products of the gradients of the hat functions, shape ``(triangle, 3, 3)``."""
    products = np.einsum("tid,tjd->tij", mesh.sides_m, mesh.sides_m)
    return products / (4 * mesh.areas_m2)[:, None, None]


def mass(mesh: PolarMesh) -> np.ndarray:
    """Return the integrals of products of the hat functions, shape ``(triangle, 3, 3)``, m2."""
    return mesh.areas_m2[:, None, None] / 12 * (1 + np.eye(3))


def wall_lengths(mesh: PolarMesh) -> np.ndarray:
    """Return the length of each side on the wall, shape ``(side,)``, m."""
    start, end = mesh.points_m[mesh.wall].transpose(1, 0, 2)
    return np.hypot(*(end - start).T)


def _checked(mesh: PolarMesh, values: np.ndarray) -> np.ndarray:
    if values.shape != mesh.areas_m2.shape:
        raise ValidationError(f"light: expected one value for each of {len(mesh.areas_m2)} triangles")
    check_range("mu_a and mu_s'", values, 0.0, 1e7, "the unit is 1/m, so 1 per cm is 100")
    return values


def _assembled(mesh: PolarMesh, *parts: tuple[np.ndarray, np.ndarray]) -> Any:
    """Return the matrix over the nodes that sums up small ones, each part: nodes (n, m), matrices (n, m, m)."""
    from scipy.sparse import coo_array

    rows, columns, entries = (
        np.concatenate(pieces)
        for pieces in zip(
            *(
                (np.repeat(nodes, nodes.shape[1], axis=1).ravel(), np.tile(nodes, nodes.shape[1]).ravel(), m.ravel())
                for nodes, m in parts
            ),
            strict=True,
        )
    )
    n = len(mesh.points_m)
    return coo_array((entries, (rows, columns)), shape=(n, n)).tocsc()


def _solved(matrix: Any, source: np.ndarray) -> np.ndarray:
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve(source)


def _series(plane: Any, along: Any, source: np.ndarray, band: Band) -> np.ndarray:
    """Return the sum of the terms of the band."""
    basis = np.linalg.qr(np.column_stack([_solved(plane + k**2 * along, source) for k in snapshots(band)]))[0]
    in_plane, in_z = plane @ basis, along @ basis
    total, worst = np.zeros(basis.shape[1]), 0.0
    for k, weight in zip(band.wave_numbers_per_m, band.weights, strict=True):
        image = in_plane + k**2 * in_z
        term = np.linalg.solve(basis.T @ image, basis.T @ source)
        worst = max(worst, float(np.linalg.norm(image @ term - source)))
        total += weight * term
    worst /= float(np.linalg.norm(source))
    if not worst <= LARGEST_RESIDUAL:
        raise SolverError(f"light: a term of the lit band has a relative residual of {worst:.1e}; narrow the band")
    return basis @ total


def snapshots(band: Band) -> np.ndarray:
    """Return the wave numbers to solve for, 1/m: all of a few, else 0 and some, evenly in ratio, from the second on."""
    wave_numbers = band.wave_numbers_per_m
    if len(wave_numbers) <= FEW_TERMS:
        return wave_numbers
    first, last = wave_numbers[[2, -1]]
    return np.concatenate([[0.0], np.geomspace(first, last, 1 + round(PER_OCTAVE * np.log2(last / first)))])
