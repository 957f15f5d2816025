"""The default acoustic model: matrix-free, exact within its band."""

from typing import Any, ClassVar, Literal

from oatkit.api import ForwardModel, Geometry, Grid, param


class Arc(ForwardModel):
    r"""Integrals over circular arcs, computed without a matrix.

    .. math:: p(t) = \left. \frac{dI}{dR} \right|_{R = ct}, \qquad I(R) = \frac{1}{R} \int_{|r - r_d| = R} H(r) \, dl

    with lengths in m and without the factor 1 / (4 pi). This is the wave of a thin slab in the image plane in three
    dimensions, not the solution of the wave equation in two.

    Each pixel is band-limited: its spectrum is 1 up to 0.4 and falls as a cosine to 0 at 0.6 cycles per pixel, and ends
    below half the sampling rate. The impulse response of the geometry is part of the operator.
    """

    name: ClassVar[str] = "arc"
    precision: Literal["single", "double"] = param("single", "floating-point numbers of the computation")

    def operator(self, geometry: Geometry, grid: Grid) -> Any:
        """Return the operator, its adjoint exact to rounding; equal to the last bit for any number of threads."""
        geometry.check_grid(grid)
        from scipy.sparse.linalg import LinearOperator

        from oatkit.builtin.forward.arc_operator import ArcOperator

        arcs = ArcOperator(geometry, grid, {"single": "float32", "double": "float64"}[self.precision])
        return LinearOperator(arcs.shape, matvec=arcs.forward, rmatvec=arcs.adjoint, dtype=arcs.dtype)
