"""Exports: other programs find the right numbers, the right way up, in the right units; and figures tell the truth."""

import io
import json
import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile
from PIL import Image as Picture

from oatkit.atomic import new_file
from oatkit.data import Grid, Image
from oatkit.drawing.page import png
from oatkit.drawing.sheet import MARGIN, WIDEST, Panel, scale_of, sheet
from oatkit.errors import ResultError, ValidationError
from oatkit.export import export
from oatkit.figure import compare, image_figure, write_comparison
from oatkit.result import Result
from results import GRID, WAVELENGTHS_NM, make_result, pressure, write_frames

RED = (255, 0, 0)


def _dots(figure: object) -> np.ndarray:
    """Return a figure as a viewer shows it, shape ``(row, column, 3)``, row 0 at the top."""
    return np.asarray(Picture.open(io.BytesIO(png(figure))).convert("RGB"))  # type: ignore[arg-type]


def _red(dots: np.ndarray) -> np.ndarray:
    return np.asarray((dots == RED).all(axis=-1))


def _texts(figure: object) -> str:
    return "\n".join(text.get_text() for text in figure.texts)  # type: ignore[attr-defined]


def _one_plane(values: np.ndarray, grid: Grid, quantity: str = "initial_pressure") -> Image:
    return Image(np.asarray(values, float), quantity, "a.u.", grid, (700.0,))


def test_an_ome_tiff_has_size_unit_and_orientation(tmp_path: Path) -> None:
    """Tifffile reads a series for each image, bit-equal, row 0 at the top, with pixels in um and named channels."""
    result = make_result()
    export(result, tmp_path / "out.ome.tif")
    with tifffile.TiffFile(tmp_path / "out.ome.tif") as file:
        described = tifffile.xml2dict(file.ome_metadata)["OME"]["Image"]
        series = {one.name: one.asarray() for one in file.series}
        assert [one.axes for one in file.series] == ["CYX", "CYX"]
    assert list(series) == list(result)
    for name, image in result.items():
        assert series[name].tobytes() == np.ascontiguousarray(image.values[:, ::-1]).tobytes()
    for one in described:
        pixels = one["Pixels"]
        assert (pixels["PhysicalSizeX"], pixels["PhysicalSizeY"]) == (125.0, 125.0)
        assert (pixels["PhysicalSizeXUnit"], pixels["PhysicalSizeYUnit"]) == ("µm", "µm")
        assert [channel["Name"] for channel in pixels["Channel"]] == ["700 nm", "757.5 nm"]


