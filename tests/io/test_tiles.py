"""A tile says in words what its picture shows, and holds nothing of the value itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fogpipe.io.painting import SKY_COLOUR, UNKNOWN_COLOUR
from fogpipe.io.tiles import number, tile
from fogpipe.ports import Kind, known_kinds

KINDS = known_kinds()


def tile_of(kind: str, array: Any, color: str = "linear"):
    return tile("name", KINDS[kind], np.asarray(array), color)  # type: ignore[arg-type]


def test_a_range_is_captioned_with_unit_range_and_what_is_missing():
    values = np.full((10, 10), 2.114, np.float32)
    values[0] = 5.018
    values[1, :7] = np.nan
    values[2, :3] = np.inf
    shown = tile_of("Range", values)
    assert shown.caption == "Range [m] · 2.11 … 5.02"
    assert shown.marks == ((UNKNOWN_COLOUR, "7 % unknown"), (SKY_COLOUR, "3 % sky"))
    assert shown.scale is not None
    assert (shown.scale.low, shown.scale.high) == (pytest.approx(2.114), pytest.approx(5.018))


@pytest.mark.parametrize(
    ("kind", "array", "caption"),
    [
        ("Image", np.linspace(0, 1, 75).reshape(5, 5, 3), "Image · 0 … 1"),
        ("Layer", np.full((5, 5, 4), 0.25), "Layer · 0.25 everywhere"),
        ("Transmission", np.array([[0.368, 0.657]]), "Transmission · 0.368 … 0.657"),
        ("Mask", np.array([[True, False, False, False]]), "Mask · 25 % true"),
        ("Mask", np.zeros((2, 2), bool), "Mask · 0 % true"),
        ("Mask", np.arange(200).reshape(10, 20) == 7, "Mask · 0.5 % true"),
        ("Range", np.full((2, 2), np.nan), "Range [m] · no finite value"),
        ("BlurScale", np.array([[0.0, 12345.6]]), "BlurScale [px] · 0 … 12346"),
    ],
)
def test_captions(kind, array, caption):
    shown = tile_of(kind, array)
    assert shown.caption == caption
    assert shown.picture is not None
    assert shown.picture.dtype == np.uint8


def test_nothing_known_has_no_colour_bar():
    assert tile_of("Range", np.full((2, 2), np.nan)).scale is None


def test_a_rare_unknown_is_not_rounded_away():
    values = np.ones((200, 200), np.float32)
    values[0, 0] = np.nan
    assert tile_of("Range", values).marks == ((UNKNOWN_COLOUR, "< 0.1 % unknown"),)
    values[:] = np.nan
    values[0, 0] = 1
    assert tile_of("Range", values).marks == ((UNKNOWN_COLOUR, "> 99.9 % unknown"),)


@pytest.mark.parametrize(
    ("kind", "value", "caption", "numbers"),
    [
        ("Length", 5.0234, "Length [m]", (("5.02",),)),
        ("Number", np.inf, "Number", (("inf",),)),
        ("Length", np.nan, "Length [m]", (("nan",),)),
        ("Camera", [[995, 0, 311], [0, 995, 255], [0, 0, 1]], "Camera [px]", None),
    ],
)
def test_a_few_numbers_are_text(kind, value, caption, numbers):
    shown = tile_of(kind, value)
    assert shown.picture is None
    assert shown.caption == caption
    assert shown.numbers == (numbers or (("995", "0", "311"), ("0", "995", "255"), ("0", "0", "1")))


@pytest.mark.parametrize(("color", "level"), [("linear", 188), ("srgb", 128)])
def test_an_airlight_is_a_swatch_with_its_numbers(color, level):
    shown = tile_of("Airlight", [0.5, 0.0, 2.0], color)
    assert shown.swatch == (level, 0, 255)
    assert shown.numbers == (("0.5", "0", "2"),)
    assert tile_of("Airlight", np.ones((4, 5, 3))).picture is not None


def test_a_kind_of_a_plugin_with_an_unknown_display_is_grey():
    kind = Kind("Phase", "a phase", (("H", "W"),), unit="rad", display="hologram")
    shown = tile("name", kind, np.linspace(-3, 3, 35).reshape(5, 7), "linear")
    assert shown.caption == "Phase [rad] · -3 … 3"
    assert shown.picture is not None
    assert np.ptp(shown.picture, axis=2).max() == 0


@pytest.mark.parametrize("shape", [(4, 5, 2), (4, 5, 7)])
def test_other_numbers_of_channels_are_shown_by_their_mean(shape):
    kind = Kind("Flow", "movement", (("H", "W", 2),), unit="px")
    assert tile("name", kind, np.ones(shape), "linear").picture is not None


@pytest.mark.parametrize("shape", [(2, 3, 4, 5), (40,), (0, 5)])
def test_what_cannot_be_shown_gives_its_shape(shape):
    shown = tile("name", Kind("Odd", "odd", ()), np.zeros(shape), "linear")
    assert shown.numbers == ((f"shape {shape}",),)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_any_precision_and_layout(dtype):
    values = np.asfortranarray(np.linspace(1, 2, 30).reshape(5, 6).astype(dtype))
    values.flags.writeable = False
    assert tile_of("Range", values).caption == "Range [m] · 1 … 2"


NUMBERS = [(0, "0"), (0.12345, "0.123"), (994.978, "995"), (12345.6, "12346"), (1e-5, "1.00e-05"), (3e8, "3.00e+08")]


@pytest.mark.parametrize(("value", "text"), NUMBERS)
def test_numbers_have_three_digits(value, text):
    assert number(value) == text
