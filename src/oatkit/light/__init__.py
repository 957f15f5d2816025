"""Light and absorption that belong together: what the body absorbs dims the light by which it is seen."""

from oatkit.light.coarse import CoarseLight
from oatkit.light.passes import Passes, Settled
from oatkit.light.plausible import implausible

__all__ = ["CoarseLight", "Passes", "Settled", "implausible"]
