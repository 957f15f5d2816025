"""The report: complete in itself, faithful to the result, and deaf to what hostile files would have it say."""

import base64
import hashlib
import io
import re
import sys
import tomllib
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image as Picture
from scipy.ndimage import uniform_filter

from oatkit.data import Grid, Image
from oatkit.drawing.sheet import scale_of
from oatkit.errors import ResultError, ValidationError
from oatkit.regions import EllipseRegion, MaskRegion, PolygonRegion, rim
from oatkit.report import report_page, write_report
from oatkit.report.ticks import linear, logarithmic, round_part
from oatkit.result import Result
from oatkit.store import load
from packages import run_oatkit
from results import GRID, WAVELENGTHS_NM, make_result, pressure, write_frames

HOSTILE = "<script>alert('x')</script><img src=http://example.org/x onerror=alert(1)>\"'>&amp;"
VOID = {"img", "meta", "input", "br", "link", "circle", "path", "polyline", "polygon"}
ENDLESS = {"path", "circle", "polyline", "polygon"}
"""Parts of a drawing that are written as ``<path/>``."""


class Reading(HTMLParser):
    """Reads a page: its elements with their attributes, its text, and whether every element is closed in its turn."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.open: list[str] = []
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in ENDLESS:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    @property
    def text(self) -> str:
        return "".join(self.texts)

    def all(self, tag: str, **attributes: str) -> list[dict[str, str | None]]:
        """The attributes of each element of a kind."""
        return [a for t, a in self.elements if t == tag and attributes.items() <= a.items()]


def body() -> Image:
    """A round body of 1 mm around the middle of the grid."""
    y, x = np.meshgrid(GRID.y_m - GRID.centre_m[0], GRID.x_m - GRID.centre_m[1], indexing="ij")
    return Image(np.hypot(y, x) - 1e-3, "boundary", "m", GRID)


def saturation() -> Image:
    """An so2 that is undefined in most pixels."""
    values = np.full(GRID.shape, np.nan, np.float32)
    values[10, 5:9] = (0.0, 0.25, 0.5, 1.0)
    return Image(values, "so2", "", GRID)


def whole(**changes) -> Result:
    """A result with an image of each kind."""
    result = make_result(**changes)
    return replace(result, images={**result.images, "boundary": body(), "so2": saturation()})


def decoded(src: str | None) -> np.ndarray:
    """The pixels of an inline PNG, row 0 at the bottom."""
    head, _, data = (src or "").partition(",")
    assert head == "data:image/png;base64"
    return np.asarray(Picture.open(io.BytesIO(base64.b64decode(data))))[::-1]


def pictures(page: Reading, begins: str) -> list[np.ndarray]:
    """All pictures whose description begins so."""
    return [decoded(a["src"]) for a in page.all("img") if (a["alt"] or "").startswith(begins)]


@pytest.fixture(scope="module")
def page() -> str:
    """A report of all kinds of images with two regions."""
    regions = (EllipseRegion("tumour", (2e-3, -1e-3), (5e-4, 5e-4)), rim(body(), 5e-4))
    return report_page(whole(), None, regions)


def test_the_page_needs_nothing_from_anywhere(page):
    """Every picture is inline and described, every link stays on the page, and the policy forbids all else."""
    read = Reading(page)
    assert read.all("img")
    for tag, attributes in read.elements:
        if tag == "img":
            assert "alt" in attributes
            assert (attributes["src"] or "").startswith("data:image/png;base64,")
        assert tag not in {"link", "iframe", "object", "embed", "base", "form"}
        assert (attributes.get("href") or "#").startswith("#")
        assert tag == "img" or "src" not in attributes
    assert "url(" not in page
    assert "@import" not in page
    policy = read.all("meta", **{"http-equiv": "Content-Security-Policy"})[0]["content"] or ""
    assert policy.startswith("default-src 'none'; img-src data:;")


def test_the_policy_lets_only_our_own_script_run(page):
    """The one script of the page is the one whose digest stands in the policy."""
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" in page


def test_headings_and_links_are_in_order(page):
    """One h1, no level of heading skipped, no name twice, every link of the page leads somewhere."""
    read = Reading(page)
    levels = [int(tag[1]) for tag, _ in read.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    names = [a["id"] for _, a in read.elements if "id" in a]
    assert len(names) == len(set(names))
    assert {(a["href"] or "")[1:] for _, a in read.elements if "href" in a} <= set(names)
    assert read.all("html")[0]["lang"] == "en"


def test_pictures_hold_the_pixels_of_the_result(page):
    """Each plane decodes to the colours of its scale, pixel by pixel: in common colours first, then in its own."""
    read, image = Reading(page), pressure()
    for index, wavelength in enumerate(WAVELENGTHS_NM):
        plane = image.values[index]
        common, own = pictures(read, f"initial pressure at {wavelength:g} nm")
        for picture, values in ((common, image.values), (own, plane)):
            expected = scale_of(image, values).paint(plane, plane < 0)[..., :3]
            assert (picture == np.round(255 * expected)).all()


def test_negative_pixels_are_red_and_counted(page):
    """As many pixels are pure red as the text below the picture says, and as the image has below zero."""
    read, image = Reading(page), pressure()
    for index, wavelength in enumerate(WAVELENGTHS_NM):
        count = int((image.values[index] < 0).sum())
        picture = pictures(read, f"initial pressure at {wavelength:g} nm")[0]
        assert int((picture == (255, 0, 0)).all(-1).sum()) == count > 0
        assert f"{count:,} negative pixels" in read.text
    assert "no negative pixels" in read.text


def test_undefined_pixels_are_pale(page):
    """Exactly the pixels of an image that are NaN have the colour that stands for undefined ones."""
    (picture,) = pictures(Reading(page), "sO₂")
    pale = (picture == (0xD8, 0xD4, 0xCC)).all(-1)
    assert (pale == np.isnan(saturation().values[0])).all()


def test_saturation_always_spans_zero_to_one():
    """The colours of an so2 do not depend on its values: half saturated blood is the same green in every report."""
    for low, high in ((0.4, 0.6), (0.0, 1.0)):
        values = np.array([[low, 0.5, high]], np.float32)
        image = Image(values, "so2", "", Grid(values.shape, 1e-4))
        colours = scale_of(image, values).paint(values, values < 0)
        assert np.round(255 * colours[0, 1, :3]).tolist() == [33, 145, 140]


def test_every_wavelength_can_be_chosen_and_seen(page):
    """Each wavelength has a button and a picture of each image; without styles all are there, one after another."""
    read = Reading(page)
    assert [a["value"] for a in read.all("input", type="radio")] == ["700", "757.5"]
    assert [a["value"] for a in read.all("input", type="radio") if "checked" in a] == ["700"]
    for name in ("initial pressure", "absorption"):
        for wavelength in WAVELENGTHS_NM:
            assert len(pictures(read, f"{name} at {wavelength:g} nm:")) == 2


def test_every_warning_is_shown(page):
    """All warnings of the run are on the page, with those that a rule left behind, and what did not converge."""
    text = Reading(page).text
    for warning in (*make_result().warnings, "the solver did not converge at 757.5 nm", "1 of 2 planes without a cert"):
        assert warning in text
    noted = whole(warnings=("first", "second"), weight_choice={"notes": ("picks differ", "second")})
    assert "Notes and warnings (3)" in Reading(report_page(noted)).text


def test_names_from_files_are_text_and_nothing_else():
    """Whatever a file calls its scan, its source, its regions, its warnings or its steps is shown letter for letter."""
    plain = whole()
    hostile = replace(
        plain,
        scan={**plain.scan, "name": HOSTILE, "source": HOSTILE, HOSTILE: HOSTILE},
        warnings=(HOSTILE,),
        versions={HOSTILE: HOSTILE},
        seconds={HOSTILE: 1.0},
        pipeline={"reconstruct": {"use": HOSTILE, "weight": 1.0}},
        requested={"reconstruct": {"use": "lsqr", HOSTILE: HOSTILE}},
        images={**plain.images, "odd": replace(body(), quantity=HOSTILE, unit=HOSTILE, diagnostics={HOSTILE: HOSTILE})},
    )
    region = PolygonRegion(HOSTILE, np.array([[0, 0], [0, 1e-3], [1e-3, 0]]) + GRID.centre_m)
    read, calm = Reading(report_page(hostile, None, (region,))), Reading(report_page(plain, None, (region,)))
    assert len(read.all("script")) == 1
    assert {tag for tag, _ in read.elements} == {tag for tag, _ in calm.elements}
    assert not [a for _, a in read.elements if any(name.startswith("on") for name in a)]
    assert read.text.count(HOSTILE) >= 10


def test_nonsense_in_a_record_is_still_a_page():
    """Diagnostics and choices of unexpected types are listed as they are: a forged record makes no crash."""
    odd = {"relative_gap": "near", "converged": 3, "residual_norm": ("a",), "data_norm": (1,), "change": ("x", (1, 2))}
    images = {"initial_pressure": replace(pressure(), diagnostics={**odd, "details": (1, {})})}
    result = Result(
        images,
        scan={"name": 7, "speed_of_sound_m_s": "fast", "wavelengths_nm": {}},
        pipeline={"reconstruct": "lsqr", "preprocess": ({"a": None},)},
        seconds={"reconstruct": "long"},
        weight_choice={"curve": ({"weight": "x"},), "weight": (), "notes": 3},
        speed_choice={"speeds_m_s": (1, 2), "scores": {"variance": ("a",)}, "speed_m_s": None},
    )
    assert "fast" in Reading(report_page(result)).text


def test_the_pipeline_runs_again_as_it_is_shown():
    """The listing is TOML and gives the pipeline as run; what was asked for instead stands beside it as a comment."""
    result = whole()
    page = report_page(result)
    listing = page[page.index("<pre") : page.index("</pre>")]
    text = Reading(listing + "</pre>").text
    assert tomllib.loads(text) == {
        "reconstruct": {"use": "maxent-nlcg", "weight": 0.00923},
        "preprocess": [{"use": "offset"}],
    }
    assert '# asked for: weight = "l-curve"' in text
    same = report_page(replace(result, requested=result.pipeline))
    assert "Exactly as it was asked for" in same
    assert "# asked for" not in same


def test_regions_are_measured_as_numpy_measures_them():
    """The table gives mean and standard deviation of the defined pixels in a region."""
    mask = np.zeros(GRID.shape, bool)
    mask[10, 5:12] = True
    text = Reading(report_page(whole(), None, (MaskRegion("row", mask, GRID),))).text
    values = pressure().values[1][mask]
    assert f"{values.mean():.4g} ± {values.std():.2g}".replace("-", "−") in text
    known = np.array([0.0, 0.25, 0.5, 1.0])
    assert f"{known.mean():.4g} ± {known.std():.2g}" in text


def test_outlines_lie_where_the_body_is():
    """The outline over a picture is a circle of the body's radius around its middle, within a tenth of a pixel."""
    page = report_page(whole())
    symbol = page[page.index("<symbol") : page.index("</symbol>")]
    points = np.array(re.findall(r"([\d.]+) ([\d.]+)", re.search(r' d="([^"]+)"', symbol)[1]), float)
    radius = np.hypot(*(points - (GRID.shape[1] / 2, GRID.shape[0] / 2)).T) * GRID.pixel_size_m
    assert abs(radius - 1e-3).max() < 0.1 * GRID.pixel_size_m


