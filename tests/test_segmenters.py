"""Segmenters against bodies with a known outline, against formulas, and against brute force."""

import io
from itertools import product

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import oatkit
from oatkit.api import FluenceModel, Grid, Image, ReadError, SolverError, ValidationError
from oatkit.builtin.segmenters.closed_path import cheapest_closed_path
from oatkit.builtin.segmenters.contours import smoothed
from oatkit.outlines import dice, hausdorff_m
from oatkit.simulate import disc_body, mouse_body, simulate_scan, star_body

GRID = Grid((200, 200), 125e-6)
FINDERS = ("radial", "active-contour", "geodesic")


class Depth(FluenceModel):
    """Light that falls off exponentially with depth, as deep in a scattering medium."""

    name = "depth"

    def fluence(self, boundary, optics):
        mu_a, mu_s = optics.absorption_per_m, optics.reduced_scattering_per_m
        decay = np.sqrt(3 * mu_a * (mu_a + mu_s))[:, None, None]
        light = np.exp(decay * np.minimum(boundary.values, 0))
        return Image(light, "fluence", "", boundary.grid, optics.wavelengths_nm)


def segmenter(name, **parameters):
    """A segmenter by its name."""
    return oatkit.plugin("segmenter", name)(**parameters)


def picture(body, grid=GRID, noise=0.05, seed=0):
    """What a reconstruction looks like: lit, blurred, with a negative halo, noise and streaks; its mean inside is 1."""
    rng = np.random.default_rng(seed)
    pressure = body.lit(grid, Depth(), 1000.0, 30.0)[0].values[0]
    mean = pressure[pressure > 0].mean()
    pressure = gaussian_filter(pressure, 1.2)
    pressure -= 0.05 * gaussian_filter(pressure, 12)
    clutter = gaussian_filter(rng.standard_normal(grid.shape), 1) + 2 * gaussian_filter(
        rng.standard_normal(grid.shape), (1, 8)
    )
    return pressure_image(pressure / mean + noise * clutter / clutter.std(), grid)


def pressure_image(values, grid=GRID, **more):
    """An image of initial pressure."""
    return Image(np.asarray(values, float), "initial_pressure", "Pa", grid, **more)


BODIES = {
    "disc": disc_body, "off-centre disc": lambda: disc_body(5e-3, (3e-3, -4e-3)), "star": star_body,
    "mouse": mouse_body, "another mouse": lambda: mouse_body(7),
}  # fmt: skip


@pytest.mark.parametrize("name", FINDERS)
@pytest.mark.parametrize("kind", BODIES)
def test_a_body_is_found(kind, name):
    """Dice is at least 0.99, the area right to 1 %, nothing noted, and no point off by 0.25 mm.

    But for the star's tip, 0.5 mm thick over a tube ten times as bright, which the level set of `geodesic` cuts off.
    """
    body = BODIES[kind]()
    boundary = segmenter(name).segment(picture(body))
    assert dice(boundary, body.boundary(boundary.grid)) >= 0.99
    assert hausdorff_m(boundary, body.outline_m) <= (0.7e-3 if (kind, name) == ("star", "geodesic") else 0.25e-3)
    true_area = (body.boundary(GRID).values < 0).sum() * 0.125**2
    assert boundary.diagnostics["area_mm2"] == pytest.approx(true_area, rel=0.01)
    assert boundary.diagnostics["notes"] == ()


@pytest.mark.parametrize("name", FINDERS)
def test_a_boundary_is_a_signed_distance_in_metres(name):
    """Its name and unit say so, and its slope is 1 in all but 5 % of pixels, at the wall as well."""
    boundary = segmenter(name).segment(picture(mouse_body()))
    assert (boundary.quantity, boundary.unit, boundary.grid) == ("boundary", "m", GRID)
    slope = np.hypot(*np.gradient(boundary.values[0], GRID.pixel_size_m))
    assert np.quantile(abs(slope - 1), 0.95) <= 0.05
    assert np.quantile(abs(slope - 1)[abs(boundary.values[0]) < 2e-4], 0.95) <= 0.05


