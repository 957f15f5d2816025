"""Limited view
============

**Lesson: an edge is seen where the line that crosses it at a right angle meets a detector. Half a ring around the body
sees every edge; a quarter loses those that face sideways, and no method brings them back.**

The same spacing of the detectors in each view, one every 1.5 degrees. Their arc has a radius of 40.5 mm and is drawn
smaller.
"""

import matplotlib.pyplot as plt

from oatkit import Geometry, Pipeline, plugin, run
from oatkit.metrics import psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth

model = plugin("forward_model", "arc")()
pipeline = Pipeline.load("nnls", ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"])
bodies = {"star": 0.5, "vessel": 1.0}  # and the pressure that is drawn white

# %%
figure, axes = plt.subplots(2, 5, figsize=(11, 4.8), layout="constrained", sharex=True, sharey=True)
for row, (body, white) in zip(axes, bodies.items(), strict=True):
    true = truth(body, pipeline.grid.grid())
    style = {"cmap": "gray", "vmin": 0, "vmax": white, "origin": "lower"}
    extent = [1e3 * edge for edge in true.grid.extent_m]
    row[0].imshow(true.values[0], extent=extent, **style)
    row[0].set(title=f"{body}: truth", ylabel="y (mm)")
    for ax, view in zip(row[1:], (360, 270, 180, 90), strict=True):
        detectors = arc_detectors(view * 2 // 3, coverage_deg=view)
        geometry = Geometry(detectors, sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
        scan = simulate_scan(body, model, geometry=geometry, field_of_view_m=20e-3, pixels=331)
        image = run(pipeline, scan)["initial_pressure"]
        nearness = psnr(image.values[0], true.values[0])
        print(f"{body:6s}  {view:3d} degrees  PSNR {nearness:.1f} dB")
        drawn = ax.imshow(image.values[0], extent=extent, **style)
        y, x = detectors.positions_m.T / 40.5e-3 * 9.6
        ax.plot(x, y, ".", color="tab:orange", markersize=1.5)
        ax.set_title(f"{view}°: {nearness:.1f} dB")
    figure.colorbar(drawn, ax=row, label="initial pressure (a.u.)", extend="max")
for ax in axes[1]:
    ax.set_xlabel("x (mm)")
