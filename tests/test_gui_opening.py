"""What comes with a scan: finished images and regions, out of sight beside the scan, in sight where there is none."""

# First, since it skips this module where napari is missing.
from gui_viewers import bench_without_window, pressure  # isort: split

import numpy as np
import pytest

import oatkit
from oatkit import ReadError
from oatkit.gui.images.layers import KEY
from oatkit.gui.images.side_by_side import SideBySide
from oatkit.gui.images.world import from_world
from oatkit.gui.opening import SCAN, SCANNER, open_path
from patato_files import write_patato


@pytest.fixture
def quick(monkeypatch):
    """A first picture that takes no time; what it shows is of no matter here."""
    monkeypatch.setattr("oatkit.gui.opening.quick_look", lambda scan, frame, pipeline: pressure())


@pytest.fixture
def path(tmp_path):
    """A file of PATATO with signals, finished images of three frames, and regions."""
    return write_patato(tmp_path / "scan.hdf5")


def test_finished_images_come_with_the_scan_out_of_sight(path, quick):
    """Each finished image of the file is a layer of the group of the scanner, with its values, not seen at first."""
    bench = bench_without_window()
    open_path(bench, path)
    stored, layers = oatkit.read_images(path), bench.layers.groups()[SCANNER]
    readable = {name.replace("/", " "): frames for name, frames in stored.items() if can_be_read(frames)}
    assert set(layers) == set(readable)
    for name, frames in readable.items():
        layer = layers[name]
        assert not layer.visible
        assert layer.data.shape[0] == len(frames) if len(frames) > 1 else True
        shown = np.asarray(layer.data[1] if len(frames) > 1 else layer.data)
        expected = frames[1 if len(frames) > 1 else 0].values[:, ::-1]
        assert np.array_equal(shown.reshape(expected.shape), expected, equal_nan=True)
    assert bench.layers.find(SCAN).visible
    assert bench.viewer.layers.selection.active is bench.layers.find(SCAN)


def can_be_read(frames):
    """Whether the first frame can be had."""
    try:
        frames[0]
    except ReadError:
        return False
    return True


def test_regions_come_with_the_scan(path, quick):
    """The outlines of the regions of the file lie where they were drawn, with their names."""
    bench = bench_without_window()
    open_path(bench, path)
    layer, regions = bench.layers.find_drawing(SCANNER), oatkit.read_regions(path)
    assert [str(name) for name in layer.features["name"]] == [region.name for region in regions]
    for line, region in zip(layer.data, regions, strict=True):
        assert np.allclose(from_world(line), region.outline_m, atol=1e-8)
    assert not layer.visible


def test_another_scan_takes_all_of_the_old_one_away(path, small_scan_file, quick):
    """Results, finished images and regions of the scan before go; what was kept stays, and tiles end."""
    bench = bench_without_window()
    open_path(bench, path)
    kept = oatkit.result.Result({"initial_pressure": pressure(1)})
    bench.layers.show_result(kept)
    bench.layers.show_result(kept, "kept")
    bench.layers.show(pressure(2), "difference")
    beside: SideBySide = bench.side_by_side
    beside.begin({bench.layers.find("initial_pressure"): "a"}, "comparison")
    open_path(bench, small_scan_file)
    assert {layer.metadata[KEY]["key"] for layer in bench.viewer.layers} == {SCAN, "kept/initial_pressure"}
    assert not beside.active


def test_a_file_without_signals_shows_what_it_has(tmp_path):
    """Results of PATATO without raw data are seen at once; a damaged file that has none is refused as before."""
    import h5py

    path = write_patato(tmp_path / "results.hdf5")
    with h5py.File(path, "a") as file:
        del file["raw_data"]
    bench = bench_without_window()
    open_path(bench, path)
    assert bench.session.scan is None
    assert any(layer.visible for layer in bench.layers.groups()[SCANNER].values())
    with h5py.File(path, "a") as file:
        for name in [name for name in file if name not in ("wavelengths",)]:
            del file[name]
    with pytest.raises(ReadError):
        open_path(bench_without_window(), path)
