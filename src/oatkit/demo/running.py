"""The demo: one simulated scan reconstructed three ways, and one at many wavelengths, each beside the truth."""

from collections.abc import Iterator
from pathlib import Path

from oatkit.data import Image
from oatkit.demo.oxygen import oxygen_files, run_oxygen_demo
from oatkit.demo.scans import simulated
from oatkit.engine import run
from oatkit.errors import ResultError, ValidationError
from oatkit.memo import Memo
from oatkit.metrics import negative_pixels, psnr, rmse, ssim
from oatkit.pipeline import Pipeline

METHODS = ("lsqr", "lsqr-threshold", "maxent")
"""The presets that the demo compares."""

WHAT = "a breast-like phantom, 256 detectors on 270 degrees, SNR 32 dB over the samples that the image can reach"


def run_demo(folder: Path, overwrite: bool = False) -> Iterator[str]:
    """Write scans, results and figures of the demo into `folder`; yield a line for each thing done.

    Raises `ValidationError` where the folder holds a demo already, unless `overwrite`.
    """
    scan_file, figure, saved = (folder / name for name in ("scan.h5", "demo.png", f"{METHODS[-1]}.zarr"))
    there = [str(path) for path in (scan_file, figure, saved, *oxygen_files(folder)) if path.exists()]
    if there and not overwrite:
        raise ValidationError(f"{there[0]}: exists already; choose another folder with -o or add --overwrite")
    from oatkit.figure import write_comparison  # matplotlib
    from oatkit.scanfile import write_scan

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"{folder}: cannot be made: {error.strerror}") from None
    yield f"simulating {WHAT} ..."
    scan, truth = simulated("breast", snr_db=32.0, seed=0)
    write_scan(scan, scan_file, truth, overwrite=overwrite)
    yield f"wrote {scan_file}"
    panels: list[tuple[str, Image, list[str]]] = [("truth", truth, ["the phantom"])]
    memo = Memo()
    for name in METHODS:
        result = run(Pipeline.load(name), scan, memo=memo)
        image = result["initial_pressure"]
        panels.append((name, image, scores(image, truth)))
        yield f"{name}: {', '.join(scores(image, truth))}"
    result.save(saved, overwrite=overwrite)
    yield f"wrote {saved}"
    title = "One simulated scan, three reconstructions"
    write_comparison(figure, panels, title, WHAT, overwrite)
    yield f"wrote {figure}"
    yield from run_oxygen_demo(folder, overwrite)


def scores(image: Image, truth: Image) -> list[str]:
    """Return how near an image is to the truth, as lines for a figure."""
    x, true = image.values[0], truth.values[0]
    negative = negative_pixels(x)
    lines = [
        f"PSNR {psnr(x, true):.2f} dB",
        f"SSIM {ssim(x, true):.3f}",
        f"RMSE {rmse(x, true):.4f}",
        f"{negative.count:,} negative pixels ({100 * negative.share:.1f} %)",
    ]
    gap = image.diagnostics.get("relative_gap", (float("nan"),))[0]
    return [*lines, f"within {gap:.1e} of the optimum"] if gap == gap else lines
