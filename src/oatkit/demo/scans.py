"""Scans that are simulated on a finer grid, with what is true of them on the grid of the presets."""

from dataclasses import replace

from oatkit.api import ForwardModel
from oatkit.data import Image, Scan
from oatkit.pipeline import Pipeline
from oatkit.registry import plugin


def simulated(phantom: str, snr_db: float, seed: int, frames: int = 1) -> tuple[Scan, Image]:
    """Return a scan of a phantom, and its initial pressure."""
    from oatkit.simulate import simulate_scan, truth

    scan = simulate_scan(phantom, _arc(), snr_db=snr_db, frames=frames, seed=seed)
    return scan, truth(phantom, Pipeline.load("maxent").grid.grid())


def simulated_oxygen(snr_db: float, seed: int, frames: int = 1) -> tuple[Scan, list[Image]]:
    """Return a scan of a drawn body, and its initial pressure, so2 and total haemoglobin."""
    from oatkit.simulate import OxygenBody, illuminate, oxygen_phantom, simulate_scan

    body, grid = OxygenBody.draw(seed), Pipeline.load("multispectral").grid.grid()
    lit = illuminate(body)  # by far the longest part, so once for signals and truth
    scan = simulate_scan(oxygen_phantom(lit), _arc(), snr_db=snr_db, frames=frames, seed=seed)
    note = f"the body of seed {seed} in water that takes no light, p0 = mu_a Phi in units of 1/m"
    scan = replace(scan, notes=(*scan.notes, note))
    return scan, [lit.pressure(grid), body.so2(grid), body.total_haemoglobin(grid)]


def _arc() -> ForwardModel:
    arc = plugin("forward_model", "arc")()
    assert isinstance(arc, ForwardModel)
    return arc
