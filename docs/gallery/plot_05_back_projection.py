"""Back-projection against inversion
=================================

**Lesson: back-projection shows where edges are at the price of one product with the operator. It does not show how
strong the regions between them are.**

It suffices for a first look, for finding the speed of sound, for seeing whether a body has moved. It does not suffice
where a value counts: absorption, oxygen, the mean of a region.
"""

import matplotlib.pyplot as plt
import numpy as np

from oatkit import Geometry, Pipeline, plugin, run
from oatkit.metrics import fitted_scale, negative_pixels
from oatkit.simulate import arc_detectors, simulate_scan, truth

geometry = Geometry(arc_detectors(256), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
scan = simulate_scan("breast", plugin("forward_model", "arc")(), geometry=geometry)
changes = ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"]
images = {name: run(Pipeline.load(name, changes), scan)["initial_pressure"] for name in ("backprojection", "lsqr")}
true = truth("breast", images["lsqr"].grid)

# %%
# A back-projection has no scale of its own. Both images get the one that fits the truth best.
planes = {"truth": true.values[0]}
for name, image in images.items():
    plane = planes[name] = image.values[0] * fitted_scale(image.values[0], true.values[0])
    products, share = image.diagnostics["products"][0], negative_pixels(plane).share
    likeness = np.corrcoef(plane.ravel(), true.values[0].ravel())[0, 1]
    print(f"{name:14s}  products {products:2d}  negative pixels {share:.0%}  correlation with the truth {likeness:.3f}")

# %%
figure, axes = plt.subplots(2, 2, figsize=(9, 7.4), layout="constrained")
axes = axes.ravel()
row = true.grid.shape[0] // 2
for ax, (name, plane), style in zip(axes, planes.items(), ("k-", "C1-", "C0--"), strict=False):
    extent = [1e3 * edge for edge in true.grid.extent_m]
    drawn = ax.imshow(plane, cmap="RdBu_r", vmin=-1, vmax=1, origin="lower", extent=extent)
    ax.axhline(1e3 * true.grid.y_m[row], color="black", linewidth=0.6, linestyle=":")
    ax.set(title=name, xlabel="x (mm)", ylabel="y (mm)")
    axes[3].plot(1e3 * true.grid.x_m, plane[row], style, label=name)
figure.colorbar(drawn, ax=axes[1], label="initial pressure (a.u.)")
axes[3].set(title="along the dotted line", xlabel="x (mm)", ylim=(-0.6, 1.3))
axes[3].legend(ncols=3, loc="upper center", fontsize=8)
