"""Grids, detectors, geometries, scans and images keep what they promise."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oatkit import Detectors, Geometry, Grid, Image, Scan, ValidationError


def ring(n: int = 8, radius_m: float = 0.04) -> Detectors:
    """N detectors evenly on a circle about the origin."""
    angle = 2 * np.pi * np.arange(n) / n
    return Detectors(np.column_stack([radius_m * np.sin(angle), radius_m * np.cos(angle)]))


def scan_of(signals: np.ndarray, **parts) -> Scan:
    """A scan on a ring with the given signals."""
    geometry = Geometry(ring(signals.shape[2]), 40e6, signals.shape[3])
    return Scan(signals, geometry, tuple(700.0 + 10 * i for i in range(signals.shape[1])), **parts)


@given(ny=st.integers(1, 40), nx=st.integers(1, 40), h=st.floats(1e-5, 1e-3), y=st.floats(-0.1, 0.1))
def test_pixels_are_centred_on_the_grid(ny, nx, h, y):
    """Pixel centres have the stated pitch, the stated middle, and edges half a pixel outside the outermost centres."""
    grid = Grid((ny, nx), h, (y, 0.0))
    assert grid.y_m.mean() == pytest.approx(y, abs=1e-12)
    assert np.allclose(np.diff(grid.x_m), h)
    left, right, bottom, top = grid.extent_m
    assert right - left == pytest.approx(nx * h)
    assert bottom == pytest.approx(grid.y_m[0] - h / 2)
    assert top == pytest.approx(grid.y_m[-1] + h / 2)


@pytest.mark.parametrize(
    ("make", "hint"),
    [
        (lambda: Grid((10, 10), 0.1), "unit is m"),
        (lambda: Grid((10, 10), float("nan")), "unit is m"),
        (lambda: Grid((0, 10), 1e-4), "(ny, nx)"),
        (lambda: Grid((float("nan"), 10), 1e-4), "(ny, nx)"),
        (lambda: Geometry(ring(), 40e6, 100.5), "whole number"),
        (lambda: Detectors([[40.0, 0.0]]), "40 mm is 0.04"),
        (lambda: Detectors([[0.04, 0.0, 0.0]]), "from_xyz"),
        (lambda: Detectors.from_xyz([[0.04, 0.0, 0.0], [0.04, 0.0, 0.01]]), "one plane"),
        (lambda: Geometry(ring(), 40.0, 100), "40 MHz is 40e6"),
        (lambda: Geometry(ring(), 40e6, 0), "at least one sample"),
        (lambda: Geometry(ring(), 40e6, 100, speed_of_sound_m_s=1.5), "m/s"),
        (lambda: Geometry(ring(), 40e6, 100, start_time_s=10.0), "10 us"),
        (lambda: Geometry(ring(), 40e6, 100, impulse_response=np.zeros(5)), "non-zero"),
        (lambda: scan_of(np.zeros((1, 1, 8, 5)), valid=np.ones((1, 8))), "expected shape (1, 1, 8)"),
        (lambda: Scan(np.zeros((1, 1, 8, 5)), Geometry(ring(), 40e6, 5), (700e-9,)), "700e-9 m is 700"),
        (lambda: Scan(np.zeros((1, 2, 8, 5)), Geometry(ring(), 40e6, 5), (700,)), "2 wavelengths in the data"),
        (lambda: Scan(np.zeros((1, 1, 8, 6)), Geometry(ring(), 40e6, 5), (700,)), "geometry says (8, 5)"),
        (lambda: Scan(np.zeros((1, 1, 8, 5), complex), Geometry(ring(), 40e6, 5), (700,)), "real numbers"),
        (lambda: Image(np.zeros((2, 3)), "p", "", Grid((3, 2), 1e-4)), "expected shape (1, 3, 2)"),
        (lambda: Image(np.zeros((3, 2), int), "p", "", Grid((3, 2), 1e-4)), "float32 or float64"),
    ],
)
def test_impossible_values_are_refused_with_a_hint(make, hint):
    """A value out of its physical range is refused in one sentence that hints at the unit or the shape."""
    with pytest.raises(ValidationError) as caught:
        make()
    assert hint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_grid_that_holds_detectors_is_refused():
    """A field of view that reaches the detectors (a slip of units, usually) is refused."""
    geometry = Geometry(ring(), 40e6, 2000)
    geometry.check_grid(Grid((100, 100), 0.25e-3))
    with pytest.raises(ValidationError, match="8 of 8 detectors lie inside"):
        geometry.check_grid(Grid((100, 100), 1e-3))


def test_a_grid_outside_the_record_is_refused():
    """A field of view that no sample of the record reaches is refused."""
    with pytest.raises(ValidationError, match="start time"):
        Geometry(ring(), 40e6, 100).check_grid(Grid((100, 100), 0.2e-3))


def test_points_in_file_order_become_y_x():
    """`Detectors.from_xyz` takes (x, y, z) and holds (y, x)."""
    assert Detectors.from_xyz([[0.01, 0.02, 0.0]]).positions_m.tolist() == [[0.02, 0.01]]


def test_arrays_are_read_only_copies_even_after_pickling():
    """Nobody can change an image or a scan under its owner, not by the array handed in, and not after pickling."""
    values = np.ones((3, 2))
    image = Image(values, "p", "Pa", Grid((3, 2), 1e-4), history=({"step": "x"},), diagnostics={"a": 1})
    values[0, 0] = 7
    for one in (image, pickle.loads(pickle.dumps(image))):
        assert one.values[0, 0, 0] == 1
        with pytest.raises(ValueError, match="read-only"):
            one.values[0, 0, 0] = 2
        with pytest.raises(TypeError):
            one.diagnostics["a"] = 2


def test_content_decides_equality_and_hash():
    """Two images with the same content are equal and hash alike, one changed bit makes them differ."""
    grid = Grid((3, 2), 1e-4)
    one, two = (Image(np.arange(6.0).reshape(3, 2), "p", "Pa", grid) for _ in range(2))
    other = Image(np.nextafter(one.values, 9), "p", "Pa", grid)
    assert one == two
    assert hash(one) == hash(two)
    assert pickle.loads(pickle.dumps(one)) == one
    assert one != other


def test_what_lies_in_a_tuple_counts():
    """Images whose diagnostics differ in one element of an array within a tuple are not equal."""
    changed = np.arange(5000.0)
    changed[2500] = -1
    grid = Grid((3, 2), 1e-4)
    one, other = (
        Image(np.ones((3, 2)), "p", "Pa", grid, diagnostics={"a": (v,)}) for v in (np.arange(5000.0), changed)
    )
    assert one != other
    assert one == pickle.loads(pickle.dumps(one))


def test_a_scan_is_its_data_and_not_its_name():
    """A scan that was moved or renamed keeps its fingerprint; one changed sample gives another."""
    signals = np.ones((1, 1, 8, 5))
    scan = scan_of(signals, name="a", source="/here")
    assert scan_of(signals, name="b", source="/there").fingerprint == scan.fingerprint
    signals[0, 0, 0, 0] = 2
    assert scan_of(signals, name="a", source="/here").fingerprint != scan.fingerprint


def test_one_frame_keeps_its_own_rows():
    """`Scan.frame` picks the signals, channels and energies of that frame alone."""
    signals = np.arange(2 * 1 * 8 * 5, dtype=np.uint16).reshape(2, 1, 8, 5)
    valid = np.ones((2, 1, 8), bool)
    valid[1, 0, 3] = False
    scan = scan_of(signals, valid=valid, pulse_energy=[[1.0], [2.0]])
    one = scan.frame(1)
    assert one.frames == 1
    assert np.array_equal(one.signals, signals[1:])
    assert one.pulse_energy.tolist() == [[2.0]]
    assert not one.valid[0, 0, 3]
    with pytest.raises(ValidationError, match=r"frames 0 \.\. 1"):
        scan.frame(2)
