"""What is put into a viewer: at the right place, in colours that do not lie, and no more read than is looked at."""

import itertools

import numpy as np
import pytest

from gui_viewers import GRID, WAVELENGTHS_NM, bench_without_window, disc_boundary, pressure
from oatkit import Image
from oatkit.gui.images.caption import caption
from oatkit.gui.images.layers import KEY
from oatkit.gui.images.looks import CHANGE, CONCENTRATION, FRACTION, INTENSITY, LIGHT, Limits, colours_of
from oatkit.gui.images.stored_planes import StoredPlanes
from oatkit.gui.images.world import from_world, outlines, thinned, to_world
from oatkit.gui.workbench import workbench
from oatkit.memo import Memo
from oatkit.polygons import area
from oatkit.result import Result
from oatkit.store import load
from results import write_frames


@pytest.fixture
def bench():
    """A workbench without a window."""
    return bench_without_window()


def image(values, quantity="initial_pressure", wavelengths_nm=(), **more):
    """An image on the small grid."""
    return Image(np.broadcast_to(values, (max(1, len(wavelengths_nm)), *GRID.shape)).astype(np.float32), quantity,
                 "", GRID, wavelengths_nm, **more)  # fmt: skip


def colour(shown, value):
    """Which colour a layer gives to a value."""
    low, high = shown.contrast_limits
    return shown.colormap.map(np.clip((value - low) / (high - low), 0, 1))[0]


RED, BLACK = (1, 0, 0, 1), pytest.approx((0, 0, 0, 1), abs=1e-9)


def test_a_pixel_lies_where_it_was_in_space(bench):
    """The brightest pixel of an image is found in the viewer at (-y, x) in mm."""
    values = np.zeros(GRID.shape)
    values[3, 22] = 1.0
    layer = bench.layers.show(image(values), "initial_pressure")
    row, column = np.argwhere(layer.data == 1)[0]
    assert np.allclose(layer.data_to_world((row, column)), (-1e3 * GRID.y_m[3], 1e3 * GRID.x_m[22]))


def test_points_go_to_the_viewer_and_back():
    """`from_world` undoes `to_world`, and leaves out the axes before y and x."""
    points = np.array([[1e-3, -2e-3], [0.0, 5e-3]])
    assert np.allclose(from_world(to_world(points)), points)
    assert np.allclose(from_world(np.insert(to_world(points), 0, 7.0, axis=1)), points)


def test_negative_pixels_and_only_they_are_red(bench):
    """A value a billionth of the brightest below zero is red, zero is black, and NaN is transparent."""
    layer = bench.layers.show(pressure(), "initial_pressure")
    top = layer.contrast_limits[1]
    assert tuple(colour(layer, -1e-9 * top)) == RED
    assert tuple(colour(layer, 0.0)) == BLACK
    assert colour(layer, np.nan)[3] == 0


def test_red_cannot_be_moved(bench):
    """Whatever lower limit a user asks for, it stays at zero, so that no positive pixel turns red."""
    layer = bench.layers.show(pressure(), "initial_pressure")
    for limits in ((0.5, 1.0), (-1.0, 2.0), (0.1, 0.2)):
        layer.contrast_limits = limits
        assert layer.contrast_limits[1] == limits[1]
        assert tuple(colour(layer, 0.0)) == BLACK
        assert tuple(colour(layer, -1e-9)) == RED


@pytest.mark.parametrize(
    ("shown", "colours", "limits"),
    [
        (image(np.linspace(0.2, 0.7, 30), "so2"), FRACTION, (0, 1)),
        (image(np.linspace(-3, 1, 30), "change"), CHANGE, (-3, 3)),
        (image(np.linspace(0.1, 0.9, 30), "fluence"), LIGHT, (0, 0.9)),
        (image(np.linspace(0, 4, 30), "total_haemoglobin"), CONCENTRATION, (0, 4)),
        (image(np.linspace(-1, 4, 30), "absorption"), INTENSITY, (0, 4)),
        (image(np.zeros(30)), INTENSITY, (0, 1)),
        (image(np.full(30, np.nan), "so2"), FRACTION, (0, 1)),
        (image(np.full(30, np.nan)), INTENSITY, (0, 1)),
    ],
)
def test_colours_say_what_is_shown(shown, colours, limits):
    """Fractions lie in 0 .. 1, signed quantities about zero, all others begin at zero, in colours of their own."""
    assert colours_of(shown) is colours
    assert tuple(Limits.of(shown)) == pytest.approx(limits, abs=0.05 * limits[1])


