"""What is looked at: wavelength, results side by side, chromophores."""
