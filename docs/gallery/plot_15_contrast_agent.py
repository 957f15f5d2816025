"""Change over time: a contrast agent
==================================

**Lesson: where nothing arrives, the largest of the noise has a time, too. Look at the peak before the time to peak.**
"""

import tempfile
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from oatkit import Geometry, Pipeline, plugin, run_frames
from oatkit.kinetics import contrast_kinetics, region_curves
from oatkit.regions import EllipseRegion
from oatkit.simulate import arc_detectors, disc, simulate_scan

# %%
# Signals are linear in the image, so the body is simulated once, each vessel once, and a frame is a mixture. The dye
# arrives 4 s after the start and has its peak 4 s later in one vessel, 10 s later in the other.
arc = plugin("forward_model", "arc")()
geometry = Geometry(arc_detectors(64), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1500)
times_s = 2.0 * np.arange(12)
scan = simulate_scan(disc, arc, geometry=geometry, frames=12, snr_db=15)
signals, regions, dye = np.array(scan.signals), [], {}
for name, place_m, rise_s in (("early vessel", 2.5e-3, 4.0), ("late vessel", -2.5e-3, 10.0)):
    vessel = EllipseRegion(name, (0.0, place_m), (0.8e-3, 0.8e-3))
    after = np.maximum(times_s - 4, 0) / rise_s
    dye[name] = after * np.exp(1 - after)
    alone = simulate_scan(
        lambda grid, at=vessel.centre_m: disc(grid, radius_m=1e-3, centre_m=at), arc, geometry=geometry, snr_db=None
    )
    signals += dye[name][:, None, None, None].astype(signals.dtype) * alone.signals
    regions.append(vessel)
scan = replace(scan, signals=signals, timestamps_s=times_s[:, None])

# %%
pipeline = Pipeline.load("lsqr", ["grid.pixels=80", "grid.field_of_view_mm=14", "preprocess.band-pass.high=3.4"])
with tempfile.TemporaryDirectory() as folder:
    result = run_frames(pipeline, scan, f"{folder}/dye.zarr")
    maps = contrast_kinetics(result, "initial_pressure", baseline=range(3))
    curves = region_curves(result, "initial_pressure", range(3), regions)
peak, time = (maps[f"initial_pressure_{name}"] for name in ("peak", "time_to_peak"))
believed = np.where(peak.values[0] > 0.2, time.values[0], np.nan)

# %%
figure, axes = plt.subplots(2, 2, figsize=(9, 7.4), layout="constrained")
axes = axes.ravel()
shown = (
    ("peak of the change", peak.values[0], "magma", "initial pressure (a.u.)"),
    ("time to peak", time.values[0], "viridis", "s"),
    ("where the peak is above 0.2", believed, "viridis", "s"),
)
for ax, (title, values, colours, unit) in zip(axes, shown, strict=False):
    extent = [1e3 * edge for edge in peak.grid.extent_m]
    drawn = ax.imshow(values, cmap=colours, vmin=0, vmax=1 if colours == "magma" else 18, origin="lower", extent=extent)
    figure.colorbar(drawn, ax=ax, label=unit)
    ax.set(title=title, xlabel="x (mm)", ylabel="y (mm)")
for number, curve in enumerate(curves):
    axes[3].plot(curve.times, curve.change, f"C{number}o", label=f"{curve.region}: found")
    axes[3].plot(curve.times, dye[curve.region], f"C{number}-", label=f"{curve.region}: truth")
    print(f"{curve.region}: peak {curve.kinetics['peak']:.2f} after {curve.kinetics['time_to_peak']:g} s")
axes[3].set(xlabel="after the last frame of the baseline (s)", ylabel="change of the mean (a.u.)")
axes[3].legend(fontsize=8)
