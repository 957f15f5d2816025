"""The table of regions against plain numpy, its CSV against a CSV reader, and its command."""

import csv
import json
from dataclasses import fields, replace

import numpy as np
import pytest

from oatkit.data import Image
from oatkit.errors import ResultError, ValidationError
from oatkit.metrics import cnr
from oatkit.regions import EllipseRegion, MaskRegion, rim
from oatkit.regions.files import save_regions
from oatkit.regions.table import COLUMNS, RegionRow, region_rows, region_table, write_csv
from oatkit.regions.text import table_text
from oatkit.store import load
from packages import run_oatkit
from results import GRID, WAVELENGTHS_NM, make_result, write_frames

MASKS = {name: np.random.default_rng(seed).random(GRID.shape) < 0.3 for seed, name in enumerate(("vessel", "muscle"))}
REGIONS = [MaskRegion(name, pixels, GRID) for name, pixels in MASKS.items()]
NOWHERE = EllipseRegion("nowhere", (0.5, 0.5), (1e-3, 1e-3))


def random_image(undefined=0.0, dtype=np.float64, seed=5):
    """Normal numbers about 0.3, some of them without a value, at two wavelengths."""
    rng = np.random.default_rng(seed)
    values = 0.3 + rng.standard_normal((2, *GRID.shape))
    values[rng.random(values.shape) < undefined] = np.nan
    return Image(values.astype(dtype), "absorption", "1/m", GRID, WAVELENGTHS_NM)


@pytest.mark.parametrize("undefined", [0.0, 0.4])
def test_the_numbers_are_those_of_numpy(undefined):
    """For each region and wavelength, over the pixels that have a value; the others are counted."""
    image = random_image(undefined)
    rows = region_table({"absorption": image}, REGIONS)
    assert len(rows) == 4
    for row in rows:
        values = image.values[WAVELENGTHS_NM.index(row.wavelength_nm)][MASKS[row.region]]
        known = values[~np.isnan(values)]
        assert row.pixels == len(values)
        assert row.area_mm2 == pytest.approx(len(values) * 0.125**2)
        assert row.undefined_share == pytest.approx(np.isnan(values).mean())
        assert (row.mean, row.std) == pytest.approx((known.sum() / len(known), known.std()))
        assert (row.median, row.min, row.max) == (np.median(known), known.min(), known.max())
        assert row.negative_share == pytest.approx((known < 0).sum() / len(known))
        assert (row.image, row.unit, row.note) == ("absorption", "1/m", "")


def test_numbers_of_single_precision_are_summed_in_double():
    """A million pixels of 0.1 in float32 have the mean of that number to rounding of doubles."""
    from oatkit.regions.table import statistics

    assert statistics(np.full(1_000_000, 0.1, np.float32))["mean"] == pytest.approx(float(np.float32(0.1)), rel=1e-12)


def test_the_cnr_is_that_of_the_metric():
    """Contrast over the noise of the background, of the same pixels; the background has none against itself."""
    image = random_image()
    for row in region_table({"absorption": image}, REGIONS, background="muscle"):
        plane = image.values[WAVELENGTHS_NM.index(row.wavelength_nm)]
        against = None if row.region == "muscle" else cnr(plane, MASKS["vessel"], MASKS["muscle"])
        assert row.cnr == against


def test_the_cnr_leaves_out_what_has_no_value():
    """By the formula, |difference of means| over the standard deviation of the background, over defined pixels."""
    image = random_image(undefined=0.3)
    row = region_table({"absorption": image}, REGIONS, background="muscle")[0]
    target, background = (image.values[0][MASKS[name]] for name in ("vessel", "muscle"))
    expected = abs(np.nanmean(target) - np.nanmean(background)) / np.nanstd(background)
    assert row.cnr == pytest.approx(expected)


def test_a_region_without_pixels_has_a_row_that_says_so():
    """Zero pixels, no numbers, a note; as background it gives no CNR."""
    rows = region_table({"absorption": random_image()}, [*REGIONS, NOWHERE], background="nowhere")
    assert all(row.cnr is None for row in rows)
    empty = [row for row in rows if row.region == "nowhere"]
    assert len(empty) == 2
    for row in empty:
        assert (row.pixels, row.area_mm2) == (0, 0.0)
        assert (row.mean, row.std, row.median, row.min, row.max) == (None,) * 5
        assert row.undefined_share is row.negative_share is None
        assert "no pixel" in row.note


