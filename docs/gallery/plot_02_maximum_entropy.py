r"""Maximum entropy, and its certificate
====================================

**Lesson: the image is non-negative by itself and carries a bound on its distance from the optimum. The bound says that
the problem was solved, not that the prior was right.**

Maximum entropy minimises

.. math:: P(x) = |A x - b|^2 + w \sum_i [x_i \log(x_i / m_i) - x_i + m_i]

for a prior image m. P is strictly convex, so there is one optimum, wherever one starts, and duality bounds how far it
is.
"""

import matplotlib.pyplot as plt

from oatkit import Geometry, Memo, Pipeline, plugin, run
from oatkit.events import StepIterate
from oatkit.metrics import psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth

geometry = Geometry(arc_detectors(64), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
scan = simulate_scan("breast", plugin("forward_model", "arc")(), geometry=geometry)
changes = ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"]

# %%
# The structural prior follows a short, blurred least-squares image; a number is a flat prior, relative to the level of
# the image. ``on_event`` is shown every iterate.
memo, images, courses = Memo(), {}, {}
for prior in ("structural", "1.0", "0.1"):
    course = courses[prior] = []

    def look(event, course=course):
        """Keep the price and the gap of an iterate."""
        if isinstance(event, StepIterate):
            course.append((event.iterate.products, event.iterate.relative_gap))

    pipeline = Pipeline.load("maxent", [*changes, f"reconstruct.prior={prior}"])
    images[f"prior {prior}"] = run(pipeline, scan, memo=memo, on_event=look)["initial_pressure"]
images["lsqr-threshold"] = run(Pipeline.load("lsqr-threshold", changes), scan, memo=memo)["initial_pressure"]
true = truth("breast", pipeline.grid.grid())

# %%
figure, axes = plt.subplots(2, 3, figsize=(11, 6.6), layout="constrained")
axes = axes.ravel()
for ax, (name, image) in zip(axes, {"truth": true, **images}.items(), strict=False):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="gray", vmin=0, vmax=1, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)")
for ax in axes[::3]:
    ax.set_ylabel("y (mm)")
figure.colorbar(drawn, ax=axes[2], label="initial pressure (a.u.)")
for prior, course in courses.items():
    axes[5].semilogy(*zip(*course, strict=True), ".-", label=f"prior {prior}")
axes[5].axhline(1e-4, color="grey", linestyle=":", label="tolerance")
axes[5].set(title="certificate", xlabel="products with A and its adjoint", ylabel="relative gap")
axes[5].legend(fontsize=8)

# %%
# All three are certified within 1e-4 of *their* optimum, and show three bodies: a high flat prior fills the water with
# grey, a low one darkens the body. Thresholded least squares, which has neither prior nor certificate, comes as near to
# the truth as the best of them.
for name, image in images.items():
    gap = image.diagnostics["relative_gap"][0]
    nearness = psnr(image.values[0], true.values[0])
    print(f"{name:16s}  lowest pixel {image.values.min():.1e}  relative gap {gap:.0e}  PSNR {nearness:.1f} dB")