@pytest.mark.parametrize("name", ["active-contour", "geodesic"])
def test_legs_are_entered_where_the_radial_path_bridges_them(name):
    """The hollows beside the legs are found to 0.3 mm; the radial path is off by more than 1 mm there and says so."""
    body = mouse_body(2, legs=True)
    image = picture(body)
    assert hausdorff_m(segmenter(name).segment(image), body.outline_m) <= 0.3e-3
    bridged = segmenter("radial").segment(image)
    assert hausdorff_m(bridged, body.outline_m) > 1e-3
    assert "try the segmenter 'active-contour' or 'geodesic'" in bridged.diagnostics["notes"][0]


@pytest.mark.parametrize("name", FINDERS)
def test_units_and_place_do_not_matter(name):
    """An image in other units, however odd, on a grid that lies elsewhere, gives the same distances to 1 nm."""
    image = picture(disc_body())
    first = segmenter(name).segment(image).values
    for factor in (1e-7, 1e200):
        elsewhere = pressure_image(factor * image.values, Grid(GRID.shape, GRID.pixel_size_m, (5e-3, -3e-3)))
        assert segmenter(name).segment(elsewhere).values == pytest.approx(first, abs=1e-9)


@pytest.mark.parametrize("name", FINDERS)
def test_wavelengths_are_weighed_alike(name):
    """Two planes that differ by a factor and a dark third one give the boundary of one plane."""
    one = picture(disc_body()).values[0]
    three = pressure_image(np.stack([one, 1000 * one, 0 * one]), wavelengths_nm=(700.0, 800.0, 900.0))
    alone, together = (segmenter(name).segment(i).values for i in (pressure_image(one), three))
    assert together.shape == (1, 200, 200)
    assert together == pytest.approx(alone, abs=1e-9)


def test_where_the_snake_strays_the_radial_path_is_kept():
    """In noise that leaves no wall to half of the contour, the result is that of `radial` and the notes say so."""
    image = picture(disc_body(), noise=0.5)
    snake = segmenter("active-contour").segment(image)
    radial = segmenter("radial", rigidity=0.3).segment(image)
    assert (snake.values == radial.values).all()
    assert "the radial path that it started from is returned" in snake.diagnostics["notes"][0]
    assert dice(snake, disc_body().boundary(snake.grid)) >= 0.99


@pytest.mark.parametrize("name", FINDERS)
@pytest.mark.parametrize(
    "values",
    [np.zeros((80, 80)), np.full((80, 80), 3.0), np.random.default_rng(0).standard_normal((80, 80)), np.ones((1, 1))],
    ids=["zero", "constant", "noise", "one pixel"],
)
def test_no_body_is_an_error_that_names_the_way_out(values, name):
    """An image that shows no body is refused, and the message names the segmenter that takes a mask."""
    with pytest.raises(SolverError, match=r"no body stands out .* 'mask'"):
        segmenter(name).segment(pressure_image(values, Grid(values.shape, 3e-4)))


@pytest.mark.parametrize("name", FINDERS)
def test_an_image_with_nan_is_refused(name):
    """It is the input that is wrong, and the message says how."""
    values = picture(disc_body()).values[0].copy()
    values[3, 4] = np.nan
    with pytest.raises(ValidationError, match="not finite"):
        segmenter(name).segment(pressure_image(values))


@pytest.mark.parametrize("name", FINDERS)
def test_a_body_that_is_cut_is_closed_along_the_edge(name):
    """The note says so, and inside the field of view the body is found with a Dice of 0.99."""
    body = disc_body(9e-3, (6e-3, 2e-3))
    boundary = segmenter(name).segment(picture(body))
    assert dice(boundary, body.boundary(boundary.grid)) >= 0.99
    assert any("cut by the field of view" in note for note in boundary.diagnostics["notes"])