def test_one_hot_pixel_does_not_darken_an_image():
    """The brightest colour stands for the 99.9th percentile over all wavelengths together."""
    values = np.ones((2, *GRID.shape), np.float32)
    values[1] = 3.0
    values[0, 0, 0] = 1000.0
    assert Limits.of(Image(values, "initial_pressure", "a.u.", GRID, (700, 800))).high == pytest.approx(3.0)


def test_wavelengths_are_chosen_in_nm_and_the_slider_follows(bench):
    """Irregular wavelengths are found by their nm, the nearest one where there is none, and the slider says them."""
    bench.layers.show(pressure(), "initial_pressure")
    for asked, plane in ((900, 2), (700, 0), (716, 1), (2000, 2)):
        bench.viewing.go_to(asked)
        assert bench.viewer.dims.current_step[0] == plane
        assert bench.viewing.wavelength_nm == WAVELENGTHS_NM[plane]
    heard = []
    bench.viewing.changed.connect(lambda: heard.append(bench.viewing.wavelength_nm))
    bench.viewer.dims.set_current_step(0, 1)
    assert heard[-1] == 715.0


def test_the_caption_counts_what_is_red(bench):
    """The overlay gives wavelength and share of negative pixels of the plane that is looked at."""
    shown = pressure()
    bench.layers.show(shown, "initial_pressure")
    for plane, wavelength in enumerate(WAVELENGTHS_NM):
        bench.viewing.go_to(wavelength)
        share = 100 * np.mean(shown.values[plane] < 0)
        assert _text(bench) == f"{wavelength:g} nm · {share:.1f} % negative"


def test_the_caption_follows_the_selected_layer(bench):
    """Of two images the caption speaks of the one that is selected."""
    first = bench.layers.show(pressure(), "initial_pressure")
    second = bench.layers.show(image(np.ones(30), "absorption", WAVELENGTHS_NM), "absorption")
    bench.viewer.layers.selection.active = second
    assert "no negative pixels" in _text(bench)
    bench.viewer.layers.selection.active = first
    assert "% negative" in _text(bench)


def _text(bench):
    return bench.viewer.canvas.overlays.text.text


def test_the_caption_says_what_is_worth_saying():
    """Saturation has its median and no count of negatives; an axis of frames is named; too far a slider is told."""
    assert caption(image(np.full(30, 0.25), "so2"), 0) == "median 0.250"
    assert caption(image(np.ones(30), "change"), 0, frame=7).startswith("frame 7")
    assert "no such wavelength" in caption(pressure(), 5)


def test_contrast_is_held_until_it_is_released(bench):
    """Held, all wavelengths share limits; released, each has the limits of its own plane; held again, as before."""
    shown = pressure()
    layer = bench.layers.show(shown, "initial_pressure")
    common = tuple(layer.contrast_limits)
    bench.viewing.go_to(900)
    assert tuple(layer.contrast_limits) == common
    bench.viewing.contrast_held = False
    for plane, wavelength in enumerate(WAVELENGTHS_NM):
        bench.viewing.go_to(wavelength)
        assert layer.contrast_limits[1] == pytest.approx(np.percentile(shown.values[plane], 99.9))
    bench.viewing.contrast_held = True
    assert tuple(layer.contrast_limits) == common


def test_an_image_of_one_plane_is_seen_at_every_wavelength(bench):
    """Saturation has no wavelength: the slider moves under it."""
    bench.layers.show(pressure(), "initial_pressure")
    saturation = bench.layers.show(image(np.full(30, 0.5), "so2"), "so2")
    for wavelength in WAVELENGTHS_NM:
        bench.viewing.go_to(wavelength)
        assert saturation.get_value(tuple(bench.viewer.dims.point), world=True) == 0.5


