"""The second half of the demo: oxygen in a body that dims its own light, as it is, as it looks, and corrected."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from oatkit.api import ForwardModel, Unmixer, UnmixProblem
from oatkit.data import Image
from oatkit.engine import run
from oatkit.pipeline import Pipeline
from oatkit.registry import plugin
from oatkit.simulate import OxygenBody, illuminate, oxygen_phantom, simulate_scan

WAVELENGTHS_NM = (700.0, 740.0, 760.0, 800.0, 850.0, 900.0)
SNR_DB = 32.0
SPACING_M = 0.16e-3
"""Of the mesh of the light that is simulated."""
SIMULATED_PIXELS = 331
CHANGES = ("grid.pixels=120", "preprocess.band-pass.high=3", "unmix.probe=0", "fluence.ring_radius=")
"""What makes the preset fast: pixels of 0.2 mm, and no sensitivities; and clear water, as it is simulated."""
DEEP_M = 3e-3
MARGIN_M = 1e-4
"""How far within its wall a vessel is looked at."""
WHAT = (
    "a body of 20 mm with seven vessels under a band of light of 8 mm, dimmed by the body's own absorption (finite "
    f"elements); 6 wavelengths, SNR {SNR_DB:g} dB; so2 is undefined where there is next to no blood"
)


def oxygen_files(folder: Path) -> tuple[Path, Path]:
    """Return what is written: a figure and a result."""
    return folder / "oxygen.png", folder / "oxygen.zarr"


def run_oxygen_demo(folder: Path, overwrite: bool) -> Iterator[str]:
    """Simulate, unmix without and with the light, and write a figure and a result; yield a line for each thing done."""
    from oatkit.figure import write_comparison  # matplotlib

    figure, saved = oxygen_files(folder)
    yield "simulating a body with vessels of known oxygen saturation at 6 wavelengths ..."
    body = OxygenBody.draw(0)
    lit = illuminate(body, WAVELENGTHS_NM, spacing_m=SPACING_M)
    arc = plugin("forward_model", "arc")()
    assert isinstance(arc, ForwardModel)
    scan = simulate_scan(oxygen_phantom(lit), arc, pixels=SIMULATED_PIXELS, snr_db=SNR_DB, seed=0)
    result = run(Pipeline.load("multispectral", CHANGES), scan)
    raw = _as_it_looks(result["initial_pressure"], result.pipeline["unmix"]["chromophores"])
    truth = body.so2(result["so2"].grid)
    panels: list[tuple[str, Image, list[str]]] = [("so2, truth", truth, ["seven vessels"])]
    for name, images in (("unmixed without the light", raw), ("multispectral", result)):
        error = deep_error(body, images)
        panels.append((name, images["so2"], [f"deep vessels wrong by {error:.3f}"]))
        yield f"{name}: saturation of vessels below 3 mm wrong by {error:.3f} on average"
    result.save(saved, overwrite=overwrite)
    yield f"wrote {saved}"
    write_comparison(figure, panels, "Oxygen saturation of one simulated scan", WHAT, overwrite)
    yield f"wrote {figure}"


def deep_error(body: OxygenBody, images: Mapping[str, Image]) -> float:
    """Return the mean of |so2 - truth| over the vessels whose centre is deeper than `DEEP_M`.

    so2 of a vessel is that of the mean concentrations over its pixels.
    """
    errors = []
    for vessel in body.vessels:
        mask = vessel.region(MARGIN_M).mask(images["so2"].grid)
        oxy, total = (float(images[name].values[0][mask].mean()) for name in ("oxyhaemoglobin", "total_haemoglobin"))
        if body.depth_m(vessel.centre_m) > DEEP_M:
            errors.append(abs(oxy / total - vessel.tissue.oxygen_saturation))
    return float(np.mean(errors))


def _as_it_looks(pressure: Image, chromophores: list[str]) -> Mapping[str, Image]:
    """Return what unmixing gives that knows nothing of light."""
    nnls = plugin("unmixer", "nnls")(chromophores=tuple(chromophores))
    assert isinstance(nnls, Unmixer)
    return nnls.unmix(UnmixProblem(pressure))