def test_a_tiny_body_is_found_and_doubted():
    """A disc of 1 mm is found where it is, with a note that it is implausibly small."""
    body = disc_body(1e-3, (4e-3, 2e-3))
    sharp = gaussian_filter((body.boundary(GRID).values[0] < 0).astype(float), 1.0)
    boundary = segmenter("radial").segment(pressure_image(sharp))
    assert hausdorff_m(boundary, body.outline_m) <= 0.1e-3
    assert any("implausibly small: 3." in note for note in boundary.diagnostics["notes"])


def test_the_closed_path_is_the_cheapest_of_all():
    """On small strips with random costs its cost is that of the best of all closed paths, listed one by one."""
    rng = np.random.default_rng(0)

    def price(cost, bending, max_step, path):
        steps = np.diff([*path, path[0]])
        return np.inf if abs(steps).max() > max_step else cost[range(len(path)), path].sum() + bending * (steps @ steps)

    for _ in range(60):
        cost = rng.standard_normal(rng.integers(2, 6, 2))
        bending, max_step = rng.choice([0, 0.1, 1.0]), int(rng.integers(1, 4))
        every = product(range(cost.shape[1]), repeat=len(cost))
        best = min(price(cost, bending, max_step, path) for path in every)
        found = price(cost, bending, max_step, cheapest_closed_path(cost, bending, max_step))
        assert found == pytest.approx(best, abs=1e-12)


def test_rigidity_damps_waves_by_its_formula():
    """On a circle of radius R a wave of k periods is divided by 1 + (r k / R)^4, R itself by 1 + (r / R)^4, to 1 %."""
    angle = np.arange(20_000) * 2 * np.pi / 20_000
    wave = np.exp(1j * angle) * (8e-3 + 1e-5 * np.cos(24 * angle))
    out = smoothed(np.column_stack([wave.imag, wave.real]), 5e-5, rigidity_mm=0.4)
    radius = np.hypot(*out.T)
    spectrum = abs(np.fft.rfft(radius)) / len(radius)
    assert spectrum[0] == pytest.approx(8e-3 / (1 + (0.4 / 8) ** 4), rel=1e-6)
    # A radial wave of k periods is made of the harmonics k - 1 and k + 1 of the position.
    expected = 0.25e-5 * sum(1 / (1 + (0.4 / 8 * k) ** 4) for k in (23, 25))
    assert spectrum[24] == pytest.approx(expected, rel=0.01)


class TestPolygon:
    def test_its_distance_is_exact(self):
        """For a square it is that of the formula, to rounding, whatever the image shows."""
        square = segmenter("polygon", vertices=((-2.0, -2.0), (4.0, -2.0), (4.0, 4.0), (-2.0, 4.0)))
        boundary = square.segment(pressure_image(np.zeros(GRID.shape)))
        y, x = abs(GRID.y_m[:, None] - 1e-3) - 3e-3, abs(GRID.x_m[None, :] - 1e-3) - 3e-3
        expected = np.hypot(np.maximum(y, 0), np.maximum(x, 0)) + np.minimum(np.maximum(y, x), 0)
        assert boundary.values[0] == pytest.approx(expected, abs=1e-15)
        assert boundary.diagnostics["area_mm2"] == pytest.approx(36)

    @pytest.mark.parametrize(
        ("vertices", "message"),
        [
            (((0.0, 0.0), (1.0, 1.0)), "expected 3 .. 2000 corners, got 2"),
            (((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)), "enclose no area"),
            (((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 2.0)), "the side from corner 0 crosses the one from corner 2"),
            (((0.0, 0.0), (1.0, np.nan), (1.0, 0.0)), "must be a list"),
            (((0.0, 0.0), (1.0, 2000.0), (1.0, 0.0)), "mm"),
        ],
    )
    def test_what_is_no_polygon_is_refused(self, vertices, message):
        """Too few corners, no area, crossing sides and slipped units are errors that say so."""
        with pytest.raises(ValidationError, match=message):
            segmenter("polygon", vertices=vertices)

    def test_one_outside_the_field_of_view_is_an_error(self):
        """Nothing of it is left, and the message says that no area is enclosed."""
        far = segmenter("polygon", vertices=((50.0, 50.0), (50.0, 60.0), (60.0, 60.0)))
        with pytest.raises(SolverError, match="less than a pixel"):
            far.segment(pressure_image(np.zeros(GRID.shape)))

    def test_it_survives_a_pipeline_file(self, tmp_path):
        """Corners written to TOML and read back are the same."""
        path = tmp_path / "pipeline.toml"
        changes = ["segment.use=polygon", "segment.vertices=[[0, 0], [0, 5.5], [-3, 1]]"]
        first = oatkit.Pipeline.load("lsqr", changes)
        first.save(path)
        assert oatkit.Pipeline.load(str(path)).segment == first.segment
        assert first.segment.vertices == ((0, 0), (0, 5.5), (-3, 1))