def test_an_hdf5_file_says_what_it_holds(tmp_path: Path) -> None:
    """h5py reads every image bit-equal with unit, pixel size, position and wavelengths, and the provenance as JSON."""
    result = make_result()
    export(result, tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        for name, image in result.items():
            assert file[name][()].tobytes() == image.values.tobytes()
            found = dict(file[name].attrs)
            assert (found["unit"], found["quantity"]) == (image.unit.encode(), name.encode())
            assert found["row_0"] == b"bottom"
            assert found["pixel_size_m"] == GRID.pixel_size_m
            assert tuple(found["centre_m"]) == GRID.centre_m
            assert tuple(found["wavelengths_nm"]) == WAVELENGTHS_NM
        provenance = json.loads(file["provenance"][0])
    assert provenance["pipeline"]["reconstruct"] == dict(result.pipeline["reconstruct"])
    assert provenance["images"]["initial_pressure"]["diagnostics"]["relative_gap"] == [3.4e-5, {"$float": "inf"}]
    assert provenance["scan"]["speed_of_sound_m_s"] == 1469.3


def test_an_image_without_unit_and_wavelength_can_be_exported(tmp_path: Path) -> None:
    """A pure number that belongs to no wavelength goes into every format."""
    saturation = Image(np.full(GRID.shape, 0.6), "so2", "", GRID)
    for name in ("out.h5", "out.ome.tif", "out.png"):
        export(Result({"so2": saturation}), tmp_path / name)
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["so2"].attrs["unit"] == b""
        assert file["so2"].attrs["wavelengths_nm"].size == 0


def test_a_flipped_bit_in_the_numbers_of_an_hdf5_file_is_an_error(tmp_path: Path) -> None:
    """Every dataset has a checksum: h5py refuses what was changed. No string escapes it by a variable length."""
    result = make_result()
    export(result, tmp_path / "out.h5")
    whole = (tmp_path / "out.h5").read_bytes()
    with h5py.File(tmp_path / "out.h5") as file:
        places = {name: file[name].id.get_chunk_info(0).byte_offset for name in file}
        assert h5py.check_string_dtype(file["provenance"].dtype).length is not None
    assert set(places) == {*result, "provenance"}
    for name, place in places.items():
        damaged = bytearray(whole)
        damaged[place + 5] ^= 4
        (tmp_path / "bad.h5").write_bytes(damaged)
        with h5py.File(tmp_path / "bad.h5") as file, pytest.raises(OSError, match="filter returned failure"):
            file[name][()]


@pytest.mark.parametrize("shape", [(40, 50), (200, 200), (37, 33), (3, 701)])
def test_red_is_where_negative_pixels_are(tmp_path: Path, shape: tuple[int, int]) -> None:
    """In the picture pure red covers the squares of negative pixels, the right way up, and not one dot more."""
    grid = Grid(shape, 1e-4)
    values = np.random.default_rng(3).standard_normal(grid.shape)
    export(Result({"initial_pressure": _one_plane(values, grid)}), tmp_path / "out.png")
    red = _red(np.asarray(Picture.open(tmp_path / "out.png").convert("RGB")))
    rows, columns = np.nonzero(red)
    dots = red.sum() // (values < 0).sum()
    side = int(dots**0.5)
    squares = np.kron(values[::-1] < 0, np.ones((side, side), bool))
    top = rows.min() - side * np.nonzero((values[::-1] < 0).any(axis=1))[0][0]
    left = columns.min() - side * np.nonzero((values < 0).any(axis=0))[0][0]
    np.testing.assert_array_equal(red[top : top + squares.shape[0], left : left + squares.shape[1]], squares)
    assert red.sum() == squares.sum()


def test_one_negative_pixel_among_many_is_red_and_counted() -> None:
    """A single pixel of -1e-300 in an image of 700 x 700 is seen and counted."""
    grid = Grid((700, 700), 5e-5)
    values = np.ones(grid.shape)
    values[123, 456] = -1e-300
    figure = image_figure(Result({"initial_pressure": _one_plane(values, grid)}))
    assert "1 negative pixel (0.0 %)" in _texts(figure)
    assert _red(_dots(figure)).sum() == 1


def test_there_is_no_red_without_negative_pixels() -> None:
    """Zeros of either sign, positive pixels and pixels without a value are not red; nor is a signed distance."""
    values = np.abs(np.random.default_rng(0).standard_normal((30, 30)))
    values[0], values[1], values[2, :5] = 0.0, -0.0, np.nan
    grid = Grid((30, 30), 1e-4)
    images = {
        "absorption": _one_plane(values, grid, "absorption"),
        "boundary": _one_plane(values - 1, grid, "boundary"),
    }
    figure = image_figure(Result(images))
    assert _texts(figure).count("negative") == _texts(figure).count("no negative pixels") == 1
    assert not _red(_dots(figure)).any()


def test_a_figure_says_how_the_image_came_about() -> None:
    """It tells wavelength, count, certificate, convergence, solver, weight and its rule, speed of sound and version."""
    result = make_result()
    text = _texts(image_figure(result))
    for i, plane in enumerate(result["initial_pressure"].values):
        count = (plane < 0).sum()
        assert f"initial pressure, {WAVELENGTHS_NM[i]:g} nm" in text
        assert f"{count} negative pixels ({100 * count / plane.size:.1f} %)" in text
    assert text.count("certified within 3.4e-05 of the optimum") == 1
    assert text.count("uncertified\ndid not converge") == 1
    for words in ("maxent-nlcg", "weight 0.00923 (by l-curve)", "1469.3 m/s", "(header)", "oatkit 0.1.0"):
        assert words in text.replace("\n", " "), words


def test_panels_share_one_scale() -> None:
    """In a comparison equal values have equal grey, from 0 in black to the 99.9th percentile of all in white."""
    grid = Grid((64, 64), 2e-4)
    panels = [(name, _one_plane(np.full(grid.shape, value), grid), ()) for name, value in (("a", 1.0), ("b", 4.0))]
    figure = compare(panels)
    dots = _dots(figure)
    greys = []
    for axes in figure.axes[:2]:
        box = axes.get_window_extent()
        greys.append(dots[int(dots.shape[0] - (box.y0 + box.y1) / 2), int((box.x0 + box.x1) / 2), 0])
    assert greys == [64, 255]  # of 256 greys, the one at a quarter and the last


def test_a_scale_bar_is_as_long_as_it_says() -> None:
    """The bar's length in dots over the panel's is its label over the field of view, and the label is 1, 2 or 5."""
    for pixel_m, label in ((1e-4, 2.0), (2.5e-4, 5.0), (1e-5, 0.2)):
        grid = Grid((100, 100), pixel_m)
        figure = compare([("a", _one_plane(np.ones(grid.shape), grid), ())])
        left, right = figure.findobj(lambda artist: artist.get_label() == "scale bar")[0].get_xdata()
        panel = figure.axes[0].get_position().width
        assert f"{label:g} mm" in _texts(figure)
        assert (right - left) / panel == pytest.approx(label / (100 * pixel_m * 1e3), rel=1e-12)


def test_a_comparison_shows_the_lines_it_was_given(tmp_path: Path) -> None:
    """Titles, lines and caption appear as written, dollar signs too; the file is a PNG and is not overwritten."""
    panels = [("truth", pressure(), ["the phantom"]), ("max$ent$", pressure(1), ["PSNR 30.35 dB", "SSIM 0.9"])]
    text = _texts(compare(panels, "A title", "a caption"))
    for words in ("truth", "the phantom", "max$ent$", "PSNR 30.35 dB", "SSIM 0.9", "A title", "a caption"):
        assert words in text
    write_comparison(tmp_path / "demo.png", panels)
    assert (tmp_path / "demo.png").read_bytes() == png(compare(panels))
    with pytest.raises(ResultError, match="exists already"):
        write_comparison(tmp_path / "demo.png", panels)
    with pytest.raises(ValidationError, match="at least one panel"):
        compare([])


@pytest.mark.parametrize("quantity", ["initial_pressure", "boundary"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_an_image_without_contrast_can_be_drawn(quantity: str, value: float) -> None:
    """All zero, all negative and all undefined images give a picture, without a warning."""
    grid = Grid((8, 8), 1e-4)
    dots = _dots(image_figure(Result({"it": _one_plane(np.full(grid.shape, value), grid, quantity)})))
    assert _red(dots).any() == (value < 0 and quantity == "initial_pressure")


def test_a_frame_of_a_stored_result_can_be_exported(tmp_path: Path) -> None:
    """`export` takes a path and a frame; a failed one says why, and one that is not there is named."""
    folder = write_frames(tmp_path / "out.zarr", make_result(0), "dark", make_result(2))
    export(folder, tmp_path / "two.h5", frame=2)
    with h5py.File(tmp_path / "two.h5") as file:
        assert file["initial_pressure"][()].tobytes() == pressure(2).values.tobytes()
    with pytest.raises(ResultError, match="frame 1 failed: dark"):
        export(folder, tmp_path / "one.h5", frame=1)
    with pytest.raises(ValidationError, match="frame 3"):
        export(folder, tmp_path / "three.h5", frame=3)
    assert not (tmp_path / "one.h5").exists()


def test_the_first_good_frame_is_exported_where_none_is_asked_for(tmp_path: Path) -> None:
    """Where frames 0 and 1 failed it is frame 2, of every format."""
    folder = write_frames(tmp_path / "out.zarr", "dark", "dark", make_result(2), make_result(3))
    for name in ("out.png", "out.ome.tif", "out.h5"):
        export(folder, tmp_path / name)
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["initial_pressure"][()].tobytes() == pressure(2).values.tobytes()


def test_an_unknown_ending_names_those_that_exist(tmp_path: Path) -> None:
    """A file name that says no format is refused with the list of formats."""
    for name in ("out.jpg", "out.tif", "out", "png"):
        with pytest.raises(ValidationError, match=r"must end in one of \.png, \.ome\.tif, \.ome\.tiff, \.h5"):
            export(make_result(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_kept_unless_asked_otherwise(tmp_path: Path) -> None:
    """Exports refuse an existing file, replace it on demand, and never the scan, nor write into the result."""
    file = tmp_path / "out.h5"
    file.write_text("precious")
    with pytest.raises(ResultError, match="exists already"):
        export(make_result(), file)
    with pytest.raises(ResultError, match="is the input"):
        export(make_result(scan={"source": str(file)}), file, overwrite=True)
    assert file.read_text() == "precious"
    export(make_result(), file, overwrite=True)
    assert h5py.is_hdf5(file)
    folder = write_frames(tmp_path / "out.zarr", make_result())
    with pytest.raises(ResultError, match="lies inside the input"):
        export(folder, folder / "out.png")


def test_a_file_that_appears_meanwhile_is_kept(tmp_path: Path) -> None:
    """A name that is taken while the file is being written is refused at the end too, and nothing hidden stays."""

    def write_late() -> None:
        with new_file(tmp_path / "out.h5") as hidden:
            hidden.write_text("late")
            (tmp_path / "out.h5").write_text("precious")

    with pytest.raises(ResultError) as caught:
        write_late()
    text = f"{tmp_path}/out.h5: exists already; choose another name, or ask to overwrite it"
    assert str(caught.value) == text
    assert [path.read_text() for path in tmp_path.iterdir()] == ["precious"]


def test_a_folder_is_never_replaced_by_a_file(tmp_path: Path) -> None:
    """Even where overwriting is asked for."""
    (tmp_path / "out.h5").mkdir()
    with pytest.raises(ResultError, match=r"out\.h5: is a folder, not a file$"):
        export(make_result(), tmp_path / "out.h5", overwrite=True)


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the disk refuses, the old file is whole and no hidden one stays."""
    file = tmp_path / "out.h5"
    file.write_text("precious")

    def refuse(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(ResultError, match="could not be written: No space left on device"):
        export(make_result(), file, overwrite=True)
    assert file.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [file]


def test_without_matplotlib_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure without matplotlib is one sentence that says what to install; the other formats go on."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "oatkit.drawing.page", raising=False)
    monkeypatch.delitem(sys.modules, "oatkit.figure", raising=False)
    with pytest.raises(ResultError, match=r'pip install "oatkit\[report\]"'):
        export(make_result(), tmp_path / "out.png")
    export(make_result(), tmp_path / "out.h5")


def test_drawing_touches_no_global_state() -> None:
    """A figure is drawn without pyplot (so without a display) and without a change to matplotlib's settings."""
    code = """
import sys
import matplotlib
before = dict(matplotlib.rcParams.copy())
from oatkit.figure import compare
from oatkit.drawing.page import png
from results import pressure
png(compare([("a", pressure(), ())]))
assert "matplotlib.pyplot" not in sys.modules
after = dict(matplotlib.rcParams.copy())
assert {key for key in before if before[key] != after[key]} == set()
"""
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parent)


def test_a_large_picture_of_many_wavelengths_wraps() -> None:
    """Eight wavelengths make a row of six and one of two, in one scale: eight panels and two colour bars."""
    wavelengths = (700.0, 730.0, 740.0, 750.0, 760.0, 800.0, 850.0, 900.0)
    values = np.repeat(pressure().values[:1], 8, axis=0)
    figure = image_figure(Result({"p": replace(pressure(), values=values, wavelengths_nm=wavelengths, diagnostics={})}))
    tops = sorted({round(axes.get_position().y0, 6) for axes in figure.axes})
    assert len(figure.axes) == 10
    assert len(tops) == 2


def chromophores() -> Result:
    """Images that belong to no wavelength beside one that does; so2 has no value in a corner."""
    rng = np.random.default_rng(4)
    so2 = np.where(np.add.outer(range(24), range(30)) < 9, np.nan, rng.uniform(0.2, 0.3, (24, 30)))
    planes = {
        "oxyhaemoglobin": (rng.random((24, 30)), "mol/m^3"),
        "so2": (so2, ""),
        "so2_sensitivity_scattering": (rng.normal(0, 0.01, (24, 30)), ""),
    }
    made = {
        name: Image(values.astype(np.float32), name, unit, GRID, diagnostics={"fitted_to": "absorption"})
        for name, (values, unit) in planes.items()
    }
    return Result({"initial_pressure": pressure(), **made})


def test_chromophores_keep_unit_axes_and_undefined_pixels(tmp_path: Path) -> None:
    """In HDF5 and OME-TIFF each is one plane of no wavelength, named as it is, with its unit; NaN stays NaN."""
    result = chromophores()
    export(result, tmp_path / "x.h5")
    export(result, tmp_path / "x.ome.tif")
    with h5py.File(tmp_path / "x.h5") as file, tifffile.TiffFile(tmp_path / "x.ome.tif") as tiff:
        series = {one.name: one for one in tiff.series}
        described = {one["Name"]: one for one in tifffile.xml2dict(tiff.ome_metadata)["OME"]["Image"]}
        for name in ("oxyhaemoglobin", "so2"):
            image = result[name]
            assert file[name].shape == (1, 24, 30)
            assert file[name].attrs["wavelengths_nm"].shape == (0,)
            assert file[name].attrs["unit"].decode() == image.unit
            assert np.array_equal(file[name][()], image.values, equal_nan=True)
            assert series[name].axes == "YX"
            assert np.array_equal(series[name].asarray(), image.values[0, ::-1], equal_nan=True)
            assert described[name]["Pixels"]["Channel"]["Name"] == name
            assert f"{name} in {image.unit or 'no unit'}" in described[name]["Description"]
        assert np.isnan(file["so2"][0, 0, 0])
        assert not np.isnan(file["so2"][0, -1, -1])


def test_saturation_is_drawn_from_0_to_1() -> None:
    """Equal so2 has equal colour in every figure, that of its place in 0 .. 1, however little of it an image uses."""
    so2 = chromophores()["so2"]
    scale = scale_of(so2, so2.values)
    assert (scale.normalise.vmin, scale.normalise.vmax) == (0, 1)
    narrow = scale_of(so2, so2.values[:, :2])
    values = np.array([[0.0, 0.25, 1.0]])
    none = np.zeros(values.shape, bool)
    assert np.array_equal(scale.paint(values, none), narrow.paint(values, none))
    brightness = scale.paint(np.linspace(0, 1, 9)[None], np.zeros((1, 9), bool))[0, :, :3] @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(brightness) > 0).all()


def test_a_sensitivity_is_negative_by_nature() -> None:
    """It has white at zero, equal ends, no red for negative pixels, and none of them counted."""
    result = chromophores()
    image = result["so2_sensitivity_scattering"]
    scale = scale_of(image, image.values)
    assert scale.normalise.vmin == -scale.normalise.vmax < 0
    assert np.allclose(scale.paint(np.zeros((1, 1)), np.zeros((1, 1), bool))[0, 0, :3], 1, atol=0.05)
    figure = image_figure(Result({"so2_sensitivity_scattering": image}))
    assert not any("negative" in text.get_text() for text in figure.texts)
    assert not Panel("", image).negative.any()


def test_images_of_no_wavelength_share_a_row() -> None:
    """They stand below those of many wavelengths, whatever their order in the result, and do not overlap."""
    images = chromophores().images
    mixed = {name: images[name] for name in ("oxyhaemoglobin", "initial_pressure", "so2", "so2_sensitivity_scattering")}
    boxes = [axes.get_position() for axes in image_figure(Result(mixed)).axes]
    pictures = [box for box in boxes if box.width > 0.05]
    rows = sorted({round(box.y0, 6) for box in pictures})
    assert [sum(round(box.y0, 6) == row for box in pictures) for row in rows] == [3, 2]
    lower = sorted((box for box in pictures if round(box.y0, 6) == rows[0]), key=lambda box: box.x0)
    assert all(left.x1 < right.x0 for left, right in pairwise(lower))


@pytest.mark.parametrize("columns", [30, 200, 700, 1300])
def test_a_row_is_no_wider_than_a_page(columns: int) -> None:
    """Many wavelengths of any size wrap before the widest row is passed, unless one panel alone passes it."""
    wavelengths = tuple(700.0 + 10 * i for i in range(7))
    grid = Grid((4, columns), 1e-5)
    image = Image(np.ones((7, 4, columns)), "initial_pressure", "a.u.", grid, wavelengths)
    figure = sheet([[Panel(f"panel {i}", image, wavelength=i) for i in range(7)]])
    assert _texts(figure).count("panel") == 7
    alone = sheet([[Panel("", image)]])
    assert figure.bbox.width <= max(WIDEST + 2 * MARGIN, alone.bbox.width)
