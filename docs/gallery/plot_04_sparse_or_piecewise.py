"""Sparse, or even regions with edges
==================================

**Lesson: a penalty is a belief about the body. Total variation expects even regions with sharp edges and gains most
where it is right; L1 expects few bright pixels, and breaks thin vessels up into them.**

All methods run at the weights of their presets, on few detectors and with noise of 20 dB. Weights tuned to each body
would give other numbers.
"""

import matplotlib.pyplot as plt

from oatkit import Geometry, Memo, Pipeline, plugin, run
from oatkit.metrics import psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth

geometry = Geometry(arc_detectors(64), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
changes = ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"]
methods = ("lsqr-threshold", "l1", "tv", "maxent")
bodies = {"vessel": 1.0, "star": 0.6}  # and the pressure that is drawn white

# %%
figure, axes = plt.subplots(2, 5, figsize=(11, 4.8), layout="constrained", sharex=True, sharey=True)
memo = Memo()
for row, (body, white) in zip(axes, bodies.items(), strict=True):
    scan = simulate_scan(
        body, plugin("forward_model", "arc")(), geometry=geometry, field_of_view_m=20e-3, pixels=331, snr_db=20
    )
    images = {m: run(Pipeline.load(m, changes), scan, memo=memo)["initial_pressure"] for m in methods}
    true = truth(body, images["tv"].grid)
    scores = {name: psnr(image.values[0], true.values[0]) for name, image in images.items()}
    print(f"{body:6s}", "  ".join(f"{name} {score:.1f} dB" for name, score in scores.items()))
    for ax, (name, image) in zip(row, {"truth": true, **images}.items(), strict=True):
        extent = [1e3 * edge for edge in image.grid.extent_m]
        drawn = ax.imshow(image.values[0], cmap="gray", vmin=0, vmax=white, origin="lower", extent=extent)
        ax.set_title(f"{name}\n{scores[name]:.1f} dB" if name in scores else f"{body}\ntruth")
    row[0].set_ylabel("y (mm)")
    figure.colorbar(drawn, ax=row, label="initial pressure (a.u.)", extend="max")
for ax in axes[1]:
    ax.set_xlabel("x (mm)")

# %%
# On the star total variation is far ahead. On the vessels its lead over maximum entropy is small, and both are ahead of
# L1 and of thresholded least squares, which blurs them.
