"""Spectra and line profiles where the user points."""
