"""Change over time: between two states (a gas challenge), and after the arrival of a contrast agent.

Frames are read one after another. Their order is that of their times; a result that does not know them is ordered by
the numbers of its frames in the scan, and the unit of time is then one frame.
"""

from oatkit.kinetics.curves import RegionCurve, curve_text, curves_csv, region_curves
from oatkit.kinetics.maps import contrast_kinetics, gas_challenge

__all__ = ["RegionCurve", "contrast_kinetics", "curve_text", "curves_csv", "gas_challenge", "region_curves"]
