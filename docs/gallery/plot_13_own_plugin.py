"""A plugin of one's own
=====================

**Lesson: a class of a few lines is a plugin, works in every place where ours do, and one call says whether it keeps
what users rely on.**
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.sparse.linalg import LinearOperator

from oatkit import Geometry, Memo, Pipeline, plugin, run
from oatkit.api import Quadratic
from oatkit.metrics import psnr
from oatkit.simulate import arc_detectors, simulate_scan, truth
from oatkit.testing import Violations, check_plugin


class Slope(Quadratic):
    """The squared differences of neighbouring pixels, |D x|^2: Tikhonov's penalty on slopes."""

    name = "slope"

    def value(self, image):
        """Return |D x|^2."""
        return float((np.diff(image, axis=0) ** 2).sum() + (np.diff(image, axis=1) ** 2).sum())

    def operator(self, shape):
        """Return D as a scipy ``LinearOperator``."""
        ny, nx = shape
        cut = (ny - 1) * nx

        def forward(image):
            image = image.reshape(shape)
            return np.concatenate([np.diff(image, axis=0).ravel(), np.diff(image, axis=1).ravel()])

        def adjoint(steps):
            along_y = np.diff(np.pad(steps[:cut].reshape(ny - 1, nx), ((1, 1), (0, 0))), axis=0)
            along_x = np.diff(np.pad(steps[cut:].reshape(ny, nx - 1), ((0, 0), (1, 1))), axis=1)
            return -(along_y + along_x).ravel()

        return LinearOperator((cut + ny * (nx - 1), ny * nx), matvec=forward, rmatvec=adjoint, dtype=float)


# %%
# No word is a good word. A slip is told in a sentence: here, squares that were forgotten. So are two faults of form.
check_plugin(Slope)


class Slipped(Slope):
    """The same, with a slip."""

    name = "slipped"

    def value(self, image):
        """Return the sum of the differences, without their squares."""
        return float(abs(np.diff(image, axis=0)).sum() + abs(np.diff(image, axis=1)).sum())


try:
    check_plugin(Slipped)
except Violations as violations:
    print(violations)

# %%
# It stands where a built-in stands: as the regularizer of a solver, in a pipeline. Few detectors and much noise give it
# something to do, and each penalty gets the best of five weights, which only a simulation knows.
geometry = Geometry(arc_detectors(48), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
scan = simulate_scan("star", plugin("forward_model", "arc")(), geometry=geometry, snr_db=0)
pipeline = Pipeline.load("lsqr", ["grid.pixels=100", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3"])
true, memo, best = truth("star", pipeline.grid.grid()), Memo(), {}
for regularizer in (plugin("regularizer", "identity")(), Slope(), plugin("regularizer", "laplacian")()):
    for weight in (0.003, 0.01, 0.03, 0.1, 0.3):
        solver = plugin("solver", "lsqr")(regularizer=regularizer, weight=weight)
        image = run(pipeline.with_solver(solver), scan, memo=memo)["initial_pressure"]
        nearness = psnr(image.values[0], true.values[0])
        best[regularizer.name] = max(best.get(regularizer.name, (0,)), (nearness, weight, image), key=lambda b: b[0])
for name, (nearness, weight, _) in best.items():
    print(f"{name:9s}  PSNR {nearness:.1f} dB at weight {weight}")

# %%
figure, axes = plt.subplots(2, 2, figsize=(9, 7.4), layout="constrained")
axes = axes.ravel()
shown = {"truth": true} | {f"{name}, {nearness:.1f} dB": image for name, (nearness, _, image) in best.items()}
for ax, (name, image) in zip(axes, shown.items(), strict=True):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    drawn = ax.imshow(image.values[0], cmap="RdBu_r", vmin=-1, vmax=1, origin="lower", extent=extent)
    ax.set(title=name, xlabel="x (mm)", ylabel="y (mm)")
figure.colorbar(drawn, ax=axes, label="initial pressure (a.u.)", extend="max")
