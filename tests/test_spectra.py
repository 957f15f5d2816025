"""Spectra and tissues: units, ranges, and the tables that they come from."""

import numpy as np
import pytest

from oatkit.errors import ValidationError
from oatkit.spectra import (
    TISSUES,
    haemoglobin_absorption_per_m,
    lipid_absorption_per_m,
    tissue_optics,
    water_absorption_per_m,
)  # fmt: skip


def test_water_absorbs_what_its_tables_say():
    """Per metre: 0.6 at 700 nm and 45 at 975 nm for water, 0.647 at 700 nm for heavy water (as scanners store it)."""
    assert water_absorption_per_m([700, 975]) == pytest.approx([0.6, 45])
    assert water_absorption_per_m([700], "d2o") == pytest.approx([0.647], abs=5e-4)


def test_heavy_water_is_the_clearer_one_beyond_its_band():
    """From 930 to 1000 nm, heavy water absorbs less than a tenth of what water does."""
    wavelengths = np.arange(930, 1001)
    assert (water_absorption_per_m(wavelengths, "d2o") < 0.1 * water_absorption_per_m(wavelengths)).all()


def test_blood_absorbs_by_moles():
    """At 800 nm, 150 g/l of haemoglobin absorb ln(10) * 816 (oxygenated) and 761.72 /cm/M * 150 / 64500 M."""
    expected = 100 * np.log(10) * np.array([[816.0], [761.72]]) * 150 / 64500
    assert haemoglobin_absorption_per_m([800]) == pytest.approx(expected)


def test_fat_has_its_band_at_930_nm():
    """Fat absorbs 13.1 /m at 930 nm, in the unit of its table."""
    assert lipid_absorption_per_m([930]) == pytest.approx([13.1])


def test_spectra_are_linear_between_rows_and_keep_the_order():
    """Half-way between two rows lies their mean; wavelengths may come in any order."""
    rows = water_absorption_per_m([971, 970])
    assert rows[::-1] == pytest.approx(water_absorption_per_m([970, 971]))
    assert water_absorption_per_m([970.5]) == pytest.approx([rows.mean()])


@pytest.mark.parametrize("wavelength", [449, 1001, 700e-9, np.nan])
def test_nothing_is_known_beyond_a_table(wavelength):
    """A wavelength out of a table's range, or NaN, is refused with the range."""
    with pytest.raises(ValidationError, match=r"450 \.\. 1000 nm"):
        water_absorption_per_m([700, wavelength])


@pytest.mark.parametrize("name", TISSUES)
def test_every_tissue_is_the_sum_of_its_parts(name):
    """mu_a is B (S oxy + (1 - S) deoxy) + W water + F fat, mu_s' is a (lambda / 500)^-b; the source is named."""
    tissue = TISSUES[name]
    wavelengths = (900.0, 500.0)
    optics = tissue_optics(name, wavelengths)
    oxy, deoxy = haemoglobin_absorption_per_m(wavelengths)
    blood = tissue.oxygen_saturation * oxy + (1 - tissue.oxygen_saturation) * deoxy
    parts = tissue.blood_volume * blood + tissue.water * water_absorption_per_m(wavelengths)
    assert optics.absorption_per_m == pytest.approx(parts + tissue.fat * lipid_absorption_per_m(wavelengths))
    expected = tissue.scattering_per_m * np.array([1.8**-tissue.scattering_power, 1])
    assert optics.reduced_scattering_per_m == pytest.approx(expected)
    assert "Phys. Med. Biol." in tissue.source
    assert tissue.water + tissue.fat + tissue.blood_volume <= 1.05


@pytest.mark.parametrize(
    ("name", "per_cm"), [("bone", 38.4), ("muscle", 9.8), ("lung", 25.4), ("skin", 30.6), ("kidney", 35.1)]
)
def test_scattering_of_mouse_tissues_is_that_of_two_reviews(name, per_cm):
    """The power laws of Alexandrakis et al. give at 500 nm what Jacques lists for them."""
    assert TISSUES[name].scattering_per_m == pytest.approx(100 * per_cm, rel=6e-3)


def test_unknown_tissue_is_answered_with_the_nearest():
    """An unknown name is refused, with the one that was meant."""
    with pytest.raises(ValidationError, match="did you mean 'muscle'"):
        tissue_optics("mucsle", (800,))
