"""One scan in five formats
========================

**Lesson: signals and geometry come back bit for bit from each format. What differs is what a format knows besides, and
the notes of a scan say what was taken for granted.**

iThera's ``.msot`` is read, too, but not written; see :doc:`/guides/formats`.
"""

import tempfile
from pathlib import Path

import h5py
import matplotlib.pyplot as plt
import numpy as np
import tifffile

import oatkit
from oatkit import Geometry, plugin
from oatkit.convert import convert
from oatkit.simulate import arc_detectors, simulate_scan

geometry = Geometry(arc_detectors(64), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1480)
scan = simulate_scan("vessel", plugin("forward_model", "arc")(), geometry=geometry, frames=2)
temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)

# %%
# oatkit writes two formats, and says what a format has no field for.
for file in ("oatkit.h5", "ipasc.hdf5"):
    print(file, *convert(scan, folder / file))

# %%
# Plain arrays are described by a TOML file beside them.
description = """
version = 1

[signals]
file = "{}"
axes = ["frame", "wavelength", "detector", "sample"]
wavelengths_nm = [700]
sampling_rate_mhz = 20
speed_of_sound_m_s = 1480

[arc]
radius_mm = 40.5
coverage_degrees = 270
count = 64
"""
np.save(folder / "numpy.npy", scan.signals)
tifffile.imwrite(folder / "pages.tif", scan.signals)
for file in ("numpy.npy", "pages.tif"):
    (folder / file).with_suffix(".toml").write_text(description.format(file))

# %%
# The HDF5 file of PATATO, with no more in it than its reader needs.
with h5py.File(folder / "patato.h5", "w") as file:
    file["raw_data"] = scan.signals
    file["raw_data"].attrs.update(fs=geometry.sampling_rate_hz, speedofsound=geometry.speed_of_sound_m_s)
    file["wavelengths"] = scan.wavelengths_nm
    file["GEOMETRY"] = np.pad(geometry.detectors.positions_m[:, ::-1], ((0, 0), (0, 1)))  # (x, y, z)

# %%
# ``oatkit.read`` finds the reader by the file's content.
read = {file: oatkit.read(folder / file) for file in ("oatkit.h5", "ipasc.hdf5", "numpy.npy", "pages.tif", "patato.h5")}
for file, found in read.items():
    same = np.array_equal(found.signals[:], scan.signals) and found.geometry == scan.geometry
    print(f"\n{file}, by the reader '{found.reader}': {'the same' if same else 'different'}")
    print(*found.notes, sep="\n")

# %%
# All signals of the first frame, and those of detector 40 as each file gives them, one above the other.
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained", sharex=True)
size = abs(scan.signals[0, 0]).max()
style = {"cmap": "RdBu_r", "vmin": -0.5, "vmax": 0.5, "aspect": "auto", "origin": "lower"}
drawn = left.imshow(scan.signals[0, 0] / size, extent=(0, 1e6 * geometry.times_s[-1], 0, 64), **style)
figure.colorbar(drawn, ax=left, label="signal, relative to the largest", extend="both")
left.set(xlabel="time (µs)", ylabel="detector", xlim=(20, 35))
for number, found in enumerate(read.values()):
    right.plot(1e6 * found.geometry.times_s, found.signals[0, 0, 40] / size + number, linewidth=1)
right.set(xlabel="time (µs)", title="detector 40, by file")
right.set_yticks(range(len(read)), list(read))
temporary.cleanup()
