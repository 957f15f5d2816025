"""Optoacoustic tomography: from a scan to non-negative images, by plugins."""

__version__ = "0.1.0"
