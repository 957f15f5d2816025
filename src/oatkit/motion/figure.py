"""The figure of motion in a scan: how well each pulse fits to those beside it, and which ones do not.

Importing this module needs matplotlib, the extra ``report``.
"""

import numpy as np

from oatkit.drawing.page import Figure
from oatkit.drawing.plot import Curve, Plot
from oatkit.drawing.sheet import sheet
from oatkit.motion import Motion


def motion_figure(motion: Motion) -> Figure:
    """Return the correlation of the pulses in the order in which they were taken; those out of place are marked."""
    time = np.arange(motion.correlation.size)
    moved = motion.moved.ravel()
    curves = [
        Curve("correlation", time, motion.correlation.ravel(), "o-"),
        Curve("below it a pulse is out of place", time, motion.limit.ravel(), "--"),
    ]
    if moved.any():
        curves.append(Curve("out of place", time[moved], motion.correlation.ravel()[moved], "D"))
    plot = Plot(
        f"Compared with other {motion.compared}",
        tuple(curves),
        x_label=f"pulse: frame x {len(motion.wavelengths_nm)} wavelengths",
        y_label="correlation with the pulses beside it",
    )
    title = f"Motion: {int(moved.sum())} of {moved.size} pulses out of place"
    return sheet((), (plot,), title, " · ".join(motion.notes))
