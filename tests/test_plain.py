"""Provenance survives strict JSON."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oatkit.errors import ResultError
from oatkit.plain import decode, encode


def test_numbers_of_numpy_are_stored_as_numbers() -> None:
    """Numpy scalars and arrays become plain numbers; nan and inf survive strict JSON."""
    value = {"a": np.float32(0.5), "b": np.arange(3), "c": np.array([np.nan, np.inf, -np.inf]), "d": np.bool_(True)}
    text = json.dumps(encode(value), allow_nan=False)
    words = [{"$float": "nan"}, {"$float": "inf"}, {"$float": "-inf"}]
    assert json.loads(text) == {"a": 0.5, "b": [0, 1, 2], "c": words, "d": True}
    assert repr(decode(json.loads(text))["c"]) == "(nan, inf, -inf)"


@pytest.mark.parametrize("value", [object(), {1: 2}, {"a": [{"b": 1j}]}, np.array([1j]), {1, 2}])
def test_what_json_cannot_hold_is_refused(value: Any) -> None:
    """Anything else is refused with the place where it is, not turned into text."""
    with pytest.raises(ResultError, match=r"^diagnostics.*cannot be stored"):
        encode(value, "diagnostics")


def test_a_file_name_that_is_no_text_can_be_stored() -> None:
    """A name with bytes that are no UTF-8, as a scan's source may have, does not stop the result from being written."""
    name = b"scan-\xff.msot".decode(errors="surrogateescape")
    assert json.dumps(encode(name)).encode() == b'"scan-\\\\udcff.msot"'


@pytest.mark.parametrize("value", [{"$float": 1.0}, {"$float": "1"}, {"$float": ["nan"]}, {"a": [{"$float": {}}]}])
def test_a_forged_number_is_refused(value: Any) -> None:
    """What stands in the place of a number that is not finite is nan, inf or -inf, or an error that says so."""
    with pytest.raises(ValueError, match="expected one of nan, inf, -inf, found"):
        decode(value)


_TRAPS = st.sampled_from(["nan", "inf", "-inf", "$float", "$$float", "$"])
_WORDS = st.text(st.characters(exclude_categories=["Cs"])) | _TRAPS
_LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | _WORDS


@settings(deadline=None, max_examples=200)
@given(st.recursive(_LEAVES, lambda part: st.lists(part).map(tuple) | st.dictionaries(_WORDS, part), max_leaves=12))
def test_plain_values_come_back_exactly(value: Any) -> None:
    """Numbers, text (nan too) and any dicts are the same after strict JSON, to the last bit of every float."""
    assert decode(json.loads(json.dumps(encode(value), allow_nan=False))) == value
