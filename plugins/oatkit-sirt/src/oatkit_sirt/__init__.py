"""The solver 'sirt', for oatkit."""

from oatkit.api import Solver, hookimpl

OATKIT_API = (1, 0)


@hookimpl
def oatkit_solvers() -> list[type[Solver]]:
    """Declare the solver."""
    from oatkit_sirt.plugin import Sirt

    return [Sirt]
