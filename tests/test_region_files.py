"""Regions of interest in files: what is written is read again, and what is wrong is said."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from oatkit.data import Grid
from oatkit.errors import ReadError, ResultError, ValidationError
from oatkit.regions import EllipseRegion, MaskRegion, PolygonRegion, RectangleRegion
from oatkit.regions.files import load_regions, save_regions

GRID = Grid((5, 4), 1e-3)
LABELS = np.zeros(GRID.shape, np.uint8)
LABELS[0, :2] = 1
LABELS[3:, 3] = 7

METRES = some.floats(-1, 1)
HALF_AXES = some.floats(1e-6, 1)
NAMES = some.text(some.characters(codec="utf-8"), min_size=1).filter(lambda name: name.strip())
CENTRED = (NAMES, some.tuples(METRES, METRES), some.tuples(HALF_AXES, HALF_AXES), some.floats(-6.9, 6.9))
REGIONS = some.one_of(
    some.builds(PolygonRegion, NAMES, some.lists(some.tuples(METRES, METRES), min_size=3, max_size=5)),
    some.builds(EllipseRegion, *CENTRED),
    some.builds(RectangleRegion, *CENTRED),
)


@settings(deadline=None, max_examples=50)
@given(some.lists(REGIONS, min_size=1, max_size=3))
def test_what_is_saved_is_loaded_to_the_last_bit(tmp_path_factory, regions):
    """Whatever the numbers and the names: the change of unit and back loses nothing."""
    path = tmp_path_factory.getbasetemp() / "regions.toml"
    save_regions(regions, path, overwrite=True)
    assert load_regions(path) == tuple(regions)


def test_a_number_is_written_as_somebody_would(tmp_path):
    """12.3 mm and 30 degrees stand in the file as such, not as 12.299999999999999."""
    text = (
        'version = 1\n\n[[region]]\nname = "a"\nshape = "ellipse"\ncentre_yx_mm = [12.3, -0.1]\n'
        "half_axes_yx_mm = [0.7, 1.1]\nangle_degrees = 30.0\n"
    )
    (tmp_path / "in.toml").write_text(text)
    save_regions(load_regions(tmp_path / "in.toml"), tmp_path / "out.toml")
    assert (tmp_path / "out.toml").read_text() == text


def test_the_keys_mean_what_they_say(tmp_path):
    """Order (y, x), mm and degrees; an angle may be left out, and whole numbers will do."""
    path = tmp_path / "regions.toml"
    path.write_text(
        """
        [[region]]
        name = "vessel"
        shape = "rectangle"
        centre_yx_mm = [2, -3.5]
        half_axes_yx_mm = [1, 2]
        angle_degrees = 90
        [[region]]
        name = "muscle"
        shape = "polygon"
        vertices_yx_mm = [[0, 0], [0, 4], [3, 4]]
        [[region]]
        name = "fat"
        shape = "ellipse"
        centre_yx_mm = [0, 0]
        half_axes_yx_mm = [1, 1]
        """
    )
    vessel, muscle, fat = load_regions(path)
    assert vessel == RectangleRegion("vessel", (2e-3, -3.5e-3), (1e-3, 2e-3), np.pi / 2)
    assert muscle == PolygonRegion("muscle", np.array([(0, 0), (0, 4e-3), (3e-3, 4e-3)]))
    assert fat == EllipseRegion("fat", (0, 0), (1e-3, 1e-3))


def test_all_that_is_wrong_is_said_at_once(tmp_path):
    """One line for each fault, with the number and the name of its region, its key, and what was meant."""
    path = tmp_path / "bad.toml"
    path.write_text(
        """
        [[region]]
        shape = "ellipse"
        [[region]]
        name = "a"
        shape = "elipse"
        [[region]]
        name = "b"
        shape = "polygon"
        vertices_mm = [[0, 0], [0, 4], [3, 4]]
        [[region]]
        name = "c"
        shape = "ellipse"
        centre_yx_mm = [nan, 2000]
        half_axes_yx_mm = [0, true]
        angle_degrees = "30"
        [[region]]
        name = "d"
        shape = "polygon"
        vertices_yx_mm = [[0, 0], [0, 4]]
        """
    )
    with pytest.raises(ValidationError) as caught:
        load_regions(path)
    lines = str(caught.value).splitlines()
    parts = [
        ("1:", "needs a name"),
        ("2 'a'.shape", "elipse"),
        ("3 'b'.vertices_yx_mm", "missing"),
        ("3 'b'", "did you mean 'vertices_yx_mm'"),
        ("4 'c'.centre_yx_mm", "at most 1000 mm"),
        ("4 'c'.half_axes_yx_mm", "at least 0.001 mm"),
        ("4 'c'.angle_degrees", "number"),
        ("5 'd'", "three corners"),
    ]
    assert len(lines) == len(parts)
    for line, (where, what) in zip(lines, parts, strict=True):
        assert line.startswith(f"bad.toml [[region]] {where}")
        assert what in line


BAD = {
    "no TOML": (b"= 3", "not valid TOML"),
    "no text": (b"\xff\xfe\x00", "not valid TOML"),
    "deep nesting": (b"a = " + b"[" * 50_000, "not valid TOML"),
    "a number too long": (b"version = " + b"1" * 5000, "not valid TOML"),
    "newer": (b"version = 2", "version: must be 1, got 2"),
    "one table": (b"[region]\nname = 'a'", r"\[\[region\]\]"),
    "no tables": (b"region = [3]", "needs a name"),
    "another key": (b"[[regions]]\nname = 'a'", "did you mean 'region'"),
    "a huge exponent": (
        b"[[region]]\nname = 'a'\nshape = 'polygon'\nvertices_yx_mm = [[0, 1e999999999], [0, 1], [1, 1]]",
        "at most 1000 mm",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_a_file_that_is_no_file_of_regions_is_refused(tmp_path, what):
    """With a sentence that names it."""
    content, message = BAD[what]
    (tmp_path / "bad.toml").write_bytes(content)
    with pytest.raises(ValidationError, match=f"bad.toml.*{message}"):
        load_regions(tmp_path / "bad.toml")


def test_nothing_is_not_a_file_of_regions(tmp_path):
    """A file without a region, one that is not there, a folder and one of an unknown kind are unreadable."""
    (tmp_path / "empty.toml").write_text("version = 1\n")
    (tmp_path / "words.txt").write_text("hello")
    (tmp_path / "folder.toml").mkdir()
    for name in ("empty.toml", "nowhere.toml", "words.txt", "folder.toml", "nowhere.npy"):
        with pytest.raises(ReadError, match=name):
            load_regions(tmp_path / name)


def write_labels(path, labels):
    """Write labels by the suffix of a file, the first row as it is."""
    import tifffile
    from PIL import Image

    writers = {
        ".npy": np.save,
        ".tif": tifffile.imwrite,
        ".png": lambda where, values: Image.fromarray(values).save(where),
    }
    writers[path.suffix](path, labels)
    return path


@pytest.mark.parametrize("name", ["l.npy", "l.tif", "l.png"])
def test_each_label_is_a_region(tmp_path, name):
    """Its pixels are those of the label, with row 0 at the bottom in .npy and at the top in pictures."""
    drawn = LABELS if name == "l.npy" else LABELS[::-1]
    one, seven = load_regions(write_labels(tmp_path / name, drawn), GRID)
    assert (one.name, seven.name) == ("l 1", "l 7")
    assert (one.mask(GRID) == (LABELS == 1)).all()
    assert (seven.mask(GRID) == (LABELS == 7)).all()


@pytest.mark.parametrize("value", [True, np.uint8(255), np.float32(1)])
def test_a_mask_is_a_region_with_the_name_of_the_file(tmp_path, value):
    """Whatever number stands for being inside."""
    (region,) = load_regions(write_labels(tmp_path / "liver.npy", np.where(LABELS == 1, value, 0 * value)), GRID)
    assert region == MaskRegion("liver", LABELS == 1, GRID)


WRONG_LABELS = {
    "another shape": (LABELS[:4], GRID, "4 x 4 pixels, the image has 5 x 4"),
    "no grid": (LABELS, None, "grid"),
    "halves": (LABELS / 2, GRID, "whole numbers"),
    "negative": (LABELS.astype(int) - 1, GRID, "whole numbers"),
    "not finite": (np.where(LABELS == 1, np.nan, 0), GRID, "whole numbers"),
    "a photograph": (np.arange(1200).reshape(30, 40), Grid((30, 40), 1e-3), "at most 1000"),
}


@pytest.mark.parametrize("what", WRONG_LABELS)
def test_labels_that_do_not_fit_are_refused(tmp_path, what):
    """With a sentence that says why."""
    labels, grid, message = WRONG_LABELS[what]
    with pytest.raises(ValidationError, match=message):
        load_regions(write_labels(tmp_path / "l.npy", labels), grid)


def test_labels_that_are_damaged_or_empty_are_unreadable(tmp_path):
    """Cut in the middle, holding pickled objects, or without any label."""
    whole = write_labels(tmp_path / "l.npy", LABELS).read_bytes()
    (tmp_path / "cut.npy").write_bytes(whole[:-3])
    np.save(tmp_path / "objects.npy", np.array([[{}]], dtype=object))
    write_labels(tmp_path / "zeros.npy", 0 * LABELS)
    for name in ("cut.npy", "objects.npy", "zeros.npy"):
        with pytest.raises(ReadError, match=name):
            load_regions(tmp_path / name, GRID)


def test_pixels_are_not_saved_as_a_shape(tmp_path):
    """A mask is refused, and nothing is written."""
    with pytest.raises(ValidationError, match=r"'m'.*pixels"):
        save_regions([MaskRegion("m", LABELS == 1, GRID)], tmp_path / "m.toml")
    assert not list(tmp_path.iterdir())


def test_a_file_is_not_replaced_unasked(tmp_path):
    """It stays as it was unless `overwrite` is given."""
    path = tmp_path / "regions.toml"
    path.write_text("mine")
    regions = [EllipseRegion("a", (0, 0), (1e-3, 1e-3))]
    with pytest.raises(ResultError, match="exists"):
        save_regions(regions, path)
    assert path.read_text() == "mine"
    save_regions(regions, path, overwrite=True)
    assert load_regions(path) == tuple(regions)
