"""Oxygen saturation
=================

**Lesson: light changes its colour on its way through blood, and unmixing that knows nothing of it gets saturations
wrong. Computing the light from the blood that was found brings them nearer to the truth.**

The model knows the simulated scattering and the simulated band of light. Those of a real scan it does not.
"""

import matplotlib.pyplot as plt
import numpy as np

from oatkit import Pipeline, plugin, run
from oatkit.api import UnmixProblem
from oatkit.simulate import OxygenBody, illuminate, oxygen_phantom, simulate_scan

# %%
# Seven vessels of known saturation in a body of 20 mm, at six wavelengths. Finite elements solve the light.
body = OxygenBody.draw(1)
lit = illuminate(body, (700.0, 740.0, 760.0, 800.0, 850.0, 900.0), spacing_m=0.16e-3)
scan = simulate_scan(oxygen_phantom(lit), plugin("forward_model", "arc")(), pixels=251)

# %%
# ``multispectral`` finds the outline, then light and blood in turns. The scanner is calibrated here; without that
# number the preset finds it by the spectra, which takes longer. ``nnls`` takes the pressure as it is.
changes = ["grid.pixels=100", "preprocess.band-pass.high=2.5", "fluence.ring_radius=", "absorption.calibration=1"]
changes += ["unmix.probe=0"]  # no maps of how so2 depends on scattering and calibration
result = run(Pipeline.load("multispectral", changes), scan)
nnls = plugin("unmixer", "nnls")(chromophores=("oxyhaemoglobin", "deoxyhaemoglobin", "water"))
found = {"without light": nnls.unmix(UnmixProblem(result["initial_pressure"])), "with light": result}

# %%
# White is undefined: water, and tissue with next to no blood.
figure, axes = plt.subplots(2, 2, figsize=(9, 7.4), layout="constrained")
axes = axes.ravel()
maps = {"truth": body.so2(result["so2"].grid)} | {name: images["so2"] for name, images in found.items()}
for ax, (name, image) in zip(axes, maps.items(), strict=False):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="viridis", vmin=0, vmax=1, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)", ylabel="y (mm)")
figure.colorbar(drawn, ax=axes[1], label="oxygen saturation")
depths_mm = [1e3 * body.depth_m(vessel.centre_m) for vessel in body.vessels]
masks = [vessel.region(0.1e-3).mask(result["so2"].grid) for vessel in body.vessels]  # without the outer 0.1 mm
true = [vessel.tissue.oxygen_saturation for vessel in body.vessels]
for (name, images), marker in zip(found.items(), "oD", strict=True):
    oxygenated, all_blood = (images[key].values[0] for key in ("oxyhaemoglobin", "total_haemoglobin"))
    errors = np.array([oxygenated[mask].sum() / all_blood[mask].sum() for mask in masks]) - true
    axes[3].plot(depths_mm, errors, marker, label=name)
    print(f"{name:14s} error of a vessel: mean {abs(errors).mean():.3f}, largest {abs(errors).max():.3f}")
axes[3].axhline(0, color="grey", linewidth=0.8)
axes[3].set(title="vessels", xlabel="depth (mm)", ylabel="saturation minus truth")
axes[3].legend(fontsize=8)
