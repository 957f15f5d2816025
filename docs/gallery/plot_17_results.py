"""A result that can be checked
============================

**Lesson: a result knows how it was made, and notices a single bit that changed.**
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import oatkit
from oatkit import Geometry, Pipeline, plugin, run
from oatkit.export import export
from oatkit.simulate import arc_detectors, simulate_scan

geometry = Geometry(arc_detectors(64), sampling_rate_hz=20e6, n_samples=1015, speed_of_sound_m_s=1520)
scan = simulate_scan("breast", plugin("forward_model", "arc")(), geometry=geometry)
changes = ["grid.pixels=128", "grid.field_of_view_mm=20", "preprocess.band-pass.high=3.9"]
result = run(Pipeline.load("maxent", changes), scan)

temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)
result.save(folder / "out.zarr")
export(folder / "out.zarr", folder / "out.png")
print("wrong with it:", oatkit.verify(folder / "out.zarr"))

# %%
# The result holds the pipeline as it was run, the versions of all that took part, and where the scan came from. Run
# again, the same pipeline gives the same image, bit by bit.
saved = oatkit.load(folder / "out.zarr")
print(saved.scan["source"])
print({name: saved.pipeline["reconstruct"][name] for name in ("use", "weight", "prior", "tolerance")})
print({name: saved.versions[name] for name in ("oatkit", "numpy", "python")})
again = run(Pipeline.of_table(saved.pipeline), scan)
print("the same, bit by bit:", (again["initial_pressure"].values == saved["initial_pressure"].values).all())

# %%
# One bit, somewhere in the image:
chunk = max((path for path in (folder / "out.zarr").rglob("*") if path.is_file()), key=lambda path: path.stat().st_size)
content = bytearray(chunk.read_bytes())
content[len(content) // 2] ^= 1
chunk.write_bytes(content)
print("wrong with it:", [line.replace(f"{folder}/", "") for line in oatkit.verify(folder / "out.zarr")])

# %%
# What ``export`` wrote:
figure, ax = plt.subplots(figsize=(6, 6), layout="constrained")
ax.imshow(plt.imread(folder / "out.png"))
ax.set_axis_off()
temporary.cleanup()
