"""What napari finds of oatkit: a valid manifest, files by drag and drop, samples, writers, and a command."""

import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import oatkit
from gui_viewers import PluginManager, PluginManifest, bench_without_window, disc_boundary, pressure, wait_for
from oatkit.cli.windows import BINDINGS
from oatkit.errors import ReadError, ValidationError
from oatkit.gui import contributions, opening, window
from oatkit.gui.images.layers import KEY
from oatkit.gui.samples import SAMPLES
from oatkit.gui.settings import Settings
from oatkit.gui.workbench import workbench
from oatkit.pipeline import preset, presets
from oatkit.result import Result
from oatkit.simulate import disc
from results import write_frames

MANIFEST = Path(oatkit.__file__).parent / "napari.yaml"


@pytest.fixture
def result_folder(tmp_path):
    """A stored result of one frame."""
    result = Result({"initial_pressure": pressure(), "boundary": disc_boundary()}, pipeline={"version": 1})
    return write_frames(tmp_path / "one.zarr", result)


def test_the_manifest_is_valid_and_all_that_it_names_exists():
    """npe2 accepts the manifest, and every command in it can be imported."""
    manifest = PluginManifest.from_file(MANIFEST)
    manifest.validate_imports()
    commands = {command.id for command in manifest.contributions.commands}
    parts = manifest.contributions
    used = [*parts.readers, *parts.writers, *parts.widgets, *parts.sample_data]
    assert {part.command for part in used} == commands
    assert {part.key for part in parts.sample_data} == set(SAMPLES)


def test_the_installed_package_tells_napari_of_the_manifest():
    """The entry point leads npe2 to the same manifest."""
    installed = PluginManifest.from_distribution("oatkit")
    assert installed.contributions == PluginManifest.from_file(MANIFEST).contributions


def test_the_preferences_offer_what_the_windows_read(monkeypatch):
    """Each setting of the manifest has a field of the same default, the presets are all, and a choice counts."""
    offered = PluginManifest.from_file(MANIFEST).contributions.configurations["windows"].properties
    assert {key: setting.default for key, setting in offered.items()} == asdict(Settings())
    assert offered["pipeline"].enum == list(presets())
    chosen = SimpleNamespace(windows=SimpleNamespace(pipeline="l1", memory_mb=32, live_preview=False))
    monkeypatch.setattr("napari.settings.get_plugin_settings", lambda name: chosen)
    bench = bench_without_window()
    assert bench.session.document.text == preset("l1")
    assert (bench.session.memo.limit_bytes, bench.live_preview) == (32_000_000, False)


def test_only_our_files_are_claimed(small_scan_file, result_folder, tmp_path):
    """Scans that a reader knows, results and pipelines are claimed; others, and stacks of files, are left to others."""
    pipeline = tmp_path / "mine.toml"
    pipeline.write_text("version = 1\n")
    table = tmp_path / "table.h5"
    table.write_bytes(b"no HDF5 at all")
    for path in (small_scan_file, result_folder, pipeline):
        assert contributions.get_reader(str(path)) is contributions.read
    for other in (str(table), str(tmp_path), str(tmp_path / "absent.msot"), [str(small_scan_file)]):
        assert contributions.get_reader(other) is None


def test_a_result_is_read_without_a_window(result_folder):
    """The reader for napari gives each image of a result as layer data, with its image and how it came about."""
    layers = contributions.read(str(result_folder))
    assert [kind for _, _, kind in layers] == ["image", "shapes"]
    data, about, _ = layers[0]
    assert np.array_equal(data, pressure().values[:, ::-1])
    assert about["metadata"][KEY]["result"].pipeline == {"version": 1}


def test_a_scan_gives_a_picture_without_a_window(small_scan_file):
    """A scan becomes the session's, and its picture shows what is in it, coarsely and without negative pixels."""
    bench = bench_without_window()
    bench.session.document.set("grid", "field_of_view_mm", 9.0)
    opening.open_path(bench, small_scan_file)
    assert bench.session.scan.frames == 2
    ((layer, key, image),) = bench.layers.shown()
    assert (image.values >= 0).all()
    truth = disc(image.grid, radius_m=3e-3)
    assert np.corrcoef(image.values.ravel(), truth.values.ravel())[0, 1] > 0.9
    assert (key, layer.name) == ("scan", f"scan {bench.session.scan.name}")


def test_a_pipeline_becomes_the_one_that_is_worked_on(tmp_path):
    """A pipeline file that is opened is the session's, and the widgets are told."""
    bench, told = bench_without_window(), []
    bench.pipeline_changed.connect(lambda: told.append(bench.session.document.text))
    path = tmp_path / "mine.toml"
    path.write_text("# mine\n" + preset("lsqr").replace("pixels = 200", "pixels = 60"))
    opening.open_path(bench, path)
    assert told == [path.read_text()]
    assert bench.session.pipeline.grid.pixels == 60


