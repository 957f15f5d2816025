"""How near the segmenters come to the outlines of simulated bodies, by the noise; prints a Markdown table.

    python benchmarks/segmentation.py

Data come from the interpolated model matrix on 331 pixels a side, lit by diffusion; images are reconstructed by `arc`
on 200. Bodies and noise are other draws than those that the defaults were chosen on.
"""

from collections.abc import Iterator
from time import perf_counter

import oatkit
from oatkit.data import Image
from oatkit.errors import SolverError
from oatkit.outlines import dice, hausdorff_m
from oatkit.simulate import Body, breast_body, disc_body, mouse_body, simulate_scan, star_body

BODIES = {
    "breast 21": breast_body(21),
    "star": star_body(8.5e-3),
    "disc, off centre": disc_body(7e-3, (2e-3, -3e-3)),
    "mouse 21": mouse_body(21),
    "mouse 22, legs": mouse_body(22, legs=True),
}
SEGMENTERS = ("radial", "active-contour", "geodesic")
PRESETS = ("lsqr", "maxent")
NOISE_DB = (32.0, 10.0, 3.0)


def main() -> None:
    """Simulate, reconstruct, segment and print."""
    print("| body | SNR, dB | preset | segmenter | Dice | Hausdorff, mm | area, % | s | said |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, body in BODIES.items():
        for snr_db in NOISE_DB:
            for preset, image in reconstructions(body, snr_db):
                for use in SEGMENTERS:
                    print(f"| {name} | {snr_db:g} | {preset} | {use} | {row(use, image, body)} |", flush=True)


def reconstructions(body: Body, snr_db: float) -> Iterator[tuple[str, Image]]:
    """Yield preset and initial pressure of a body in diffuse light."""
    light = oatkit.plugin("fluence_model", "diffusion-fvm")()
    model = oatkit.plugin("forward_model", "immi")()
    scan = simulate_scan(lambda grid: body.lit(grid, light, 1000.0, 30.0)[0], model, pixels=331, snr_db=snr_db, seed=21)
    for preset in PRESETS:
        yield preset, oatkit.run(oatkit.Pipeline.load(preset), scan)["initial_pressure"]


def row(use: str, image: Image, body: Body) -> str:
    """Return the cells of one segmentation."""
    start = perf_counter()
    try:
        found = oatkit.plugin("segmenter", use)().segment(image)
    except SolverError as error:
        return f"- | - | - | {perf_counter() - start:.1f} | {error}"
    seconds = perf_counter() - start
    truth = body.boundary(image.grid)
    area = 100 * ((found.values < 0).sum() / (truth.values < 0).sum() - 1)
    said = "; ".join(found.diagnostics["notes"])
    distance = 1e3 * hausdorff_m(found, body.outline_m)
    return f"{dice(found, truth):.3f} | {distance:.2f} | {area:+.1f} | {seconds:.1f} | {said}"


if __name__ == "__main__":
    main()
