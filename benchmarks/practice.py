"""What band, number of steps and method do to the image of one simulated body, as docs/guides/practice.md shows.

    python benchmarks/practice.py

One body and one seed of the noise: it shows what the settings do, and ranks no methods.
"""

from oatkit import Memo, Pipeline, run
from oatkit.demo import simulated
from oatkit.metrics import negative_pixels, psnr, ssim

BAND = ("preprocess.band-pass.low=0.1", "preprocess.band-pass.high=7.0")
STOPPED = ("reconstruct.n_iterations=20", "reconstruct.preconditioner=none")
ROWS = (
    ("lsqr", "the preset", ()),
    ("lsqr", "stopped after 20 steps", STOPPED),
    ("lsqr", "0.1 .. 7 MHz", BAND),
    ("lsqr", "0.1 .. 7 MHz, 20 steps", (*BAND, *STOPPED)),
    ("lsqr-threshold", "the preset", ()),
    ("nnls", "the preset", ()),
    ("maxent", "the preset", ()),
    ("maxent", "0.1 .. 7 MHz", BAND),
    ("maxent", "0.02 .. 7 MHz", BAND[1:]),
    ("maxent", "flat prior 0.1", ("reconstruct.prior=0.1",)),
    ("maxent", "weight 0.1", ("reconstruct.weight=0.1",)),
    ("backprojection", "the preset", ()),
)


def main() -> None:
    """Reconstruct with each setting and print a Markdown table."""
    scan, truth = simulated("breast", snr_db=32.0, seed=0)
    memo = Memo()
    print("| preset | changed | PSNR, dB | SSIM | negative pixels | products |")
    print("|---|---|---|---|---|---|")
    for name, what, changes in ROWS:
        image = run(Pipeline.load(name, changes), scan, memo=memo)["initial_pressure"]
        x, true = image.values[0], truth.values[0]
        negative = 100 * negative_pixels(x).share
        products = image.diagnostics["products"][0]
        print(f"| {name} | {what} | {psnr(x, true):.1f} | {ssim(x, true):.3f} | {negative:.1f} % | {products} |")


if __name__ == "__main__":
    main()
