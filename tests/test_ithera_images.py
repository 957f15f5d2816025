"""What iThera's software leaves beside a scan: stored images, ultrasound, regions of interest."""

import json

import numpy as np
import pytest

import oatkit
from msot_files import field_of_view, header, msp_node, nodes, recon_node, write
from oatkit.builtin.readers.ithera import IThera
from oatkit.data import Grid
from oatkit.errors import ReadError
from oatkit.regions import EllipseRegion, PolygonRegion, RectangleRegion

TWO_SWEEPS = {"pulses": [700, 800, 700, 800], "offsets": [0, 1, 2, 3]}
WHOLE = [(pulse, pulse) for pulse in range(4)]


def stored(seed: int, count: int, shape, dtype) -> np.ndarray:
    """Numbers for a binary file."""
    return np.random.default_rng(seed).standard_normal((count, *shape)).astype(dtype)


def scan_with(folder, more="", files=None, **fields):
    """A scan of two sweeps with files beside it."""
    msot = write(folder, header(**{**TWO_SWEEPS, **fields}, more=more), records=4)
    for name, values in (files or {}).items():
        (folder / name).parent.mkdir(exist_ok=True)
        values.tofile(folder / name)
    return msot


# Reconstructions ----------------------------------------------------------------------------------------------------


def test_an_old_reconstruction_has_x_slow_and_y_pointing_down(tmp_path):
    """Pixel (x, y) of the float64 file is column x, and row 3 - y from the bottom; the pitch is Roi / (n - 1)."""
    values = stored(1, 4, (4, 4), "<f8")
    msot = scan_with(tmp_path, nodes([recon_node("A-1", WHOLE)]), {"RECONs/A-1.bin": values})
    (entry,) = oatkit.read_images(msot).items()
    name, images = entry
    assert (name, len(images)) == ("RECONs/model_lin/0", 2)
    for frame, image in enumerate(images):
        assert image.wavelengths_nm == (700, 800)
        assert (image.quantity, image.unit) == ("initial_pressure", "a.u.")
        assert image.grid == Grid((4, 4), 0.01)
        for wavelength in range(2):
            for x in range(4):
                for y in range(4):
                    assert image.values[wavelength, 3 - y, x] == values[2 * frame + wavelength, x, y]
    assert images[0].history[0]["method"] == "model_lin"


def test_a_new_reconstruction_is_stored_row_by_row_from_below(tmp_path):
    """Float32 (frame, wavelength, X, Y, Z) with the size of the grid in the header, as PATATO reads it."""
    view = field_of_view("FIELD-OF-VIEW", (5, 4, 1), (0.008, 0.006, 0.0))
    values = stored(2, 4, (5, 4), "<f4")
    msot = scan_with(tmp_path, nodes([recon_node("A", WHOLE, view)]), {"RECONs/A.bin": values})
    image = oatkit.read_images(msot)["RECONs/model_lin/0"][1]
    assert image.values.dtype == np.float32
    assert np.array_equal(image.values, values[2:])
    assert image.grid == Grid((5, 4), 0.002)


def test_images_stand_where_the_header_says(tmp_path):
    """In another order than the pulses, at one wavelength only, or in sweeps of which the last one is incomplete."""
    values = stored(3, 4, (4, 4), "<f8")
    recons = [recon_node("A", [(0, 3), (1, 2), (2, 1)]), recon_node("A", [(1, 0), (3, 1)]), recon_node("A")]
    msot = scan_with(tmp_path, nodes(recons), {"RECONs/A.bin": values})
    found = oatkit.read_images(msot)
    upright = values.swapaxes(1, 2)[:, ::-1]
    assert [len(found[f"RECONs/model_lin/{i}"]) for i in range(3)] == [1, 2, 2]
    assert np.array_equal(found["RECONs/model_lin/0"][0].values, upright[[3, 2]])
    assert found["RECONs/model_lin/1"][1].wavelengths_nm == (800,)
    assert np.array_equal(found["RECONs/model_lin/1"][1].values, upright[[1]])
    assert np.array_equal(found["RECONs/model_lin/2"][1].values, upright[2:])


