"""Spectra and tissues: units, ranges, and the tables that they come from."""

import numpy as np
import pytest

from oatkit.errors import ReadError, ValidationError
from oatkit.spectra import (
    CHROMOPHORES,
    TISSUES,
    chromophore,
    haemoglobin_absorption_per_m,
    haemoglobin_molar_absorption,
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


def test_haemoglobin_in_its_molar_unit_is_blood_by_its_content():
    """Whole blood of 150 g/l holds 150 / 64.5 mol/m^3: its absorption is that many times the molar one."""
    wavelengths = [680.0, 760.0, 900.0]
    expected = 150 / 64.5 * haemoglobin_molar_absorption(wavelengths)
    assert haemoglobin_absorption_per_m(wavelengths) == pytest.approx(expected)
    assert haemoglobin_molar_absorption([760]) == pytest.approx(np.log(10) / 10 * np.array([[586.0], [1548.52]]))


def test_both_forms_of_haemoglobin_absorb_alike_between_796_and_798_nm():
    """The isosbestic point near 797 nm: the difference of the two spectra changes its sign there."""
    oxy, deoxy = haemoglobin_molar_absorption([796.0, 798.0])
    assert (oxy[0] - deoxy[0]) * (oxy[1] - deoxy[1]) < 0


def test_melanin_follows_its_power_law():
    """The interior of a melanosome absorbs 1.7e12 nm^-3.48 per cm, so twice the wavelength leaves 2^-3.48 of it."""
    at_400, at_800 = CHROMOPHORES["melanin"].spectrum([400.0, 800.0])
    assert at_800 / at_400 == pytest.approx(2**-3.48)
    assert at_800 == pytest.approx(100 * 1.7e12 * 800**-3.48)


def test_icg_is_counted_by_its_maximum():
    """The spectrum of ICG is 1 at 810 nm, its maximum, and nowhere more."""
    spectrum = CHROMOPHORES["icg"].spectrum(np.arange(660.0, 1001.0))
    assert spectrum.max() == 1.0
    assert np.arange(660, 1001)[spectrum.argmax()] == 810


@pytest.mark.parametrize("name", CHROMOPHORES)
def test_no_chromophore_is_extrapolated(name):
    """Every chromophore refuses 5 nm and 5000 nm, and names its source."""
    assert CHROMOPHORES[name].source
    for wavelength in (5.0, 5000.0):
        with pytest.raises(ValidationError, match=f"{wavelength:g} nm"):
            CHROMOPHORES[name].spectrum([wavelength])


def dye_table(path, text="# a dye\nwavelength_nm, dye, other\n700, 2, 1\n650, 1, 1\n800, 4, 1\n"):
    """A user's table of spectra."""
    path.write_text(text)
    return path


def test_a_user_brings_a_spectrum_as_a_column(tmp_path):
    """A column of a CSV file is a chromophore, linear between rows of any order, and unknown outside of them."""
    dye = chromophore("dye", [dye_table(tmp_path / "dye.csv")])
    assert dye.spectrum([650, 675, 750]) == pytest.approx([1, 1.5, 3])
    with pytest.raises(ValidationError, match=r"600 nm is outside the table, which covers 650 \.\. 800 nm"):
        dye.spectrum([600.0])


def test_a_users_column_takes_the_place_of_a_spectrum_that_ships(tmp_path):
    """A column named water is the user's water."""
    table = dye_table(tmp_path / "w.csv", "wavelength_nm,water\n600,7\n900,7\n")
    assert chromophore("water", [table]).spectrum([700]) == pytest.approx([7])
    assert chromophore("water").spectrum([700]) == pytest.approx([0.6])


def test_unclear_names_of_chromophores_are_refused(tmp_path):
    """An unknown name is answered with the nearest one, a name in two tables with both, a bad file with its fault."""
    one, two = dye_table(tmp_path / "one.csv"), dye_table(tmp_path / "two.csv")
    with pytest.raises(ValidationError, match="did you mean 'oxyhaemoglobin'"):
        chromophore("oxyhemoglobin")
    with pytest.raises(ValidationError, match=r"both .*one\.csv and .*two\.csv"):
        chromophore("dye", [one, two])
    with pytest.raises(ReadError, match="number in each"):
        chromophore("dye", [dye_table(tmp_path / "bad.csv", "wavelength_nm,dye\n700,much\n")]).spectrum([700])
