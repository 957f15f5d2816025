"""Motion between pulses: wavelengths are taken one after another, and a breath in between puts some out of place.

A pulse at rest looks like the pulses taken beside it, one out of place does not. How alike two pulses are is the
correlation of their signals, which neither knows nor cares how strong they are.
"""

from oatkit.motion.finding import find_motion
from oatkit.motion.record import Motion

__all__ = ["Motion", "find_motion"]
