"""How near oxygen saturations of vessels come to the truth, by reconstruction and by unmixing; prints a Markdown table.

    python benchmarks/oxygen.py
    python benchmarks/oxygen.py --quick

Bodies of `OxygenBody.draw`, each lit by itself (finite elements, a band of 8 mm, clear water), 12 wavelengths. The
saturation of a vessel is its mean oxyhaemoglobin over its mean total haemoglobin, without its outer 0.1 mm; deep is
more than 3 mm below the surface. Errors are absolute, over the vessels of all bodies. K is 1 in truth.
"""

import argparse
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

import oatkit
from fluence import cpu_model
from oatkit import Memo, Pipeline, Result, Scan
from oatkit.data import Grid, Image
from oatkit.simulate import Inclusion, OxygenBody, illuminate, oxygen_phantom, simulate_scan
from oatkit.spectra import tissue_optics
from oatkit.spectra.optics import COLUMNS
from oatkit.tables import AbsorptionTable
from oatkit.threads import thread_count

SEEDS, NOISE_DB = (0, 1, 2), (32.0, 10.0)
RECONSTRUCTIONS = {"lsqr-threshold": "lsqr-threshold", "maxent": "maxent-nlcg", "tv": "tv"}
ERODED_M, DEEP_M = 0.1e-3, 3e-3
WRONG_SCATTERING = {"K by the spectra, mu_s' 20 % too low": 0.8, "K by the spectra, mu_s' 20 % too high": 1.2}
HEADING = (
    "SNR, dB", "reconstruction", "unmixed", "deep: mean error", "largest", "mean with sign", "shallow: mean error",
    "K used", "ran away",
)  # fmt: skip


@dataclass(frozen=True)
class Found:
    """What one run says of the vessels of one body."""

    deep: np.ndarray
    """Saturation minus truth of each deep vessel."""
    shallow: np.ndarray
    calibration: float | None
    """K that the unmixer used; the true one is 1."""
    diverged: bool


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="seed 0 at 32 dB, without tv and without wrong mu_s'")
    quick = parser.parse_args().quick
    seeds, noise_db = (SEEDS[:1], NOISE_DB[:1]) if quick else (SEEDS, NOISE_DB)
    start = perf_counter()
    found: dict[tuple[float, str, str], list[Found]] = {}
    for seed in seeds:
        for snr_db, body, scan in scans(seed, noise_db):
            for name, way, one in runs(body, scan, quick):
                found.setdefault((snr_db, name, way), []).append(one)
                print(f"{perf_counter() - start:5.0f} s, seed {seed} {row(snr_db, name, way, [one])}", file=sys.stderr)
    seconds = perf_counter() - start
    print(f"{cpu_model()}, {os.cpu_count()} cores, {thread_count()} threads, {seconds:.0f} s, bodies {seeds}\n")
    print(f"| {' | '.join(HEADING)} |\n{'|---' * len(HEADING)}|")
    for (snr_db, name, way), several in sorted(found.items(), key=lambda item: -item[0][0]):
        print(row(snr_db, name, way, several))


def scans(seed: int, noise_db: Sequence[float]) -> Iterator[tuple[float, OxygenBody, Scan]]:
    """Yield a body with its signals at each level of noise."""
    body = OxygenBody.draw(seed)
    phantom = oxygen_phantom(illuminate(body))
    for snr_db in noise_db:
        yield snr_db, body, simulate_scan(phantom, oatkit.plugin("forward_model", "arc")(), snr_db=snr_db, seed=seed)


def runs(body: OxygenBody, scan: Scan, quick: bool) -> Iterator[tuple[str, str, Found]]:
    """Yield reconstruction, unmixing and what came of them; each image is reconstructed once."""
    for name in list(RECONSTRUCTIONS)[: 2 if quick else 3]:
        memo = Memo()
        with TemporaryDirectory() as folder:
            compared = pipelines(name)
            if name == "lsqr-threshold" and not quick:
                compared |= with_wrong_scattering(name, scan, Path(folder))
            for way, pipeline in compared.items():
                yield name, way, judged(oatkit.run(pipeline, scan, memo=memo), body)


