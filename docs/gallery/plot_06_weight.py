"""Choosing the weight
===================

**Lesson: rules that choose the weight from the data disagree, and none knows the truth. Look at images on both sides
of the choice.**

``weight = "l-curve"`` takes the sharpest bend of misfit against penalty; ``"hold-out"`` takes the weight whose image
best predicts detectors that were kept back. The result holds the curve, and what each way to read it picks.
"""

import matplotlib.pyplot as plt

from oatkit import Geometry, Memo, Pipeline, plugin, run
from oatkit.metrics import psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth

geometry = Geometry(arc_detectors(64), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
scan = simulate_scan("breast", plugin("forward_model", "arc")(), geometry=geometry, snr_db=20)
changes = ["grid.pixels=64", "grid.field_of_view_mm=20", "preprocess.band-pass.high=1.9"]

memo = Memo()
choice = run(Pipeline.load("tv", [*changes, "reconstruct.weight=hold-out"]), scan, memo=memo).weight_choice
picks = choice["picks"]
for rule, weight in picks.items():
    print(f"{rule:10s} picks {weight:.2g}")

# %%
# What a weight is worth can be told here, since the truth is known.
images = {}
for weight in sorted({point["weight"] for point in choice["curve"] if point["weight"] < 0.05}):
    pipeline = Pipeline.load("tv", [*changes, f"reconstruct.weight={weight}"])
    images[weight] = run(pipeline, scan, memo=memo)["initial_pressure"].values[0]
true = truth("breast", pipeline.grid.grid())
worth = {weight: psnr(image, true.values[0]) for weight, image in images.items()}
best = max(worth, key=worth.get)

# %%
figure, axes = plt.subplots(2, 3, figsize=(11, 6.6), layout="constrained")
axes = axes.ravel()
curve = [point for point in choice["curve"] if point["weight"] in images]
axes[0].loglog([p["residual_norm"] for p in curve], [p["penalty"] for p in curve], ".-", color="grey")
axes[1].semilogx(worth.keys(), worth.values(), ".-", color="grey")
for rule, marker in (("chord", "s"), ("curvature", "o"), ("prediction", "D")):
    at = next(p for p in curve if p["weight"] == picks[rule])
    axes[0].plot(at["residual_norm"], at["penalty"], marker, fillstyle="none", markersize=10, label=rule)
    axes[1].plot(picks[rule], worth[picks[rule]], marker, fillstyle="none", markersize=10)
axes[0].set(title="L-curve", xlabel="misfit |A x - b|, logarithmic", ylabel="penalty, logarithmic")
axes[0].tick_params(which="both", labelbottom=False, labelleft=False)
axes[0].legend(fontsize=8)
axes[1].set(title="nearness to the truth", xlabel="weight", ylabel="PSNR (dB)")
chosen = {"chord": picks["chord"], "curvature": picks["curvature"], "best": best}
shown = {f"{name}: {weight:.2g}": images[weight] for name, weight in chosen.items()}
for ax, (name, plane) in zip(axes[2:], {"truth": true.values[0], **shown}.items(), strict=True):
    extent = [1e3 * edge for edge in true.grid.extent_m]
    drawn = ax.imshow(plane, cmap="gray", vmin=0, vmax=1, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)")
axes[3].set_ylabel("y (mm)")
figure.colorbar(drawn, ax=axes[5], label="initial pressure (a.u.)")

# %%
# All three rules picked too weak a weight here.
for rule, weight in picks.items():
    print(f"{rule:10s} {worth[best] - worth[weight]:.1f} dB below the best")