def write_mask(path, labels):
    """Write labels in the format of the suffix, as they are."""
    if path.suffix == ".npy":
        np.save(path, labels)
    elif path.suffix == ".png":
        from PIL import Image as Picture

        Picture.fromarray(labels).save(path)
    else:
        from tifffile import imwrite

        imwrite(path, labels)
    return path


class TestMask:
    blank = pressure_image(np.zeros(GRID.shape))
    body = disc_body(7e-3, (3e-3, -2e-3))

    def labels(self, grid=GRID):
        """The body as label 2 beside a spot of label 1, row 0 at the bottom."""
        labels = np.where(self.body.boundary(grid).values[0] < 0, 2, 0).astype(np.uint8)
        labels[:5, :5] = 1
        return labels

    @pytest.mark.parametrize("name", ["m.npy", "m.png", "m.tif", "M.TIFF"])
    def test_a_mask_lands_where_it_was_drawn(self, tmp_path, name):
        """Row 0 is at the bottom in .npy files and at the top in pictures; the outline is found to 0.05 mm."""
        drawn = self.labels() if name.endswith("npy") else self.labels()[::-1]
        boundary = segmenter("mask", path=write_mask(tmp_path / name, drawn), label=2).segment(self.blank)
        assert hausdorff_m(boundary, self.body.outline_m) <= 0.05e-3
        assert boundary.diagnostics["notes"] == ()

    def test_the_first_row_can_be_stated(self, tmp_path):
        """The same file read with row 0 at the top is the mirror image of that with row 0 at the bottom."""
        path = write_mask(tmp_path / "m.png", self.labels())
        up, down = (
            segmenter("mask", path=path, label=2, row_0=r).segment(self.blank).values for r in ("bottom", "top")
        )
        assert up[:, ::-1] == pytest.approx(down, abs=1e-9)
        assert dice(pressure_image(up), self.body.boundary(GRID)) >= 0.99

    def test_without_a_label_the_largest_piece_is_taken(self, tmp_path):
        """All labels count, the spot in the corner is left out, and a hole is filled."""
        labels = self.labels()
        labels[120:124, 80:84] = 0
        boundary = segmenter("mask", path=write_mask(tmp_path / "m.npy", labels)).segment(self.blank)
        assert dice(boundary, self.body.boundary(boundary.grid)) >= 0.995

    def test_many_pieces_are_mentioned(self, tmp_path):
        """Where more than 1 % of the area is left out, a note says how much."""
        labels = self.labels()
        labels[:40, :20] = 1
        boundary = segmenter("mask", path=write_mask(tmp_path / "m.npy", labels)).segment(self.blank)
        assert "of 2 separate pieces only the largest is kept" in boundary.diagnostics["notes"][0]

    def test_a_finer_mask_is_stretched_over_the_field_of_view(self, tmp_path):
        """One of 601 pixels gives the outline to 0.02 mm, half of its pixel."""
        fine = Grid((601, 601), 25e-3 / 601)
        path = write_mask(tmp_path / "m.npy", self.labels(fine))
        boundary = segmenter("mask", path=path, label=2).segment(self.blank)
        assert hausdorff_m(boundary, self.body.outline_m) <= 0.02e-3

    def test_another_aspect_is_refused(self, tmp_path):
        """The message names both shapes."""
        path = write_mask(tmp_path / "m.npy", self.labels()[:150])
        with pytest.raises(ValidationError, match="150 x 200 pixels, the image 200 x 200"):
            segmenter("mask", path=path).segment(self.blank)

    @pytest.mark.parametrize(
        ("labels", "message"),
        [
            (np.zeros((200, 200)), "only zeros"),
            (np.ones((200, 200)), "the whole field of view"),
            (np.full((200, 200), np.nan), "not finite"),
            (np.ones((200, 200, 3)), r"found the shape \(200, 200, 3\)"),
            (np.zeros((0, 5)), "expected 1 .. "),
            (np.full((20, 20), "a"), "found the type <U1"),
        ],
    )
    def test_what_is_no_mask_is_refused(self, tmp_path, labels, message):
        """Masks without a body or of another shape or type are errors that say what was found."""
        with pytest.raises((ValidationError, ReadError), match=message):
            segmenter("mask", path=write_mask(tmp_path / "m.npy", labels)).segment(self.blank)

    def test_a_label_that_is_not_there_is_named(self, tmp_path):
        """The message holds the label."""
        with pytest.raises(ValidationError, match="no pixel of label 9"):
            segmenter("mask", path=write_mask(tmp_path / "m.npy", self.labels()), label=9).segment(self.blank)

    def test_damaged_and_hostile_files_are_refused(self, tmp_path):
        """Pickles, truncated files, sizes that are not there, colours, foreign formats: each is a `ReadError`."""
        pickled = np.empty((2, 2), object)
        np.save(tmp_path / "pickle.npy", pickled, allow_pickle=True)
        huge = io.BytesIO()
        np.lib.format.write_array_header_1_0(huge, {"descr": "<f8", "fortran_order": False, "shape": (10**9, 10**9)})
        (tmp_path / "huge.npy").write_bytes(huge.getvalue())
        write_mask(tmp_path / "colour.png", np.zeros((4, 4, 3), np.uint8))
        write_mask(tmp_path / "pages.tif", np.zeros((3, 4, 4), np.uint8))
        for name in ("m.npy", "m.png", "m.tif"):
            whole = write_mask(tmp_path / name, self.labels()).read_bytes()
            (tmp_path / f"cut_{name}").write_bytes(whole[: len(whole) // 2])
            (tmp_path / f"text_{name}").write_text("no mask")
        (tmp_path / "m.csv").write_text("0,1")
        wrong = [p for p in tmp_path.iterdir() if p.stem != "m" or p.suffix == ".csv"]
        assert len(wrong) == 11
        for path in [*wrong, tmp_path / "missing.npy", tmp_path]:
            with pytest.raises(ReadError, match=path.name):
                segmenter("mask", path=path).segment(self.blank)


@pytest.mark.slow
def test_bodies_are_found_in_reconstructions_at_3_db():
    """Data of one operator on a finer grid, reconstructed with another: Dice at least 0.97, no point off by 0.5 mm.

    At a signal-to-noise ratio of 3 dB, for three bodies, three reconstructions and three segmenters.
    """
    immi = oatkit.plugin("forward_model", "immi")()
    for body in (mouse_body(), star_body(), disc_body()):
        scan = simulate_scan(
            lambda grid, body=body: body.lit(grid, Depth(), 1000.0, 30.0)[0], immi, pixels=331, snr_db=3
        )
        for preset in ("lsqr", "lsqr-threshold", "maxent"):
            image = oatkit.run(oatkit.Pipeline.load(preset), scan)["initial_pressure"]
            for name in FINDERS:
                boundary = segmenter(name).segment(image)
                assert dice(boundary, body.boundary(boundary.grid)) >= 0.97, (body.name, preset, name)
                assert hausdorff_m(boundary, body.outline_m) <= 0.5e-3, (body.name, preset, name)
