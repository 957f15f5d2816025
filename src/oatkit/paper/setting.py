"""How large an experiment is: what the paper's has, unless a test or a hurried user asks for less."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from oatkit.data import Grid


@dataclass(frozen=True)
class Setting:
    """Sizes, noise and seeds of an experiment; the same setting gives the same numbers."""

    pixels: int = 200
    """Of the reconstruction, along each side."""
    fine_pixels: int = 541
    """Of the grid that the data are simulated on; prime, so that it is no multiple of the other."""
    field_of_view_mm: float = 20.0
    detectors: int = 256
    coverage_deg: float = 270.0
    snr_db: float = 32.0
    """Over the samples that the field of view can reach."""
    seed: int = 0
    """Of the noise."""
    seeds: int = 5
    """How many seeds of the noise the ranking averages over."""
    bodies: tuple[str, ...] = ("breast", "star", "disc", "mouse", "vessel")
    """Those of the ranking."""
    wavelengths_nm: tuple[float, ...] = tuple(range(680, 901, 20))
    """Those of fig7, the paper's; the other experiments have one."""
    per_decade: int = 2
    """How many weights are tried in each decade of a method's range."""
    scan: Path | None = None
    """A real scan, for the experiments on mice; without it they simulate one."""

    @cached_property
    def grid(self) -> Grid:
        """The grid of the reconstruction."""
        return Grid((self.pixels, self.pixels), self.field_of_view_mm * 1e-3 / self.pixels)

    def words(self) -> str:
        """Say what was simulated, for a caption."""
        return (
            f"simulated on {self.fine_pixels}², reconstructed on {self.pixels}² pixels over {self.field_of_view_mm:g} "
            f"mm; {self.detectors} detectors on {self.coverage_deg:g}°; SNR {self.snr_db:g} dB over the samples that "
            f"the field of view can reach, seed {self.seed}"
        )