def test_outlines_of_regions_are_upright():
    """A region in the upper left of the plane is drawn in the upper left of the picture, be it a shape or a mask."""
    top_left = (GRID.y_m[-3], GRID.x_m[2])
    shape = EllipseRegion("shape", top_left, (2e-4, 2e-4))
    page = report_page(make_result(), None, (shape, MaskRegion("mask", shape.mask(GRID), GRID)))
    symbol = page[page.index("<symbol") : page.index("</symbol>")]
    for path in re.findall(r' d="([^"]+)"', symbol):
        x, y = np.array(re.findall(r"([\d.]+) ([\d.]+)", path), float).mean(0)
        assert (x, y) == pytest.approx((2.5, 2.5), abs=0.3)


def test_loops_and_rules_are_drawn_from_what_they_recorded():
    """The curve of a fixed-point loop, of the weight and of the speed of sound has a point for each recorded value."""
    loop = replace(pressure(), diagnostics={"change": ((0.5, 0.4), (0.05, 0.04), (0.005, 0.004))})
    weights = [
        {"weight": w, "residual_norm": 1 + w, "penalty": 1 / w, "prediction_error": float("nan")}
        for w in (0.1, 1, 10, 100)
    ]
    speeds = {
        "speeds_m_s": (1480, 1490, 1500, 1510, 1520),
        "scores": {"variance": (1, 2, 5, 2, 1)},
        "speed_m_s": 1500.0,
    }
    result = Result(
        {"a": loop, "b": loop}, weight_choice={"rule": "l-curve", "weight": 1, "curve": weights}, speed_choice=speeds
    )
    curves = [len((a["points"] or "").split()) for a in Reading(report_page(result)).all("polyline")]
    assert curves == [3, 3, 4, 5]


