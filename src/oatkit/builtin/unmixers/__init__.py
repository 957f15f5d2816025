"""Unmixers: from many wavelengths to chromophores."""