def test_components_are_named_by_their_spectra(tmp_path):
    """One image for each slice, on the grid of the reconstruction that they come from."""
    values = stored(4, 4, (4, 4), "<f8")
    slices = [[(0, "Hb"), (1, "HbO2")], [(2, "Hb"), (3, "HbO2")]]
    more = nodes([recon_node("A", WHOLE)], [msp_node("M", "A", slices)])
    msot = scan_with(tmp_path, more, {"MSPs/M.bin": values})
    found = oatkit.read_images(msot)
    upright = values.swapaxes(1, 2)[:, ::-1]
    for component, first in {"deoxyhaemoglobin": 0, "oxyhaemoglobin": 1}.items():
        images = found[f"MSPs/regression/0/{component}"]
        assert [image.quantity for image in images] == [component] * 2
        assert np.array_equal(images[1].values, upright[[2 + first]])
        assert images[0].grid == Grid((4, 4), 0.01)


NO_IMAGES = {
    "no file": (recon_node("B", WHOLE), "no file"),
    "too short": (recon_node("A", [*WHOLE[:3], (3, 4)]), "expected 5 images"),
    "a volume": (recon_node("A", WHOLE, field_of_view("FIELD-OF-VIEW", (4, 4, 4), (1e-2,) * 3)), "image of a plane"),
    "oblong pixels": (recon_node("A", WHOLE, field_of_view("FIELD-OF-VIEW", (3, 4, 1), (1e-2, 1e-2, 0))), "square"),
    "in mm": (recon_node("A", WHOLE, "<Resolution>4</Resolution><Roi>30</Roi>"), "unit is m"),
}


@pytest.mark.parametrize("case", NO_IMAGES)
def test_stored_images_that_cannot_be_had_say_so_when_they_are_read(tmp_path, case):
    """They are listed, and the scan and the others stay readable."""
    node, words = NO_IMAGES[case]
    more = nodes([node, recon_node("A", WHOLE)])
    msot = scan_with(tmp_path, more, {"RECONs/A.bin": stored(1, 4, (4, 4), "<f8")})
    found = oatkit.read_images(msot)
    with pytest.raises(ReadError, match=words):
        found["RECONs/model_lin/0"][0]
    assert found["RECONs/model_lin/1"][1].wavelengths_nm == (700, 800)


@pytest.mark.parametrize("guid", ["../../secret", "/etc/passwd", "../../../etc/passwd"])
def test_a_name_in_the_header_leads_nowhere_else(tmp_path, guid):
    """Refused before a file is opened, also where it is a symbolic link out of the folder."""
    (tmp_path / "scan" / "RECONs").mkdir(parents=True)
    (tmp_path / "secret.bin").write_bytes(bytes(512))
    msot = scan_with(tmp_path / "scan", nodes([recon_node(guid, WHOLE)]))
    with pytest.raises(ReadError, match="leads out of the folder"):
        oatkit.read_images(msot)
    (tmp_path / "scan" / "RECONs" / "L.bin").symlink_to(tmp_path / "secret.bin")
    msot = scan_with(tmp_path / "scan", nodes([recon_node("L", WHOLE)]))
    with pytest.raises(ReadError, match="leads out of the folder"):
        oatkit.read_images(msot)


def test_a_reconstruction_in_a_strange_order_is_refused(tmp_path):
    """Its frames and wavelengths could not be told apart."""
    msot = scan_with(tmp_path, nodes([recon_node("A", [(0, 0), (2, 1), (1, 2), (3, 3)])]))
    with pytest.raises(ReadError, match="whole sweeps"):
        oatkit.read_images(msot)


# Ultrasound ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("none", [-1, 3])
def test_ultrasound_goes_with_the_frames(tmp_path, none):
    """The image named by the first pulse of a frame, if the file has it, and all of them in the order of the file."""
    values = stored(5, 3, (4, 4), "<f4")
    more = field_of_view("ULTRA-SOUND-FIELD-OF-VIEW", (4, 4, 1), (0.03, 0.03, 0.0))
    msot = scan_with(tmp_path, more, {"Scan_1.us": values}, ultrasound=[2, 2, none, 0])
    found = oatkit.read_images(msot)
    upright = values.swapaxes(1, 2)[:, ::-1]
    assert [len(found[name]) for name in ("ultrasound/all", "ultrasound")] == [3, 2]
    assert np.array_equal([image.values[0] for image in found["ultrasound/all"]], upright)
    assert np.array_equal(found["ultrasound"][0].values[0], upright[2])
    assert found["ultrasound"][0].grid == Grid((4, 4), 0.01)
    with pytest.raises(ReadError, match="no image with frame 1"):
        found["ultrasound"][1]


