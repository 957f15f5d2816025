"""Speed of sound
==============

**Lesson: a speed of sound that is 2 % wrong splits vessels in two. The sharpness of a back-projection tells the right
one, if it is measured by a figure that has a peak there.**

One speed holds for water and body together: that is the model. What is found is the speed that makes the sharpest
image.
"""

import matplotlib.pyplot as plt

from oatkit import Geometry, Pipeline, plugin, run
from oatkit.focus import focus
from oatkit.metrics import psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth

# %%
# The signals travel at 1500 m/s; the scan says 1530 m/s.
geometry = Geometry(arc_detectors(128), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1500)
scan = simulate_scan("vessel", plugin("forward_model", "arc")(), geometry=geometry)
scan = scan.with_speed_of_sound(1530, "a guess")

pipeline = Pipeline.load("nnls", ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"])
found = focus(pipeline, scan, speeds_m_s=(1460, 1540))
images = {
    "1530 m/s, a guess": run(pipeline, scan)["initial_pressure"],
    f"{found.speed_m_s:.1f} m/s, by focus": run(found.apply(pipeline), scan)["initial_pressure"],
}
true = truth("vessel", pipeline.grid.grid())

# %%
figure, axes = plt.subplots(2, 2, figsize=(9, 7.4), layout="constrained")
axes = axes.ravel()
for ax, (name, image) in zip(axes, {"truth": true, **images}.items(), strict=False):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="gray", vmin=0, vmax=1, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)", ylabel="y (mm)")
figure.colorbar(drawn, ax=axes[1], label="initial pressure (a.u.)")
scores = found.scores[found.metric]
axes[3].plot(found.speeds_m_s, [score / max(scores) for score in scores], ".-", color="grey")
axes[3].axvline(1500, color="C0", linestyle="--", label="truth")
axes[3].axvline(1530, color="C1", linestyle=":", label="guess")
axes[3].set(title="focus", xlabel="speed of sound (m/s)", ylabel=f"{found.metric}, relative")
axes[3].legend(fontsize=8)

# %%
# Not every measure of sharpness has its peak there. All are kept, and the notes say where they disagree.
for name, image in images.items():
    print(f"{name:22s}  PSNR {psnr(image.values[0], true.values[0]):.1f} dB")
print({metric: float(speed) for metric, speed in found.picks.items()})