def test_the_search_for_a_calibration_is_drawn():
    """Each calibration that was tried is a point of one curve, and the one that was found is named."""
    choice = {"calibration": 0.25, "tried": (0.1, 0.25, 0.5, 1.0), "misfit": (0.2, 0.01, 0.3, 0.4), "notes": ()}
    read = Reading(report_page(replace(whole(), calibration_choice=choice)))
    assert 4 in [len((line["points"] or "").split()) for line in read.all("polyline")]
    assert "Calibration by the spectra" in read.text
    assert "K 0.25 a.u. m" in read.text


def test_frames_that_failed_are_listed(tmp_path):
    """A result of many frames shows the first good one, or the one asked for, and says which failed and why."""
    stored = load(write_frames(tmp_path / "out.zarr", "dark", "dark", make_result(2), make_result(3)))
    write_report(stored, tmp_path / "first.html")
    write_report(stored, tmp_path / "last.html", frame=3)
    for name, seed in (("first", 2), ("last", 3)):
        read = Reading((tmp_path / f"{name}.html").read_text(encoding="utf-8"))
        assert f"Frame {seed} of the scan, one of 4" in read.text
        assert "2 of 4 frames failed" in read.text
        assert "0 – 1faileddark" in read.text
        assert f"{(pressure(seed).values[0] < 0).sum()} negative pixels" in read.text
    with pytest.raises(ResultError, match="frame 1 failed: dark"):
        write_report(stored, tmp_path / "none.html", frame=1)
    with pytest.raises(ValidationError, match="frame 4"):
        write_report(stored, tmp_path / "none.html", frame=4)
    assert not (tmp_path / "none.html").exists()


