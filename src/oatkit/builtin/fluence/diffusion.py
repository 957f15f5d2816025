"""The diffusion equation on cut cells: the matrix, the light that comes in, and where it goes."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from oatkit.api import Optics
from oatkit.builtin.fluence.body import properties, spread
from oatkit.builtin.fluence.cut_cells import CutCells


@dataclass(frozen=True)
class Medium:
    """What the cells are made of, at one wavelength; each of shape ``(cell,)``."""

    absorption: np.ndarray
    """mu_a, 1/m."""
    scattering: np.ndarray
    """mu_s', 1/m."""
    diffusion: np.ndarray
    """D = 1 / (3 (mu_a + mu_s')), m."""

    @classmethod
    def of(cls, cells: CutCells, optics: Optics, index: int, inside: np.ndarray) -> Self:
        """Take the optics at wavelength number `index`; `inside` is an image of shape ``(y, x)``."""
        images = (np.broadcast_to(spread(v, inside), inside.shape) for v in properties(optics, index, inside))
        absorption, scattering = (image.ravel()[cells.cells] for image in images)
        return cls(absorption, scattering, 1 / (3 * (absorption + scattering)))

    def slowest_decay(self, cells: CutCells) -> float:
        """Return about the smallest eigenvalue of the light: mu_eff^2 of the body, and what its size adds, 1/m^2.

        A disc of radius R with a dark wall adds (2.405 / R)^2, by the first zero of the Bessel function J_0.
        """
        area = cells.volume.sum()
        return float((cells.volume @ (self.absorption / self.diffusion)) / area + 2.405**2 * np.pi / area)


def wall_conductance(cells: CutCells, diffusion: np.ndarray, wall_factor: float) -> np.ndarray:
    """Return what flows through each piece of wall for a unit of g - Phi, shape ``(piece,)``, m.

    Half-way from the centre of the pixel (depth d) to the light behind the wall lies 2 A D of the Robin condition:
    length D / (2 A D + d). Where the centre is outside, d is negative, and the fluence of the cell is that of the
    solution continued to the centre. To keep the matrix positive where pixels are large for the tissue, d is no lower
    than -A D.
    """
    through = wall_factor * diffusion[cells.wall_cell]
    return cells.wall_length * diffusion[cells.wall_cell] / (2 * through + np.maximum(cells.wall_depth, -through))


def diffusion_matrix(cells: CutCells, diffusion: np.ndarray, absorption: np.ndarray, conductance: np.ndarray) -> Any:
    """Return the matrix of -div(D grad Phi) + mu_a Phi over the cells with its walls, symmetric, as CSC, m.

    `diffusion` (m) and `absorption` (1/m) are those of the cells; between two cells, D is the harmonic mean.
    """
    from scipy.sparse import coo_array

    n = len(cells.cells)
    first, second = cells.pairs
    one, two = diffusion[first], diffusion[second]
    through = cells.opening * 2 * one * two / (one + two)
    diagonal = absorption * cells.volume
    for index, flow in ((first, through), (second, through), (cells.wall_cell, conductance)):
        diagonal += np.bincount(index, flow, n)
    every = np.arange(n)
    entries = np.concatenate([diagonal, -through, -through])
    rows, columns = np.concatenate([every, first, second]), np.concatenate([every, second, first])
    return coo_array((entries, (rows, columns)), shape=(n, n)).tocsc()


def factorized(matrix: Any) -> Any:
    """Return a function that solves with a symmetric positive definite matrix."""
    from scipy.sparse.linalg import splu

    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve


def imbalance(
    cells: CutCells, source: np.ndarray, absorption: np.ndarray, conductance: np.ndarray, fluence: np.ndarray
) -> float:
    """Return |in - out - absorbed| / in, with what comes in as the `source` of each cell."""
    out = conductance @ fluence[cells.wall_cell]
    absorbed = (absorption * cells.volume) @ fluence
    total = source.sum()
    return float(abs(total - out - absorbed) / total) if total > 0 else 0.0


def buried(cells: CutCells, light: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """Return what is released in each cell, shape ``(cell,)``, where the light of each piece is released below it.

    Each source is shared between the four pixels around it as in bilinear interpolation; those without a part in the
    body give their share to the others, and a source with none of them stays at its wall. Nothing is lost.
    """
    at = (cells.wall_middle - depth_m[:, None] * cells.wall_normal) / cells.pixel_size
    low = np.floor(at).astype(int)
    high_share = at - low
    targets, shares = [], []
    for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
        y, x = low[:, 0] + dy, low[:, 1] + dx
        on_grid = (y >= 0) & (y < cells.position.shape[0]) & (x >= 0) & (x < cells.position.shape[1])
        target = np.where(on_grid, cells.position[np.where(on_grid, y, 0), np.where(on_grid, x, 0)], -1)
        share = np.where(dy, high_share[:, 0], 1 - high_share[:, 0]) * np.where(
            dx, high_share[:, 1], 1 - high_share[:, 1]
        )
        targets.append(np.where(target < 0, cells.wall_cell, target))
        shares.append(np.where(target < 0, 0, share))
    total = np.sum(shares, axis=0)
    lost = total == 0
    shares[0][lost] = 1
    weights = light * np.array(shares) / np.where(lost, 1, total)
    return np.bincount(np.concatenate(targets), weights.ravel(), len(cells.cells))
