"""Light in the body by Monte Carlo photon transport."""

from oatkit.api import FluenceModel, hookimpl

OATKIT_API = (1, 0)


@hookimpl
def oatkit_fluence_models() -> list[type[FluenceModel]]:
    """Return the fluence model of this package."""
    from oatkit_montecarlo.model import MonteCarlo

    return [MonteCarlo]