def test_older_headers_give_the_pixel_of_the_ultrasound(tmp_path):
    """By number and size; where neither is there, reading says what is missing."""
    more = "<ULTRA-SOUND-RESOLUTION>4</ULTRA-SOUND-RESOLUTION><UltraSoundPixelSize>0.00018</UltraSoundPixelSize>"
    values = stored(5, 2, (4, 4), "<f4")
    msot = scan_with(tmp_path, more, {"Scan_1.us": values})
    found = oatkit.read_images(msot)
    assert list(found) == ["ultrasound/all"]
    assert found["ultrasound/all"][1].grid == Grid((4, 4), 0.00018)
    with pytest.raises(ReadError, match="ULTRA-SOUND-RESOLUTION"):
        oatkit.read_images(scan_with(tmp_path))["ultrasound/all"][0]


# Regions ------------------------------------------------------------------------------------------------------------


def annotate(folder, *regions, name="Scan_1.iannotation"):
    """An annotation beside a scan."""
    wrapper = {"__classname": "iAnnotationListWrapper", "Annotations": [{"ROIList": list(regions), "Sweeps": [1]}]}
    (folder / name).write_text(json.dumps(wrapper))
    return scan_with(folder)


def turned_corners(left, top, width, height, degrees):
    """Corners and middle of a rectangle turned about its upper left corner, as (y up, x), by PATATO's formulas."""
    angle = np.radians(degrees)
    x, y = np.array([[0, 0], [width, 0], [width, height], [0, height], [width / 2, height / 2]]).T
    turned_x = left + x * np.cos(angle) - y * np.sin(angle)
    turned_y = top + x * np.sin(angle) + y * np.cos(angle)
    return np.column_stack([-turned_y, turned_x])


@pytest.mark.parametrize("degrees", [0, 15, -70, 200.5, 725])
def test_shapes_turn_about_their_upper_left_corner(tmp_path, degrees):
    """In the file y points down and angles turn clockwise, so that the corner stays where it is."""
    place = {"pos": "Point(0.002, 0.0025)", "size": "Point(0.01, 0.005)", "angle": degrees}
    msot = annotate(tmp_path, place, {**place, "type": "Ellipse"})
    rectangle, ellipse = oatkit.read_regions(msot)
    corners = turned_corners(0.002, 0.0025, 0.01, 0.005, degrees)
    found = rectangle.outline_m
    assert isinstance(rectangle, RectangleRegion)
    assert all(np.hypot(*(found - corner).T).min() < 1e-12 for corner in corners[:4])
    assert isinstance(ellipse, EllipseRegion)
    assert np.allclose(ellipse.centre_m, corners[4], rtol=0, atol=1e-15)
    middles = (corners[:4] + np.roll(corners[:4], -1, axis=0)) / 2
    assert all(np.hypot(*(ellipse.outline_m - middle).T).min() < 1e-12 for middle in middles)


def test_polygons_are_flipped_and_sizes_have_a_default(tmp_path):
    """(x, y down) becomes (y up, x); a shape without a size is 10 mm wide and high."""
    points = ["Point(-0.01, -0.01)", "Point(-0.005, -0.012)", "Point( 0.001,0.002 )"]
    msot = annotate(tmp_path, {"type": "Polygon", "points": points}, {"pos": "Point(0, 0)"})
    polygon, square = oatkit.read_regions(msot)
    assert isinstance(polygon, PolygonRegion)
    assert np.array_equal(polygon.vertices_m, [[0.01, -0.01], [0.012, -0.005], [-0.002, 0.001]])
    assert [polygon.name, square.name] == ["iAnnotation_0/0", "iAnnotation_0/1"]
    assert (square.centre_m, square.half_axes_m) == ((-0.005, 0.005), (0.005, 0.005))