def test_lengths_stay_in_mm_whatever_is_shown(bench):
    """Layers with and without wavelengths and an outline together leave the axes of the world in mm."""
    bench.layers.show(pressure(), "initial_pressure")
    bench.layers.show(image(np.full(30, 0.5), "so2"), "so2")
    bench.layers.show(disc_boundary(), "boundary")
    assert [str(unit) for unit in bench.viewer.layers.extent.units[-2:]] == ["millimeter", "millimeter"]
    assert bench.viewer.canvas.overlays.scale_bar.visible


def test_an_image_takes_the_place_of_the_one_before(bench):
    """A second image under one key leaves one layer, on its own grid, with limits where the user had put them."""
    layer = bench.layers.show(pressure(), "initial_pressure")
    layer.contrast_limits = (0, layer.contrast_limits[1] / 2)
    brighter = Image(10 * pressure().values, "initial_pressure", "a.u.", GRID, WAVELENGTHS_NM)
    assert bench.layers.show(brighter, "initial_pressure") is layer
    assert layer.contrast_limits[1] == pytest.approx(Limits.of(brighter).high / 2)
    positive = Image(abs(brighter.values), "initial_pressure", "a.u.", GRID, WAVELENGTHS_NM)
    bench.layers.show(positive, "initial_pressure")
    assert "no negative pixels" in _text(bench)
    assert len(bench.viewer.layers) == 1
    bench.layers.show(image(np.ones(30)), "initial_pressure")
    assert [shown.quantity for _, _, shown in bench.layers.shown()] == ["initial_pressure"]


def test_a_thinned_curve_stays_within_the_tolerance():
    """No point of a curve is further from the thinned one than the tolerance, as with that of scikit-image."""
    from skimage.measure import approximate_polygon

    angle = np.linspace(0, 2 * np.pi, 400)
    curve = np.column_stack([(5 + np.cos(5 * angle)) * np.sin(angle), 7 * np.cos(angle)])
    curve[-1] = curve[0]
    for tolerance in (0.02, 0.1, 0.5):
        line = thinned(curve, tolerance)
        between = np.concatenate([np.linspace(a, b, 2000) for a, b in itertools.pairwise(line)])
        off = [np.hypot(*(between - point).T).min() for point in curve]
        assert max(off) <= tolerance + 5e-3  # points on the line lie that close to one another
        assert np.array_equal(line, approximate_polygon(curve, tolerance))


def test_the_outline_goes_around_the_body(bench):
    """The polygon of a disc has its area, lies about its middle, and stays on top of images that come later."""
    layer = bench.layers.show(disc_boundary(1.5e-3), "boundary")
    bench.layers.show(pressure(), "initial_pressure")
    (line,) = layer.data
    assert abs(area(from_world(line))) == pytest.approx(np.pi * 1.5e-3**2, rel=0.02)
    assert np.allclose(from_world(line).mean(axis=0), GRID.centre_m, atol=1e-4)
    assert bench.viewer.layers[-1] is layer
    bench.layers.show(disc_boundary(1e-3), "boundary")
    assert abs(area(from_world(layer.data[0]))) == pytest.approx(np.pi * 1e-3**2, rel=0.03)


def test_a_body_that_was_not_found_has_no_outline(bench):
    """A boundary without a contour is an empty layer, and no error."""
    assert outlines(disc_boundary(-1.0)) == []
    assert len(bench.layers.show(disc_boundary(-1.0), "boundary").data) == 0


def test_a_result_shows_first_what_is_looked_for(bench):
    """Pressure, outline and saturation are seen at first; the rest waits, in the order in which light makes it."""
    names = ("so2", "boundary", "absorption", "initial_pressure", "fluence", "oxyhaemoglobin")
    images = {name: image(np.linspace(0, 1, 30), name) for name in names} | {"boundary": disc_boundary()}
    bench.layers.show_result(Result(images, pipeline={"reconstruct": {"use": "tv"}}))
    layers = bench.viewer.layers
    assert {layer.name for layer in layers if layer.visible} == {"initial pressure", "so2", "boundary"}
    assert [layer.name for layer in layers][:3] == ["initial pressure", "fluence", "absorption"]
    assert layers[-1].name == "boundary"
    assert layers.selection.active.name == "so2"
    assert all(layer.metadata[KEY]["result"].pipeline["reconstruct"]["use"] == "tv" for layer in layers)


