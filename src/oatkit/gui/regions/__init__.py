"""Regions of interest and the boundary, drawn by hand."""
