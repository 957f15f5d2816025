"""The bidiagonalisation that LSQR rests on."""

import numpy as np

from oatkit.builtin.solvers.stack import Stack
from oatkit.vectors import norm


class Bidiagonalisation:
    """That of Golub and Kahan, begun with data b [Paige1982]_: beta u = S v - alpha u, alpha v = S^T u - beta v."""

    def __init__(self, stack: Stack, data: np.ndarray, back_projected: np.ndarray) -> None:
        self.stack = stack
        self.beta = norm(data)
        v = stack.undone(back_projected)
        size = norm(v)
        self.u, self.v, self.alpha = stack.with_zeros(data) / self.beta, v / size, size / self.beta
        self.along = 1.0
        """Cosine between v and S^T S v, of the step before."""

    def advance(self) -> None:
        """Take a step, by one application of S and one of S^T."""
        before = self.alpha
        u = self.stack.forward(self.v) - self.alpha * self.u
        self.beta = norm(u)
        self.u = u / self.beta if self.beta > 0 else u
        v = self.stack.adjoint(self.u) - self.beta * self.v
        self.alpha = norm(v)
        self.v = v / self.alpha if self.alpha > 0 else v
        # S^T S v = (before^2 + beta^2) v + beta alpha v', where v' is the new v.
        squares = before**2 + self.beta**2
        self.along = squares / (float(np.hypot(squares, self.beta * self.alpha)) or 1.0)
