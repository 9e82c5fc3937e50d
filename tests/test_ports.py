"""Kinds: what a port admits, and how it says no."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.ports import known_kinds

KINDS = known_kinds()


def test_a_range_may_be_unknown_or_infinite_but_never_negative():
    kind = KINDS["Range"]
    assert kind.bad_values(np.array([[1.0, np.nan, np.inf]])) is None
    assert "below 0" in (kind.bad_values(np.array([[-1.0]])) or "")
    assert "-inf" in (kind.bad_values(np.array([[-np.inf]])) or "")


def test_an_image_has_neither_nan_nor_infinity_and_the_message_counts_them():
    image = np.zeros((2, 2, 3))
    image[0, 0] = np.nan
    assert KINDS["Image"].bad_values(image) == "3 of 12 values are NaN, which Image does not admit"
    image[0, 0] = np.inf
    assert "inf" in (KINDS["Image"].bad_values(image) or "")


def test_a_transmission_above_one_is_refused():
    assert "above 1" in (KINDS["Transmission"].bad_values(np.array([[1.5]])) or "")


@pytest.mark.parametrize(
    ("name", "shape", "fits"),
    [
        ("Image", (4, 5, 3), True),
        ("Image", (4, 5), False),
        ("Image", (0, 5, 3), False),
        ("Airlight", (3,), True),
        ("Airlight", (4, 5, 3), True),
        ("Airlight", (4, 5), False),
        ("Length", (), True),
        ("Length", (1,), False),
    ],
)
def test_shapes(name: str, shape: tuple[int, ...], fits: bool):
    assert (KINDS[name].misfit(np.zeros(shape)) is None) == fits


def test_integers_are_no_floats_and_floats_no_mask():
    assert "int64" in (KINDS["Range"].misfit(np.zeros((2, 2), dtype=np.int64)) or "")
    assert "float64" in (KINDS["Mask"].misfit(np.zeros((2, 2))) or "")


def test_a_kind_says_its_unit():
    assert str(KINDS["Range"]) == "Range [m]"
    assert str(KINDS["Mask"]) == "Mask"


def test_depth_and_range_are_different_kinds():
    assert KINDS["Depth"] != KINDS["Range"]
