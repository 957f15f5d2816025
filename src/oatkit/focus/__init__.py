r"""Speed of sound by focus: the one that gives the sharpest image, after [Treeby2011]_ (see `oatkit.focus.metrics`).

The image is the back-projection A^T b of the pipeline's own forward model: one product for each speed that is tried. A
speed that is wrong by dc shifts each wave front by

.. math:: R \, \frac{dc}{c}, \qquad R \text{ the distance of the detectors,}

so the sweep goes in steps of half a pixel of that shift, and then more finely about the maximum. One speed holds for
water and body together, and a start time that is wrong by dt moves the pick by c^2 dt / R.
"""

from oatkit.focus.choice import Focus
from oatkit.focus.sweep import focus

__all__ = ["Focus", "focus"]