def test_a_new_result_leaves_nothing_of_the_old_one(bench):
    """Images that the last result had and this one has not are taken away; other results and layers stay."""
    both = {name: image(np.linspace(0, 1, 30), name) for name in ("initial_pressure", "so2")}
    bench.layers.show_result(Result(both))
    bench.layers.show_result(Result(both), "other")
    bench.layers.show(image(np.ones(30)), "scan")
    bench.layers.show_result(Result({"initial_pressure": both["initial_pressure"]}))
    keys = {key for _, key, _ in bench.layers.shown()}
    assert keys == {"initial_pressure", "other/initial_pressure", "other/so2", "scan"}


@pytest.fixture
def long_result(tmp_path):
    """A stored result of three frames, of which the middle one failed."""

    def frame(seed):
        images = {"initial_pressure": pressure(seed), "boundary": disc_boundary((1 + 0.2 * seed) * 1e-3)}
        return Result(images, frame_index=seed)

    return load(write_frames(tmp_path / "long.zarr", frame(0), "no light", frame(2)))


def test_frames_have_an_axis_of_their_own(bench, long_result):
    """Each step of the frame slider shows that frame, its outline and its number; a failed one says why."""
    bench.layers.show_result(long_result, "long")
    layer = bench.layers.find("long/initial_pressure")
    assert layer.data.shape == (3, 3, *GRID.shape)
    for frame in (2, 0):
        bench.viewer.dims.set_current_step(0, frame)
        for row, column in ((0, 0), (4, 7)):
            where = layer.data_to_world((frame, 0, row, column))
            assert layer.get_value(where, world=True) == pressure(frame).values[0, ::-1][row, column]
        assert _text(bench).startswith(f"frame {frame} · 700 nm")
        (line,) = bench.layers.find("long/boundary").data
        assert abs(area(from_world(line))) == pytest.approx(np.pi * ((1 + 0.2 * frame) * 1e-3) ** 2, rel=0.03)
        assert {key for _, key, _ in bench.layers.shown()} == {"long/initial_pressure", "long/boundary"}
    bench.viewer.dims.set_current_step(0, 1)
    assert "no light" in _text(bench)
    assert np.isnan(layer.data[1]).all()
    assert len(bench.layers.find("long/boundary").data) == 0


def test_no_more_is_read_than_is_looked_at():
    """Of a hundred frames, looking at two of them reads these and at most those beside them, each once."""
    read = []

    def one(index):
        read.append(index)
        return pressure(index)

    planes = StoredPlanes(one, 100, pressure(), 3, Memo())
    for frame in (40, 40, 41, 40):
        assert np.array_equal(planes[frame, 1], pressure(frame).values[1, ::-1])
    planes._reader.join()
    assert set(read) <= {39, 40, 41, 42}
    assert len(read) == len(set(read))


def test_frames_are_cut_like_an_array():
    """Any slice of the lazy array equals that of the array that holds all frames."""
    whole = np.stack([pressure(i).values[:, ::-1] for i in range(4)])
    planes = StoredPlanes(pressure, 4, pressure(), 3, Memo())
    for key in (0, (3, 2), (slice(1, 3), 0), (slice(None), slice(None), 4), (-1, slice(None), slice(2, 5), 3)):
        assert np.array_equal(planes[key], whole[key])


def test_a_picture_has_red_where_the_image_is_negative(make_napari_viewer_proxy):
    """Of the picture on the screen, each pixel is pure red where the image is below zero, and nowhere else."""
    viewer = make_napari_viewer_proxy(show=True)
    bench = workbench(viewer)
    shown = pressure()
    bench.layers.show(shown, "initial_pressure")
    bench.viewing.go_to(900)
    for overlay in (viewer.canvas.overlays.text, viewer.canvas.overlays.scale_bar):
        overlay.visible = False
    picture = viewer.export_figure(scale_factor=4, flash=False)[2::4, 2::4, :3]
    assert np.array_equal((picture == (255, 0, 0)).all(axis=2), shown.values[2, ::-1] < 0)
