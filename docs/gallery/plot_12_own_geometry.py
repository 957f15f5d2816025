"""A geometry of one's own
=======================

**Lesson: detectors may lie anywhere in the plane. A flat probe shows what lies along it and loses what stands across;
a curved one loses less.**
"""

import matplotlib.pyplot as plt
import numpy as np

from oatkit import Detectors, Geometry, Image, Pipeline, plugin, run
from oatkit.metrics import psnr
from oatkit.regions import EllipseRegion, RectangleRegion
from oatkit.simulate import simulate_scan

# %%
# Positions are (y, x) in m, and y points up: a linear array of 128 elements, 0.3 mm apart, 2 mm above the image, and a
# handheld arc of as many elements on 144 degrees, with a radius of 40 mm.
along_m = (np.arange(128) - 63.5) * 0.3e-3
angle = np.deg2rad(90 + np.linspace(-72, 72, 128))
probes = {
    "linear array": Detectors(np.column_stack([np.full(128, 12e-3), along_m])),
    "arc of 144°": Detectors(40e-3 * np.column_stack([np.sin(angle), np.cos(angle)])),
}


def phantom(grid):
    """Return a bar along the probe, one across, and discs at four depths."""
    parts = [EllipseRegion("disc", (y, -4e-3), (0.8e-3, 0.8e-3)) for y in (6e-3, 2e-3, -2e-3, -6e-3)]
    parts += [RectangleRegion("along", (-3e-3, 4e-3), (0.4e-3, 3e-3))]
    parts += [RectangleRegion("across", (2e-3, 4e-3), (3e-3, 0.4e-3))]
    return Image(sum(part.mask(grid).astype(float) for part in parts), "initial_pressure", "a.u.", grid)


# %%
# An operator and its adjoint must belong together: <A x, y> is <x, A* y> for any x and y. The operator computes in
# single precision.
model = plugin("forward_model", "arc")()
pipeline = Pipeline.load("nnls", ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"])
grid = pipeline.grid.grid()
images = {"truth": phantom(grid)}
rng = np.random.default_rng(0)
for name, detectors in probes.items():
    geometry = Geometry(detectors, sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1500)
    operator = model.operator(geometry, grid)
    x, y = rng.standard_normal(operator.shape[1]), rng.standard_normal(operator.shape[0])
    forward = operator.matvec(x)
    mismatch = abs(forward @ y - x @ operator.rmatvec(y)) / (np.linalg.norm(forward) * np.linalg.norm(y))
    scan = simulate_scan(phantom, model, geometry=geometry, field_of_view_m=20e-3, pixels=331)
    image = images[name] = run(pipeline, scan)["initial_pressure"]
    nearness = psnr(image.values[0], images["truth"].values[0])
    print(f"{name:12s}  adjoint wrong by {mismatch:.0e}  PSNR {nearness:.1f} dB")

# %%
figure, axes = plt.subplots(1, 3, figsize=(10, 3.7), layout="constrained", sharey=True)
for ax, (name, image) in zip(axes, images.items(), strict=True):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="gray", vmin=0, vmax=1, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)")
y, x = 1e3 * probes["linear array"].positions_m.T
axes[1].plot(x, y, "s", color="tab:orange", markersize=2)
axes[1].set(xlim=(-10, 10), ylim=(-10, 13))
axes[0].set_ylabel("y (mm)")
figure.colorbar(drawn, ax=axes, label="initial pressure (a.u.)")
