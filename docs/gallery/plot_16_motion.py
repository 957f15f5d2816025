"""Motion between wavelengths
==========================

**Lesson: a breath between two pulses looks like a spectrum. It shows in the signals, before anything is
reconstructed.**

Wavelengths are taken one after another. A body that moves by two pixels in between gets edges with spectra that no
tissue has.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from oatkit import Geometry, Grid, Image, Pipeline, plugin, run
from oatkit.motion import find_motion
from oatkit.simulate import arc_detectors, breast, simulate_scan

nm = (700.0, 740.0, 780.0, 820.0, 860.0)
arc = plugin("forward_model", "arc")()
geometry = Geometry(arc_detectors(64), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1500)


def lying_at(y_m):
    """Return a phantom that is the same at all wavelengths and lies so much higher up."""

    def body(grid):
        plane = breast(Grid(grid.shape, grid.pixel_size_m, (-y_m, 0.0))).values
        return Image(np.repeat(plane, len(nm), axis=0), "initial_pressure", "a.u.", grid, nm)

    return body


# %%
# Eight frames of five wavelengths, and three pulses taken while the body was 0.3 mm higher up.
rest, moved = (
    simulate_scan(lying_at(y), arc, geometry=geometry, pixels=331, frames=8, snr_db=10) for y in (0.0, 0.3e-3)
)
signals = np.array(rest.signals)
for pulse in ((2, 1), (2, 2), (5, 4)):
    signals[pulse] = moved.signals[pulse]
scan = replace(rest, signals=signals)
motion = find_motion(scan)
for frame in motion.frames:
    print("\n".join(motion.of_frame(frame)))

# %%
# The body is as bright at 740 nm as at 700 nm, so that their difference should be nothing but noise.
changes = ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"]
pipeline = Pipeline.load("lsqr", [*changes, "scan.wavelengths_nm=[700, 740]"])
images = {f"frame {frame}": run(pipeline, scan, frame=frame)["initial_pressure"] for frame in (1, 2)}

figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained", width_ratios=(1.1, 1, 1))
drawn = axes[0].imshow(motion.correlation.T, vmin=0, vmax=1, origin="lower", aspect="auto")
axes[0].plot(*np.argwhere(motion.moved).T, "rx", markersize=10, label="out of place")
axes[0].set(xlabel="frame", ylabel="wavelength (nm)", title="likeness to the pulses beside it")
axes[0].set_yticks(range(len(nm)), [f"{w:g}" for w in nm])
axes[0].legend()
figure.colorbar(drawn, ax=axes[0], label="correlation")
for ax, (name, image) in zip(axes[1:], images.items(), strict=True):
    extent = [1e3 * edge for edge in image.grid.extent_m]
    change = image.values[1] - image.values[0]
    drawn = ax.imshow(change, cmap="RdBu_r", vmin=-0.5, vmax=0.5, origin="lower", extent=extent)
    ax.set(title=f"{name}\n740 nm minus 700 nm", xlabel="x (mm)", ylabel="y (mm)")
figure.colorbar(drawn, ax=axes[2], label="initial pressure (a.u.)")
