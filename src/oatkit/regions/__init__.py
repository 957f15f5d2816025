"""Regions of interest: their shapes, the files they come from, and the numbers of what lies in them."""

from oatkit.regions.files import load_regions, save_regions
from oatkit.regions.table import RegionOf, RegionRow, region_rows, region_table, write_csv
from oatkit.shapes import EllipseRegion, MaskRegion, PolygonRegion, RectangleRegion, Region, core, rim

__all__ = [
    "EllipseRegion", "MaskRegion", "PolygonRegion", "RectangleRegion", "Region", "RegionOf", "RegionRow", "core",
    "load_regions", "region_rows", "region_table", "rim", "save_regions", "write_csv",
]  # fmt: skip