def pipelines(name: str) -> dict[str, Pipeline]:
    """Return what is compared: the preset `multispectral`, and what knows less or more than it does."""
    preset = multispectral(name)
    assert preset.unmix is not None
    once = {"unmix": oatkit.plugin("unmixer", "nnls")(chromophores=preset.unmix.chromophores)}
    no_light = {"segment": None, "fluence": None, "absorption": None}
    stated, true = AbsorptionTable(), AbsorptionTable(calibration=1.0)
    return {
        "pressure": preset.model_copy(update={**once, **no_light}),
        "absorption in homogeneous light": preset.model_copy(update={**once, "absorption": stated}),
        "fluence-corrected, K by the stated mean": preset.model_copy(update={"absorption": stated}),
        "fluence-corrected, K by the spectra": preset,
        "fluence-corrected, true K": preset.model_copy(update={"absorption": true}),
    }


def with_wrong_scattering(name: str, scan: Scan, folder: Path) -> dict[str, Pipeline]:
    """Return the preset told a wrong mu_s'."""
    return {
        way: multispectral(name, f"optics.table={write_optics(folder, scan.wavelengths_nm, factor)}")
        for way, factor in WRONG_SCATTERING.items()
    }


def multispectral(name: str, *changes: str) -> Pipeline:
    """Return the preset with another reconstruction, and light through clear water, as that of the simulation."""
    changes = (f"reconstruct.use={RECONSTRUCTIONS[name]}", "unmix.probe=0", *changes)
    pipeline = Pipeline.load("multispectral", changes)
    assert pipeline.fluence is not None
    return pipeline.model_copy(update={"fluence": pipeline.fluence.model_copy(update={"ring_radius": None})})


def write_optics(folder: Path, wavelengths_nm: Sequence[float], factor: float) -> Path:
    """Write the optics of the preset with mu_s' times `factor`, and return where."""
    path = folder / f"scattering-{factor:g}.csv"
    known = tissue_optics("soft-tissue", wavelengths_nm)
    columns = (wavelengths_nm, known.absorption_per_m / 100, factor * known.reduced_scattering_per_m / 100)
    lines = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([",".join(("wavelength_nm", *COLUMNS)), *lines]) + "\n")
    return path


def judged(result: Result, body: OxygenBody) -> Found:
    """Return the errors of the vessels."""
    grid = result["initial_pressure"].grid
    deep: list[float] = []
    shallow: list[float] = []
    for vessel in body.vessels:
        found = saturation(result, vessel, grid) - vessel.tissue.oxygen_saturation
        (deep if body.depth_m(vessel.centre_m) > DEEP_M else shallow).append(found)
    facts = result["so2"].diagnostics
    return Found(np.array(deep), np.array(shallow), facts.get("calibration"), facts.get("diverged", False))


def saturation(images: Mapping[str, Image], vessel: Inclusion, grid: Grid) -> float:
    """Return the share of oxygenated haemoglobin in a vessel."""
    inside = vessel.region(ERODED_M).mask(grid)
    oxy, deoxy = (images[name].values[0][inside].mean() for name in ("oxyhaemoglobin", "deoxyhaemoglobin"))
    return float(oxy / (oxy + deoxy))


def row(snr_db: float, name: str, way: str, several: Sequence[Found]) -> str:
    """Return the row of the table for one reconstruction and unmixing, over all bodies."""
    deep, shallow = (np.concatenate([getattr(one, part) for one in several]) for part in ("deep", "shallow"))
    cells = (
        f"{snr_db:g}", name, way, f"{abs(deep).mean():.3f}", f"{abs(deep).max():.3f}", f"{deep.mean():+.3f}",
        f"{abs(shallow).mean():.3f}",
        ", ".join("-" if one.calibration is None else f"{one.calibration:.2f}" for one in several),
        f"{sum(one.diverged for one in several)} of {len(several)}",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