def test_an_existing_page_is_kept_unless_asked_otherwise(tmp_path):
    """A page replaces nothing without being asked to, and never the scan."""
    path = tmp_path / "page.html"
    path.write_text("precious")
    with pytest.raises(ResultError, match="exists already"):
        write_report(whole(), path)
    with pytest.raises(ResultError, match="is the input"):
        write_report(whole(scan={"source": str(path)}), path, overwrite=True)
    assert path.read_text() == "precious"
    write_report(whole(), path, overwrite=True)
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_without_jinja2_the_extra_is_named(monkeypatch):
    """A report without jinja2 is one sentence that says what to install."""
    monkeypatch.setitem(sys.modules, "jinja2", None)
    monkeypatch.delitem(sys.modules, "oatkit.report")
    with pytest.raises(ResultError, match=r'pip install "oatkit\[report\]"'):
        __import__("oatkit.report")


def test_a_large_report_stays_small_enough_to_send():
    """Eight images of textures in a round body, at 12 wavelengths on 200 x 200 pixels, make a page below 8 MB."""
    grid, wavelengths = Grid((200, 200), 1e-4), tuple(range(680, 901, 20))
    y, x = np.meshgrid(grid.y_m, grid.x_m, indexing="ij")
    rng = np.random.default_rng(0)
    texture = uniform_filter(rng.random((8, 12, 200, 200)), (0, 0, 5, 5))
    images = {
        f"image_{i}": Image(np.where(np.hypot(y, x) < 8e-3, values, np.nan), "absorption", "1/m", grid, wavelengths)
        for i, values in enumerate(texture)
    }
    page = report_page(Result(images))
    assert len(Reading(page).all("figure")) == 96
    assert len(page) < 8e6


