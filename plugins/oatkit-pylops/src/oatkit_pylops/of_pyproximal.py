"""The plugins that need PyProximal, which itself needs PyLops."""

from oatkit.api import Regularizer, Solver, hookimpl
from oatkit_pylops.required import require

OATKIT_API = (1, 0)


@hookimpl
def oatkit_solvers() -> list[type[Solver]]:
    """Declare the solver of PyProximal."""
    from oatkit_pylops.fista import ProximalFista

    require("pylops")
    require("pyproximal")
    return [ProximalFista]


@hookimpl
def oatkit_regularizers() -> list[type[Regularizer]]:
    """Declare the penalties of PyProximal."""
    from oatkit_pylops.penalties import L1, L21, Nuclear

    require("pylops")
    require("pyproximal")
    return [L1, L21, Nuclear]