def test_a_file_that_cannot_be_read_is_one_sentence(tmp_path):
    """A damaged scan raises `ReadError` with its name; the session keeps the scan that it had."""
    path = tmp_path / "bad.msot"
    path.write_text("<no xml")
    bench = bench_without_window()
    with pytest.raises(ReadError, match=r"bad\.msot"):
        opening.open_path(bench, path)
    assert bench.session.scan is None


@pytest.mark.parametrize("ending", [".zarr", ".h5", ".ome.tif"])
def test_what_is_written_holds_the_images(result_folder, tmp_path, ending):
    """Layers of a result are written with the values of its images, in each of the formats."""
    path = tmp_path / f"copy{ending}"
    assert contributions.write(str(path), contributions.read(str(result_folder))) == [str(path)]
    if ending == ".zarr":
        found = oatkit.load(path)["initial_pressure"].values
    elif ending == ".h5":
        import h5py

        with h5py.File(path) as file:
            found = file["initial_pressure"][()]
    else:
        import tifffile

        with tifffile.TiffFile(path) as file:
            found = file.series[0].asarray()[:, ::-1]
    assert np.array_equal(found, pressure().values)


def test_other_layers_are_not_written(tmp_path):
    """Layers that are not ours are refused with a sentence, and no file is left."""
    with pytest.raises(ValidationError, match="none of the chosen layers"):
        contributions.write(str(tmp_path / "x.h5"), [(np.zeros((3, 3)), {"metadata": {}}, "image")])
    assert list(tmp_path.iterdir()) == []


def test_three_clicks_to_a_sample(make_napari_viewer_proxy, qtbot, small_scan, small_scan_file, monkeypatch, tmp_path):
    """A sample opens beside the window: its scan is the session's, its picture takes the place of the empty layer.

    A file dropped on the same viewer then replaces both; one that is damaged leaves them, and is one sentence.
    """
    monkeypatch.setattr(opening, "SAMPLES", {"breast": lambda: small_scan})
    viewer = make_napari_viewer_proxy()
    bench = workbench(viewer)
    bench.session.document.set("grid", "field_of_view_mm", 9.0)
    contributions_of(viewer, monkeypatch)
    viewer.open_sample("oatkit", "breast")
    wait_for(lambda: any(layer.name.startswith("scan") for layer in viewer.layers), qtbot)
    assert bench.session.scan is small_scan
    assert len(viewer.layers) == 1
    assert contributions.read(str(small_scan_file)) == contributions.SHOWN_ALREADY
    wait_for(lambda: bench.layers.find("scan").name == f"scan {bench.session.scan.name}", qtbot)
    assert bench.session.scan.source.endswith("small.h5")
    assert len(viewer.layers) == 1
    said = []
    monkeypatch.setattr(contributions, "show_error", said.append)
    (tmp_path / "bad.msot").write_text("<no xml")
    assert contributions.read(str(tmp_path / "bad.msot")) == contributions.SHOWN_ALREADY
    assert bench.session.scan.source.endswith("small.h5")
    assert [sentence.startswith(str(tmp_path / "bad.msot: ")) for sentence in said] == [True]


def test_the_window_opens_with_its_widgets_and_a_file(make_napari_viewer, result_folder, monkeypatch):
    """`oatkit gui FILE` shows the images of the file, and every widget of the manifest beside them."""
    monkeypatch.setattr(window.napari, "Viewer", lambda **options: make_napari_viewer(show=False))
    viewer = window.make_window(result_folder, show=False)
    assert [layer.name for layer in viewer.layers] == ["one: initial pressure", "one: boundary"]
    shown = list(viewer.window.dock_widgets)
    assert [name.removesuffix(" (oatkit)") for name in shown] == window.widget_names()


def contributions_of(viewer, monkeypatch):
    """Let the viewer of a test be the one that napari calls the current one."""
    monkeypatch.setattr("napari.current_viewer", lambda: viewer)
    manager = PluginManager.instance()
    if "oatkit" not in manager:
        manager.register(PluginManifest.from_file(MANIFEST))


def oatkit_gui(code: str, **environment: str) -> subprocess.CompletedProcess:
    """Run `oatkit gui` in a fresh interpreter after some code."""
    script = f"{code}\nimport sys; sys.argv = ['oatkit', 'gui']\nfrom oatkit.cli import main; main()"
    known = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        capture_output=True, text=True, timeout=120, env={**known, **environment},
    )  # fmt: skip


@pytest.mark.parametrize(("modules", "words"), [(("napari",), "napari"), (BINDINGS, "a Qt binding")])
def test_without_napari_or_qt_the_command_says_how_to_get_them(modules, words):
    """`oatkit gui` exits with 2 and one sentence that holds the pip line, with a display or without."""
    done = oatkit_gui(f"import sys; sys.modules.update(dict.fromkeys({modules!r}))")
    assert done.returncode == 2
    assert f"needs {words}, not installed" in done.stderr
    assert 'pip install "oatkit[all]"' in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only there a display can be missing")
def test_without_a_display_the_command_says_so():
    """Where there is no display `oatkit gui` exits with 2 and a sentence, before Qt aborts the process."""
    done = oatkit_gui("import os; os.environ.pop('QT_QPA_PLATFORM', None)")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "no display" in done.stderr
