"""The experiments by name; the list is free of what it takes to run them."""

from collections.abc import Mapping

EXPERIMENTS: Mapping[str, str] = {
    "fig1": "a breast-like body in diffuse light: least squares, thresholded and not, and maximum entropy",
    "fig2": "the star phantom before and after the correction for the fluence, with profiles",
    "fig3": "L-curves, and where rules see their corners",
    "fig4": "what the start of the iteration does",
    "fig5": "the whole chain on a mouse: outline, light, pressure, absorption",
    "fig6": "absorption in the Fourier domain",
    "fig7": "spectra of two regions, and where least squares turns them negative",
    "figS1": "maximum entropy over the range of its weight",
    "figS2": "L1 penalties beside least squares and maximum entropy",
    "table1": "sharpness and the number of non-negative pixels",
    "ranking": "not in the paper: all solvers, five bodies, five seeds, limited view, few detectors, noise (long)",
}
"""What each experiment shows, by name; each is the function of that name in the module of that name."""
