"""Figures by matplotlib: a page, curves on it, and sheets of pictures and curves."""