def test_a_region_without_values_has_a_row_that_says_so():
    """All of its pixels are undefined, and there is no mean of nothing."""
    nothing = replace(random_image(), values=np.full((2, *GRID.shape), np.nan))
    for row in region_table({"absorption": nothing}, REGIONS, background="muscle"):
        assert row.undefined_share == 1
        assert row.mean is row.negative_share is row.cnr is None
        assert "value" in row.note


@pytest.fixture(scope="module")
def results():
    """Results of three frames of a scan: 4, 6 and 9."""
    return [make_result(seed, time_s=0.5 * seed) for seed in (4, 6, 9)]


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory):
    """The same in a folder, with a frame that failed between the first two."""
    first, *others = results
    return write_frames(tmp_path_factory.mktemp("table") / "out.zarr", first, "no signal", *others)


def test_frames_from_a_folder_give_the_numbers_of_those_in_memory(results, folder):
    """Number by number, each with its frame in result and scan and its time; the frame that failed has no rows."""
    stored = region_table(load(folder), REGIONS, background="muscle")
    memory = [row for result in results for row in region_table(result, REGIONS, background="muscle")]
    index = {4: 0, 6: 2, 9: 3}
    assert stored == [replace(row, frame=index[row.scan_frame]) for row in memory]
    assert {row.time_s for row in stored} == {2.0, 3.0, 4.5}


def test_frames_are_read_one_at_a_time(folder):
    """The rows of the first frame are there before a second one is read."""
    result, read = load(folder), []

    class Watched:
        count, failed, path = result.stored.count, result.stored.failed, result.stored.path

        def read(self, index):
            read.append(index)
            return result.stored.read(index)

    rows = region_rows(replace(result, stored=Watched()), REGIONS)
    assert next(rows).frame == 0
    assert read == [0]
    assert {row.frame for row in rows} == {0, 2, 3}


def test_chosen_frames_are_taken_and_a_failed_one_is_not_passed_over(folder):
    """One that is asked for by name and failed is an error with its reason."""
    assert {row.frame for row in region_table(load(folder), REGIONS, frames=[3])} == {3}
    with pytest.raises(ResultError, match="no signal"):
        region_table(load(folder), REGIONS, frames=[1])


def test_a_region_may_follow_the_body_from_frame_to_frame():
    """What makes a region of the images of a frame is asked for each one: the rim of a growing disc grows."""
    y, x = np.meshgrid(GRID.y_m - GRID.centre_m[0], GRID.x_m - GRID.centre_m[1], indexing="ij")
    bodies = [Image(np.hypot(y, x) - radius, "boundary", "m", GRID) for radius in (0.8e-3, 1.2e-3)]
    found = [
        region_table({"boundary": body}, [lambda images: rim(images["boundary"], 0.3e-3)])[0].pixels for body in bodies
    ]
    assert found == [((d.values > -0.3e-3) & (d.values < 0)).sum() for d in bodies]
    assert found[0] < found[1]


def test_names_that_do_not_tell_regions_apart_are_refused():
    """Two of one name, and a background that is none of them, with the nearest name."""
    with pytest.raises(ValidationError, match="'vessel'"):
        region_table({"absorption": random_image()}, [*REGIONS, REGIONS[0]])
    with pytest.raises(ValidationError, match="did you mean 'muscle'"):
        region_table({"absorption": random_image()}, REGIONS, background="muscel")


