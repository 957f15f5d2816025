"""Coarse images in a moment: of a scan just opened, and while a parameter moves."""
