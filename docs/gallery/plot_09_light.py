"""Light: from pressure to absorption
==================================

**Lesson: the deeper a vessel lies, the less light reaches it and the weaker it looks. Divided by the light in an even
body, vessels come out within a factor of two of the truth; what remains is the light that they take from themselves
and from each other. It can be computed, too, where the scanner is calibrated.**

Initial pressure is absorption times fluence. The simulated light obeys all that absorbs in the body, by finite
elements. The pipeline knows none of that: it finds the outline in the image, and computes its light by finite volumes.
"""

import matplotlib.pyplot as plt

from oatkit import Memo, Pipeline, plugin, run
from oatkit.simulate import OxygenBody, illuminate, oxygen_phantom, simulate_scan

body = OxygenBody.draw(0)
lit = illuminate(body, (800.0,), spacing_m=0.16e-3)
scan = simulate_scan(oxygen_phantom(lit), plugin("forward_model", "arc")(), pixels=331)

# %%
# The water is clear here, so there is no ring of light behind it, and the scanner is calibrated: a pressure of 1 stands
# for an absorption of 1/m in full light. Where that is known, the absorption found can dim the light of the next pass.
changes = ["grid.pixels=120", "preprocess.band-pass.high=3", "fluence.ring_radius=", "absorption.calibration=1"]
memo = Memo()
even = run(Pipeline.load("lsqr-threshold-absorption", changes), scan, memo=memo)
passes = run(Pipeline.load("lsqr-threshold-absorption", [*changes, "absorption.passes=8"]), scan, memo=memo)
found = {
    "pressure": even["initial_pressure"],
    "absorption, even body": even["absorption"],
    "absorption, 8 passes": passes["absorption"],
}
true = body.absorption(even["absorption"].grid, (800.0,))

# %%
figure, axes = plt.subplots(2, 3, figsize=(11, 6.6), layout="constrained")
axes = axes.ravel()
for ax, (name, image) in zip(axes[[0, 1, 3, 4]], {"true absorption": true, **found}.items(), strict=True):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="magma", vmin=0, vmax=400, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)")
for ax in axes[::3]:
    ax.set_ylabel("y (mm)")
figure.colorbar(drawn, ax=axes[4], label="absorption, or pressure (1/m)")
light = axes[2].imshow(even["fluence"].values[0], cmap="viridis", vmin=0, vmax=1, origin="lower", extent=extent)
figure.colorbar(light, ax=axes[2], label="of the incident light")
axes[2].set(title="fluence, even body", xlabel="x (mm)")
depths_mm = [1e3 * body.depth_m(vessel.centre_m) for vessel in body.vessels]
masks = [vessel.region(0.1e-3).mask(true.grid) for vessel in body.vessels]  # without the outer 0.1 mm
for (name, image), marker in zip(found.items(), "osD", strict=True):
    shares = [image.values[0][mask].mean() / true.values[0][mask].mean() for mask in masks]
    axes[5].plot(depths_mm, shares, marker, label=name)
    print(f"{name:22s} {min(shares):.2f} .. {max(shares):.2f} of the true absorption of a vessel")
axes[5].axhline(1, color="grey", linewidth=0.8)
axes[5].set(title="vessels", xlabel="depth (mm)", ylabel="found over true", ylim=(0, 1.75))
axes[5].legend(fontsize=8, loc="upper left")
