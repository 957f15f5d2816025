"""Optical properties of the body: numbers, a preset, or a user's table; 1/cm outside, 1/m inside."""

import numpy as np
import pytest

from oatkit import ReadError, ValidationError
from oatkit.spectra import tissue_optics
from oatkit.tables import OpticsTable

WAVELENGTHS_NM = (800.0, 700.0)


def table(tmp_path, text: str):
    """A CSV file."""
    path = tmp_path / "optics.csv"
    path.write_text(text)
    return path


GOOD = """# my tissue
wavelength_nm, absorption_per_cm, other, reduced_scattering_per_cm
900, 0.4, x, 8
700, 0.2, x, 12
"""


def test_numbers_hold_at_every_wavelength_in_si_units():
    """0.2 and 12 per cm are 20 and 1200 per m, whatever the wavelength."""
    optics = OpticsTable(absorption_per_cm=0.2, reduced_scattering_per_cm=12.0).optics(WAVELENGTHS_NM)
    np.testing.assert_allclose(optics.absorption_per_m, [20, 20])
    np.testing.assert_allclose(optics.reduced_scattering_per_m, [1200, 1200])
    assert optics.wavelengths_nm == WAVELENGTHS_NM


def test_a_number_takes_the_place_of_the_tissues_value():
    """One property given as a number leaves the other to the tissue."""
    optics = OpticsTable(tissue="muscle", absorption_per_cm=0.2).optics(WAVELENGTHS_NM)
    np.testing.assert_allclose(optics.absorption_per_m, [20, 20])
    expected = tissue_optics("muscle", WAVELENGTHS_NM).reduced_scattering_per_m
    np.testing.assert_array_equal(optics.reduced_scattering_per_m, expected)


def test_a_table_is_interpolated_by_wavelength(tmp_path):
    """Half way between two rows lies the mean of both; rows and wavelengths come in any order."""
    optics = OpticsTable(table=table(tmp_path, GOOD)).optics(WAVELENGTHS_NM)
    np.testing.assert_allclose(optics.absorption_per_m, [30, 20])
    np.testing.assert_allclose(optics.reduced_scattering_per_m, [1000, 1200])


def test_a_wavelength_outside_the_table_is_refused(tmp_path):
    """There is no extrapolation."""
    with pytest.raises(ValidationError, match=r"680 nm is outside the table, which covers 700 \.\. 900 nm"):
        OpticsTable(table=table(tmp_path, GOOD)).optics((700.0, 680.0))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "missing: wavelength_nm"),
        ("wavelength_nm,absorption_per_cm\n700,1\n", "missing: reduced_scattering_per_cm"),
        (GOOD.replace("0.4", "high"), "expected a number"),
        (GOOD.replace("0.4", "nan"), "finite numbers"),
        (GOOD.replace("0.4", "-0.4"), "none of them negative"),
        (GOOD.replace("900", "700"), "more than one row"),
        ("wavelength_nm,absorption_per_cm,reduced_scattering_per_cm\n", "one or more rows"),
        ("wavelength_nm,absorption_per_cm,reduced_scattering_per_cm\n700,1\n", "expected a number"),
    ],
)
def test_a_file_that_is_no_such_table_gets_a_sentence(tmp_path, text, sentence):
    """What is wrong with a table is said, with its path."""
    path = table(tmp_path, text)
    with pytest.raises(ReadError, match=sentence) as caught:
        OpticsTable(table=path).optics(WAVELENGTHS_NM)
    assert str(path) in str(caught.value)


def test_a_missing_table_and_one_that_is_no_text_are_read_errors(tmp_path):
    """A path that leads nowhere and a binary file are refused by name."""
    with pytest.raises(ReadError, match="no such file"):
        OpticsTable(table=tmp_path / "gone.csv").optics(WAVELENGTHS_NM)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(ReadError, match="no text"):
        OpticsTable(table=tmp_path / "binary.csv").optics(WAVELENGTHS_NM)