@pytest.mark.parametrize(("low", "high"), [(0, 0.0345), (-6e-3, 6e-3), (680, 900), (0, 3e7), (1e-9, 2e-9)])
def test_numbers_on_an_axis_say_where_they_stand(low, high):
    """Each text, times the power of ten of its axis, is the value at which it stands; there are three to nine."""
    axis = linear(low, high)
    factor = 10.0 ** int(axis.factor[3:].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))) if axis.factor else 1.0
    assert 3 <= len(axis.ticks) <= 9
    for tick in axis.ticks:
        value = float(tick.text.replace("−", "-")) * factor
        assert value == pytest.approx(low + tick.share * (high - low), abs=1e-6 * (high - low))


@pytest.mark.parametrize(("low", "high"), [(1e-5, 0.1), (3e-3, 5e-2), (0.9, 1.1e12)])
def test_powers_of_ten_stand_at_their_logarithm(low, high):
    """On a logarithmic axis the shares of ticks are those of their logarithms, evenly for whole decades."""
    ticks = logarithmic(low, high).ticks
    assert len(ticks) >= 2
    assert all(0 <= tick.share <= 1 for tick in ticks)
    assert [tick.share for tick in ticks] == sorted(tick.share for tick in ticks)
    for tick in ticks:
        if re.fullmatch(r"[\d.]+", tick.text):
            assert tick.share == pytest.approx(np.log(float(tick.text) / low) / np.log(high / low))


@pytest.mark.parametrize("length", [25.0, 9.999, 10.0, 0.3, 7.0, 123.0])
def test_a_scale_bar_has_a_round_length(length):
    """A scale bar is 1, 2 or 5 times a power of ten, and a fifth to a half of the picture."""
    part = round_part(length)
    assert f"{part:e}"[0] in "125"
    assert 0.2 <= part / length * (1 + 1e-9) <= 0.5 + 1e-9


def test_the_command_writes_the_page(tmp_path):
    """`oatkit report` writes one page with regions from files, and refuses what exists with one sentence."""
    folder = write_frames(tmp_path / "out.zarr", make_result(0), make_result(1))
    regions = tmp_path / "regions.toml"
    shape = 'name = "tumour"\nshape = "ellipse"\ncentre_yx_mm = [2, -1]\nhalf_axes_yx_mm = [0.5, 0.5]\n'
    regions.write_text(f"version = 1\n[[region]]\n{shape}")
    page = tmp_path / "page.html"
    done = run_oatkit("report", str(folder), "-o", str(page), "--frame", "1", "-r", str(regions))
    assert done.returncode == 0, done.stderr
    read = Reading(page.read_text(encoding="utf-8"))
    assert "Frame 1 of the scan, one of 2" in read.text
    assert "tumour" in read.text
    again = run_oatkit("report", str(folder), "-o", str(page))
    assert again.returncode == 2
    assert "exists already" in again.stderr