def test_the_mouse_has_four_areas_and_a_line(mouse_scan, caplog):
    """Of the five shapes in its file: two ellipses, a rectangle and a polygon; the line is named in the log."""
    regions = oatkit.read_regions(mouse_scan)
    assert [type(r).__name__ for r in regions] == ["EllipseRegion"] * 2 + ["RectangleRegion", "PolygonRegion"]
    assert [r.name for r in regions] == [f"iAnnotation_0/{j}" for j in (0, 1, 3, 4)]
    assert np.allclose(regions[0].centre_m, (-0.007, -0.005), rtol=0, atol=1e-15)
    assert regions[1].angle_rad == pytest.approx(-np.radians(15))
    assert np.array_equal(regions[3].vertices_m[0], (0.01, -0.01))
    (record,) = caplog.records
    assert "iAnnotation_0/2" in record.getMessage()
    assert "straight line" in record.getMessage()


def test_an_annotation_is_read_by_itself(tmp_path):
    """Its regions are those of the scan beside it; it is no scan, and the error says what it is."""
    msot = annotate(tmp_path, {"pos": "Point(0, 0)"})
    alone = msot.with_suffix(".iannotation")
    assert oatkit.read_regions(alone) == oatkit.read_regions(msot) == oatkit.read_regions(tmp_path)
    assert oatkit.read_images(alone) == {}
    with pytest.raises(ReadError, match="regions of interest, not a scan"):
        oatkit.read(alone)
    alone.unlink()
    assert oatkit.read_regions(msot) == ()


NO_REGIONS = {
    "empty": (b"", "JSON"),
    "binary": (bytes(range(256)), "JSON"),
    "deep": (b"[" * 200_000, "JSON"),
    "a list": (b"[]", "iAnnotationListWrapper"),
    "no list": (b'{"Annotations": 3}', "iAnnotationListWrapper"),
    "no annotation": (b'{"Annotations": [3]}', "region of interest"),
    "no region": (b'{"Annotations": [{"ROIList": [3]}]}', "region of interest"),
}
NO_SHAPES = {
    "unknown": ({"type": "Blob"}, "'Blob'"),
    "no place": ({"type": "Ellipse"}, "Point"),
    "no numbers": ({"pos": "Point(a, b)"}, "Point"),
    "not finite": ({"pos": "Point(nan, 0)"}, "Point"),
    "three numbers": ({"pos": "Point(1, 2, 3)"}, "Point"),
    "no points": ({"type": "Polygon", "points": []}, "points"),
    "in mm": ({"pos": "Point(2, 3)"}, "unit is m"),
    "no size": ({"pos": "Point(0, 0)", "size": "Point(0, 0)"}, "half_axes_m"),
    "words for an angle": ({"pos": "Point(0, 0)", "angle": "right"}, "angle"),
    "a huge angle": ({"pos": "Point(0, 0)", "angle": 10**400}, "angle"),
    "no angle": ({"pos": "Point(0, 0)", "angle": float("nan")}, "angle"),
}


@pytest.mark.parametrize("case", NO_REGIONS)
def test_a_broken_annotation_is_refused_and_the_scan_is_not(tmp_path, case):
    """With a sentence that names the file."""
    content, words = NO_REGIONS[case]
    msot = scan_with(tmp_path)
    msot.with_suffix(".iannotation").write_bytes(content)
    with pytest.raises(ReadError, match=words) as error:
        IThera().regions(msot)
    assert "Scan_1.iannotation" in str(error.value)
    assert oatkit.read(msot).frames == 2


@pytest.mark.parametrize("case", NO_SHAPES)
def test_a_broken_region_leaves_the_others(tmp_path, caplog, case):
    """The log names it and says what was expected; those before and after it are read."""
    entry, words = NO_SHAPES[case]
    msot = annotate(tmp_path, {"pos": "Point(0, 0)"}, entry, {"pos": "Point(0.001, 0)"})
    assert [region.name for region in IThera().regions(msot)] == ["iAnnotation_0/0", "iAnnotation_0/2"]
    (record,) = caplog.records
    assert "iAnnotation_0/1" in record.getMessage()
    assert words in record.getMessage()
