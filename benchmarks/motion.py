"""How many pulses out of place are found, and how many at rest are taken for such; makes docs/guides/time.md.

    python benchmarks/motion.py

Scans of three bodies with twelve vessels by 64 detectors, 8 frames of 5 wavelengths: at rest, and with 5 of the 40
pulses displaced in random directions. And one frame of 12 wavelengths of 680 .. 900 nm with blood, water and melanin
in the body and other blood in the vessels: at rest, and with 2 pulses displaced. Then a dye that makes vessels ten
times as strong or more, of which nothing moves.
"""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np

from oatkit import Geometry, Grid, Scan, plugin
from oatkit.motion import find_motion
from oatkit.simulate import arc_detectors, breast, mouse_body, star, useful_window
from oatkit.simulate.raster import area_average
from oatkit.spectra.chromophores import CHROMOPHORES

GEOMETRY = Geometry(arc_detectors(64, 0.0405, 270), 20e6, 1015, speed_of_sound_m_s=1500)
GRID = Grid((200, 200), 25e-3 / 200)
BODIES: dict[str, Callable[[Grid], np.ndarray]] = {
    "breast": lambda grid: breast(grid).values[0],
    "mouse": lambda grid: mouse_body().absorption(grid).values[0] / 100,
    "star": lambda grid: star(grid).values[0],
}
FRAMES, SEEDS = 8, 10
FEW = np.array([[1.0, 0.8, 0.7, 0.75, 0.9], [0.3, 0.2, 0.25, 0.35, 0.5]])
"""Strength of body and vessels at five wavelengths."""


def vessels(grid: Grid) -> np.ndarray:
    """Return twelve discs of 0.2 to 0.6 mm radius."""
    rng = np.random.default_rng(5)
    discs = np.column_stack([rng.uniform(-6e-3, 6e-3, (12, 2)), rng.uniform(0.2e-3, 0.6e-3, 12)])
    return area_average(lambda y, x: np.any([np.hypot(y - v, x - u) <= r for v, u, r in discs], axis=0) * 1.0, grid)


def tissue() -> np.ndarray:
    """Return how strong body and vessels are at twelve wavelengths, shape (2, 12)."""
    nm = np.arange(680.0, 901.0, 20.0)
    oxy, deoxy, water, melanin = (
        CHROMOPHORES[name].spectrum(nm) for name in ("oxyhaemoglobin", "deoxyhaemoglobin", "water", "melanin")
    )
    blood = [share * oxy + (1 - share) * deoxy for share in (0.6, 0.95)]
    body = blood[0] / blood[0].mean() + 0.3 * water / water.mean() + 0.3 * melanin / melanin.mean()
    return np.stack([0.25 * body, 1.5 * blood[1] / blood[1].mean()])


@cache
def operator() -> Any:
    """Return the acoustic operator."""
    return plugin("forward_model", "arc")().operator(GEOMETRY, GRID)


def places(body: str, distance_m: float) -> np.ndarray:
    """Return the signals of body and vessels at rest and after four moves: shape (5, 2, detector, sample)."""
    angles = np.deg2rad([0, 60, 135, 250])
    moves = [(0.0, 0.0), *zip(distance_m * np.sin(angles), distance_m * np.cos(angles), strict=True)]
    grids = [Grid(GRID.shape, GRID.pixel_size_m, (-y, -x)) for y, x in moves]
    images = [image(grid) for grid in grids for image in (BODIES[body], vessels)]
    return np.stack([operator().matvec(i.ravel()) for i in images]).reshape(5, 2, *GEOMETRY.shape)


def judged(
    signals: np.ndarray, strength: np.ndarray, frames: int, displaced: int, snr_db: float
) -> Iterator[tuple[int, int]]:
    """Yield for each seed how many displaced pulses are found, and how many others."""
    useful = useful_window(GEOMETRY, GRID)
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        place = np.zeros((frames, strength.shape[1]), int)
        place.ravel()[rng.choice(place.size, displaced, replace=False)] = rng.integers(1, 5, displaced)
        clean = np.einsum("kw,fwkds->fwds", strength, signals[place]).astype(np.float32)
        level = np.sqrt((clean[..., useful] ** 2).mean()) * 10 ** (-snr_db / 20)
        noisy = clean + level * rng.standard_normal(clean.shape, dtype=np.float32)
        moved = find_motion(Scan(noisy, GEOMETRY, tuple(700.0 + i for i in range(place.shape[1])))).moved
        yield int(moved[place > 0].sum()), int(moved[place == 0].sum())


def dyed(peak_after: float, snr_db: float) -> int:
    """Return how many of 20 frames seem out of place where a dye comes after frame 4 and peaks so much later."""
    after = np.maximum(np.arange(20) - 4, 0) / peak_after
    dye = np.array([0.5, 0.6, 0.8, 1.0, 0.9]) * 5 * (after * np.exp(1 - after))[:, None]
    strength = np.stack([np.broadcast_to(FEW[0], dye.shape), FEW[1] + dye])
    clean = np.einsum("kfw,kds->fwds", strength, places("breast", 0.0)[0]).astype(np.float32)
    level = np.sqrt((clean[0][:, useful_window(GEOMETRY, GRID)] ** 2).mean()) * 10 ** (-snr_db / 20)
    noise = level * np.random.default_rng(0).standard_normal(clean.shape, dtype=np.float32)
    return len(find_motion(Scan(clean + noise, GEOMETRY, (700.0, 740.0, 780.0, 820.0, 860.0))).frames)


def main() -> None:
    """Print found of displaced pulses and false alarms in both kinds of scan, then the frames that a dye puts amiss."""
    print("| scan | displacement, mm | SNR, dB | found | false alarms | at rest |")
    print("|---|---|---|---|---|---|")
    for name, strength, frames, displaced in (("8 frames", FEW, FRAMES, 5), ("1 frame", tissue(), 1, 2)):
        for distance_mm in (0.3, 0.15):
            signals = [places(body, 1e-3 * distance_mm) for body in BODIES]
            for snr_db in (32.0, 10.0, 0.0):
                moving = [pair for one in signals for pair in judged(one, strength, frames, displaced, snr_db)]
                resting = [pair for one in signals for pair in judged(one, strength, frames, 0, snr_db)]
                n, size = len(moving), frames * strength.shape[1]
                found, false = (sum(column) for column in zip(*moving, strict=True))
                false += sum(pair[1] for pair in resting)
                print(
                    f"| {name} | {distance_mm:g} | {snr_db:g} | {found} of {n * displaced} | {false} | "
                    f"{n * (2 * size - displaced)} |",
                    flush=True,
                )
    for peak_after in (1.0, 1.5, 3.0):
        amiss = [dyed(peak_after, snr_db) for snr_db in (32.0, 10.0)]
        print(f"dye that peaks after {peak_after:g} frames: {amiss} of 20 frames at 32 and 10 dB")


if __name__ == "__main__":
    main()
