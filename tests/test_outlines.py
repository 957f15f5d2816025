"""How near two outlines are: known for discs."""

import numpy as np
import pytest

from oatkit import Grid, Image, ValidationError
from oatkit.outlines import SPACING_M, dice, hausdorff_m
from oatkit.simulate import disc_body

GRID = Grid((120, 120), 0.1e-3)


def test_an_outline_is_near_itself():
    """A disc against itself: Dice is 1, and the distance is at most half the spacing of the points compared."""
    disc = disc_body(4e-3)
    assert dice(disc.boundary(GRID), disc.boundary(GRID)) == 1
    assert hausdorff_m(disc.boundary(GRID), disc.outline_m) < SPACING_M / 2


@pytest.mark.parametrize("shift_m", [0.2e-3, 1e-3])
def test_a_shifted_disc_is_off_by_the_shift(shift_m):
    """The largest distance between two discs of one radius is that of their centres."""
    found = disc_body(4e-3, (shift_m, 0.0)).boundary(GRID)
    assert hausdorff_m(found, disc_body(4e-3).outline_m) == pytest.approx(shift_m, abs=SPACING_M / 2)


def test_dice_of_concentric_discs_is_that_of_their_areas():
    """A disc within another one: twice the smaller area over the sum, to the pixels on the walls."""
    small, large = (disc_body(radius).boundary(GRID) for radius in (3e-3, 5e-3))
    assert dice(small, large) == pytest.approx(2 * 9 / (9 + 25), rel=0.01)


def test_what_cannot_be_compared_is_refused():
    """Other grids, two empty bodies and a boundary without a contour are errors."""
    disc, empty = disc_body(4e-3).boundary(GRID), Image(np.ones(GRID.shape), "boundary", "m", GRID)
    with pytest.raises(ValidationError, match="one grid"):
        dice(disc, disc_body(4e-3).boundary(Grid((60, 60), 0.2e-3)))
    with pytest.raises(ValidationError, match="empty"):
        dice(empty, empty)
    with pytest.raises(ValidationError, match="no contour"):
        hausdorff_m(empty, disc_body(4e-3).outline_m)
