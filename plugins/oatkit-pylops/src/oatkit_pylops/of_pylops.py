"""The plugins that need PyLops only."""

from oatkit.api import Solver, hookimpl
from oatkit_pylops.required import require

OATKIT_API = (1, 0)


@hookimpl
def oatkit_solvers() -> list[type[Solver]]:
    """Declare the solvers of PyLops."""
    from oatkit_pylops.lsqr import PylopsLsqr
    from oatkit_pylops.split_bregman import SplitBregman

    require("pylops")
    return [PylopsLsqr, SplitBregman]
