"""Non-negative least squares, and when to stop
============================================

**Lesson: in a limited view, asking for an image without negative pixels is worth decibels more than cutting them off
afterwards; in a full view it is not. Stopped after a few steps, either is far from the truth.**

Both minimise the misfit and the roughness of the image. ``nnls`` looks among the images without negative pixels;
``lsqr-threshold`` among all, and sets the negative pixels of the result to zero.
"""

import matplotlib.pyplot as plt

from oatkit import Geometry, Memo, Pipeline, plugin, run
from oatkit.events import StepIterate
from oatkit.metrics import psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth

changes = ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"]
true = truth("star", Pipeline.load("nnls", changes).grid.grid())

# %%
# Every iterate is compared with the truth on the way, its negative pixels set to zero.
images, courses = {}, {}
for view in (90, 270):
    detectors = arc_detectors(view * 2 // 3, coverage_deg=view)  # one every 1.5 degrees
    geometry = Geometry(detectors, sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
    scan, memo = simulate_scan("star", plugin("forward_model", "arc")(), geometry=geometry), Memo()
    for method in ("lsqr-threshold", "nnls"):
        course = courses[f"{method}, {view}°"] = []

        def look(event, course=course):
            """Keep how near an iterate is to the truth."""
            if isinstance(event, StepIterate) and event.iterate.iteration:
                course.append((event.iterate.products, psnr(event.iterate.image.clip(0), true.values[0])))

        images[f"{method}, {view}°"] = run(Pipeline.load(method, changes), scan, memo=memo, on_event=look)
        print(f"{view:3d}°  {method:14s}  {course[-1][0]:3d} products  PSNR {course[-1][1]:.1f} dB")

# %%
figure, axes = plt.subplots(2, 2, figsize=(9, 7.4), layout="constrained")
axes = axes.ravel()
shown = {"truth": true} | {name: result["initial_pressure"] for name, result in images.items()}
for ax, (name, image) in zip(axes[:3], shown.items(), strict=False):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="gray", vmin=0, vmax=0.5, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)", ylabel="y (mm)")
figure.colorbar(drawn, ax=axes[1], label="initial pressure (a.u.)", extend="max")
for number, (name, course) in enumerate(courses.items()):
    axes[3].plot(*zip(*course, strict=True), ("-", "--")[number // 2], color=f"C{number % 2}", label=name)
axes[3].set(xlabel="products with A and its adjoint", ylabel="PSNR (dB)", title="nearness to the truth")
axes[3].legend(fontsize=8)
