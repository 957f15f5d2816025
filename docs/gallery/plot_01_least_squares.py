"""Least squares, and its negative pixels
======================================

**Lesson: where data are few, the image of least squares goes below zero, which means nothing physically. Setting those
pixels to zero hides the fault: the image then no longer fits the data.**

An initial pressure is never negative. Least squares does not know that.
"""

import matplotlib.pyplot as plt

from oatkit import Geometry, Memo, Pipeline, plugin, run
from oatkit.metrics import negative_pixels, psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth

# %%
# A breast-like body, seen by 97 detectors on 145 degrees. Its signals are computed on 541 x 541 pixels and get noise;
# ``truth`` gives the same body on the pixels of the pipeline.
geometry = Geometry(arc_detectors(97, coverage_deg=145), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
scan = simulate_scan("breast", plugin("forward_model", "arc")(), geometry=geometry)
changes = ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"]

memo = Memo()  # keeps the operator from one run to the next
images = {name: run(Pipeline.load(name, changes), scan, memo=memo) for name in ("lsqr", "lsqr-threshold")}
signed, cut = (result["initial_pressure"] for result in images.values())
true = truth("breast", signed.grid)

# %%
# White is zero, blue is negative.
figure, axes = plt.subplots(1, 3, figsize=(10, 3.7), layout="constrained", sharey=True)
for ax, (name, image) in zip(axes, {"truth": true, "lsqr": signed, "lsqr-threshold": cut}.items(), strict=True):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="RdBu_r", vmin=-0.4, vmax=0.4, origin="lower", extent=extent)
    ax.set(title=f"{name}: {negative_pixels(image.values[0]).share:.0%} negative", xlabel="x (mm)")
axes[0].set_ylabel("y (mm)")
figure.colorbar(drawn, ax=axes, label="initial pressure (a.u.)", extend="both")

# %%
# How well an image fits the data is known without the truth. Cutting brings it a little nearer to the truth, and
# further from the data, a part of which the negative pixels had explained. What fits best among the images without
# negative pixels is another one: see :doc:`plot_03_non_negative_least_squares`.
residuals = {
    "lsqr": (signed, signed.diagnostics["residual_norm"][0]),
    "lsqr-threshold": (cut, cut.diagnostics["details"][0]["residual_norm_after"]),
}
for name, (image, residual) in residuals.items():
    relative = residual / image.diagnostics["data_norm"][0]
    nearness = psnr(image.values[0], true.values[0])
    print(f"{name:14s}  residual {relative:.3f}  PSNR {nearness:.1f} dB  lowest pixel {image.values.min():.2f}")