def read_csv(path):
    """The rows of a CSV file, read by the standard library."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


def test_the_csv_holds_every_number_to_the_last_bit(folder, tmp_path):
    """Read back, each cell is the number or text of its row, and empty where there is none; lines end in CR LF."""
    rows = region_table(load(folder), [*REGIONS, NOWHERE], background="muscle")
    write_csv(rows, tmp_path / "table.csv")
    head, *cells = read_csv(tmp_path / "table.csv")
    assert tuple(head) == COLUMNS == tuple(entry.name for entry in fields(RegionRow))
    assert len(cells) == len(rows)
    for row, line in zip(rows, cells, strict=True):
        for name, cell in zip(head, line, strict=True):
            value = getattr(row, name)
            assert cell == "" if value is None else type(value)(cell) == value
    content = (tmp_path / "table.csv").read_bytes()
    assert content.count(b"\r\n") == content.count(b"\n") == len(rows) + 1


HOSTILE = {
    "=1+1": "'=1+1",
    "+cmd|' /C calc'!A0": "'+cmd|' /C calc'!A0",
    "-2+3": "'-2+3",
    "@SUM(A1)": "'@SUM(A1)",
    " \t=1": "'=1",
    'a,"b"\r\n=1': 'a,"b"??=1',
    "muscle": "muscle",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_becomes_a_formula_or_a_line_of_its_own(tmp_path, name):
    """What a spreadsheet would run gets an apostrophe; line ends and other controls become question marks."""
    rows = region_table({"absorption": random_image()}, [replace(REGIONS[0], name=name)])
    write_csv(rows, tmp_path / "table.csv")
    _, *cells = read_csv(tmp_path / "table.csv")
    assert [line[COLUMNS.index("region")] for line in cells] == [HOSTILE[name]] * 2
    assert all(cell == cell.strip() for line in cells for cell in line)


def test_a_negative_number_is_no_formula(tmp_path):
    """Only texts are guarded: a mean below zero stays a number."""
    write_csv(region_table({"p": replace(random_image(), values=-np.ones((2, *GRID.shape)))}, REGIONS), tmp_path / "t")
    assert [line[COLUMNS.index("mean")] for line in read_csv(tmp_path / "t")[1:]] == ["-1.0"] * 4


def test_the_text_is_aligned_and_says_what_is_missing():
    """Every line has its columns where the headings have them, controls in names do not reach the terminal."""
    rows = region_table({"absorption": random_image()}, [replace(REGIONS[0], name="a\x1b[2Jb"), NOWHERE])
    head, *lines = table_text(rows).splitlines()
    notes = [line for line in lines if line.startswith("note: ")]
    assert notes == ["note: nowhere in absorption: no pixel of the image has its centre in the region"]
    assert "frame" not in head
    assert "\x1b" not in "".join(lines)
    end = head.index("mean") + len("mean")
    for line, row in zip(lines, rows, strict=False):
        assert line[:end].split()[-1] == ("-" if row.mean is None else f"{row.mean:.4g}")


@pytest.fixture(scope="module")
def region_file(tmp_path_factory):
    """Two ellipses about the middle of the image in a file."""
    path = tmp_path_factory.mktemp("regions") / "regions.toml"
    centre = GRID.centre_m
    save_regions([EllipseRegion("in", centre, (5e-4, 5e-4)), EllipseRegion("out", centre, (1e-3, 1.5e-3))], path)
    return path


def test_the_command_gives_the_table_of_the_script(folder, region_file, tmp_path):
    """`roi` writes the CSV that `write_csv` does and prints the same rows as JSON; the text shows each frame."""
    from oatkit.plain import encode
    from oatkit.regions.files import load_regions

    arguments = ("roi", str(folder), "-r", str(region_file), "--background", "out")
    done = run_oatkit(*arguments, "-o", "table.csv", "--figure", "spectra.png", "--frame", "2", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = region_table(load(folder), load_regions(region_file), "out", [2])
    write_csv(rows, tmp_path / "ours.csv")
    assert (tmp_path / "table.csv").read_bytes() == (tmp_path / "ours.csv").read_bytes()
    assert json.loads(done.stdout) == [{name: encode(getattr(row, name)) for name in COLUMNS} for row in rows]
    assert (tmp_path / "spectra.png").read_bytes().startswith(b"\x89PNG")
    text = run_oatkit(*arguments).stdout
    assert text.splitlines()[0].startswith("frame")
    assert len(text.splitlines()) == 1 + 3 * 2 * 2 * 2


BAD_CALLS = {
    "no region": ([], 2, "no region"),
    "no such file": (["-r", "nowhere.toml"], 4, "nowhere.toml"),
    "no such background": (["-r", "REGIONS", "--background", "inn"], 2, "did you mean 'in'"),
    "one file twice": (["-r", "REGIONS", "-r", "REGIONS"], 2, "two regions have the name 'in'"),
    "no boundary": (["--rim", "1"], 2, "segment"),
    "no depth": (["--core", "nan"], 2, "--core nan"),
    "no such frame": (["-r", "REGIONS", "--frame", "7"], 2, "frame 7"),
    "a failed frame": (["-r", "REGIONS", "--frame", "1"], 4, "no signal"),
    "an output that exists": (["-r", "REGIONS", "-o", "mine.csv"], 2, "exists"),
}


@pytest.mark.parametrize("what", BAD_CALLS)
def test_a_wrong_call_gets_a_sentence_and_leaves_nothing(what, folder, region_file, tmp_path):
    """The promised exit code, a sentence on stderr, no traceback, and no file."""
    arguments, code, message = BAD_CALLS[what]
    (tmp_path / "mine.csv").write_text("mine")
    shown = [str(region_file) if a == "REGIONS" else a for a in arguments]
    done = run_oatkit("roi", str(folder), "--figure", "s.png", *shown, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]


class TestSpectra:
    """The figure of the means against the wavelength."""

    def curves(self, rows):
        """What is drawn, axes by axes: the lines by their label."""
        from oatkit.regions.spectra import spectra_figure

        figure = spectra_figure(rows)
        return [{line.get_label(): line.get_xydata() for line in axes.get_lines()} for axes in figure.axes]

    def test_wavelengths_rise_and_repeated_ones_are_all_drawn(self):
        """Each point is a mean of the table, in the order of the wavelength and then of the scan."""
        wavelengths = (800.0, 700.0, 750.0, 700.0)
        values = np.random.default_rng(3).random((4, *GRID.shape))
        rows = region_table({"p": Image(values, "p", "", GRID, wavelengths)}, REGIONS)
        (drawn,) = self.curves(rows)
        means = values[:, MASKS["vessel"]].mean(1)
        assert drawn["vessel"] == pytest.approx(np.array([(w, means[i]) for w, i in SORTED]))
        assert set(drawn) == set(MASKS)

    def test_a_region_keeps_its_colour_where_it_has_no_values(self):
        """Its line is empty there, and the others have the colours that they have in the other plots."""
        from oatkit.regions.spectra import spectra_figure

        nothing = np.where(MASKS["vessel"] & ~MASKS["muscle"], np.nan, 1.0) * np.ones((2, 1, 1))
        only = [MaskRegion("vessel", MASKS["vessel"] & ~MASKS["muscle"], GRID), REGIONS[1]]
        images = {"p": random_image(), "q": replace(random_image(), values=nothing)}
        left, right = (axes.get_lines() for axes in spectra_figure(region_table(images, only)).axes)
        assert [line.get_color() for line in left] == [line.get_color() for line in right]
        assert np.isnan(right[0].get_ydata()).all()
        assert (right[1].get_ydata() == 1).all()

    def test_the_band_is_one_standard_deviation_to_either_side(self):
        """Its edges at a wavelength are mean - std and mean + std."""
        from oatkit.regions.spectra import spectra_figure

        rows = region_table({"p": random_image()}, REGIONS[:1])
        (axes,) = spectra_figure(rows).axes
        (band,) = axes.collections
        corners = band.get_paths()[0].vertices
        for row in rows:
            heights = corners[corners[:, 0] == row.wavelength_nm, 1]
            assert (heights.min(), heights.max()) == pytest.approx((row.mean - row.std, row.mean + row.std))

    def test_a_name_from_a_file_is_shown_as_it_is(self):
        """No dollar makes a formula of it, and none breaks the figure."""
        from oatkit.drawing.page import png
        from oatkit.regions.spectra import spectra_figure

        rows = region_table({"p": random_image()}, [replace(REGIONS[0], name=r"$\frac{ $x^")])
        assert png(spectra_figure(rows))

    def test_what_has_no_spectrum_is_refused(self, folder):
        """Images of one wavelength or none, and rows of several frames."""
        one = replace(random_image(), values=np.ones((1, *GRID.shape)), wavelengths_nm=(700.0,))
        with pytest.raises(ValidationError, match="two wavelengths"):
            self.curves(region_table({"p": one, "boundary": replace(one, wavelengths_nm=())}, REGIONS))
        with pytest.raises(ValidationError, match="several frames"):
            self.curves(region_table(load(folder), REGIONS))


SORTED = [(700.0, 1), (700.0, 3), (750.0, 2), (800.0, 0)]
"""Wavelengths of the test of repeated ones, each with its place in the scan."""
