"""Thumbnails: averages in light, scales that say what they span, and no confusion of unknown, sky and small."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.io.painting import (
    LARGEST_SIDE,
    SKY_COLOUR,
    SMALLEST_SIDE,
    STYLES,
    UNKNOWN_COLOUR,
    Scale,
    Style,
    paint_image,
    paint_map,
    scale_for,
)
from fogpipe.ports import known_kinds

GREY = scale_for(Style(), 0, 1)


def test_every_kind_of_fogpipe_has_a_style():
    # Kinds that are always a few numbers are never painted; they keep the default display.
    assert {kind.display for kind in known_kinds().values()} <= STYLES.keys()


@pytest.mark.parametrize("name", sorted({style.colormap for style in STYLES.values()}))
def test_colour_maps_grow_lighter_all_the_way(name):
    colors = scale_for(Style(name), 0, 1).colors
    assert colors.shape == (256, 3)
    linear = (colors / 255.0) ** 2.2
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    # A level of blue or red is rounded at most by half, which the weighted sum can show as a step back this small.
    assert np.diff(luminance).min() > -0.004
    assert luminance[-1] > luminance[0] + 0.4


@pytest.mark.parametrize("style", STYLES.values())
def test_unknown_and_sky_look_like_no_value(style):
    colors = scale_for(style, 0, 1).colors.astype(int)
    for special in (UNKNOWN_COLOUR, SKY_COLOUR):
        # 50 levels of difference in some channel are plain to see side by side.
        assert np.abs(colors - special).max(axis=1).min() > 50
    assert np.abs(np.subtract(UNKNOWN_COLOUR, SKY_COLOUR)).max() > 50


@pytest.mark.parametrize(("shape", "expected"), [((1000, 500), (480, 240)), ((500, 1000), (240, 480))])
def test_large_maps_are_averaged_down(shape, expected):
    checks = (np.indices(shape).sum(axis=0) % 2).astype(np.float32)
    picture = paint_map(checks, GREY)
    assert picture.shape == (*expected, 3)
    # An area of 2.08 × 2.08 checks has up to 0.08 × 0.08 more of one colour than of the other, and so does its edge.
    assert np.abs(picture.astype(int) - 128).max() <= 0.08 * 128


@pytest.mark.parametrize("shape", [(1, 1), (1, 5000), (5000, 1), (3, 7), (240, 100)])
def test_small_and_thin_maps_can_be_seen(shape):
    height, width, _ = paint_map(np.ones(shape, np.float32), GREY).shape
    assert SMALLEST_SIDE <= height <= LARGEST_SIDE
    assert SMALLEST_SIDE <= width <= LARGEST_SIDE


def test_unknown_and_sky_have_their_own_colours():
    values = np.array([[0, 1], [np.nan, np.inf]], np.float32)
    picture = paint_map(values, GREY)
    assert tuple(picture[0, 0]) == (0, 0, 0)
    assert tuple(picture[0, -1]) == (255, 255, 255)
    assert tuple(picture[-1, 0]) == UNKNOWN_COLOUR
    assert tuple(picture[-1, -1]) == SKY_COLOUR


def test_an_average_takes_known_values_only():
    values = np.full((960, 960), 0.5, np.float32)
    values[::2, ::2] = np.nan  # a quarter of every 2 × 2 block
    np.testing.assert_array_equal(paint_map(values, GREY), 128)
    values[1::2] = np.nan  # now three quarters
    np.testing.assert_array_equal(paint_map(values, GREY), np.broadcast_to(UNKNOWN_COLOUR, (480, 480, 3)))


@settings(deadline=None, max_examples=50)
@given(
    values=hnp.arrays(np.float32, hnp.array_shapes(min_dims=2, max_dims=2, max_side=6), elements=st.floats(width=32)),
    style=st.sampled_from(sorted(STYLES)),
)
def test_any_map_can_be_painted(values, style):
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    assert paint_map(values, scale_for(STYLES[style], low, high)).dtype == np.uint8


def test_wide_distances_are_drawn_on_a_logarithmic_scale():
    scale = scale_for(STYLES["distance"], 1, 10_000)
    assert scale.logarithmic
    assert scale.middle == pytest.approx(100)
    np.testing.assert_array_equal(scale.positions(np.array([1.0, 100, 10_000])), [0, 128, 255])
    assert not scale_for(STYLES["distance"], 2, 5).logarithmic
    assert not scale_for(STYLES["distance"], 0, 5).logarithmic


def test_shares_keep_their_scale_whatever_the_values():
    scale = scale_for(STYLES["share"], 0.4, 0.6)
    assert (scale.low, scale.high) == (0, 1)


def test_a_constant_map_has_one_colour():
    scale = Scale(GREY.colors, 3, 3, logarithmic=False)
    np.testing.assert_array_equal(scale.positions(np.full(4, 3.0)), 0)


def test_pictures_are_averaged_in_light():
    stripes = np.zeros((960, 960, 3), np.float32)
    stripes[:, ::2] = 1
    # Half of the light is level 188 on a display, not 128.
    np.testing.assert_array_equal(paint_image(stripes, "linear"), 188)
    np.testing.assert_array_equal(paint_image(stripes, "srgb"), 128)


def test_a_layer_lies_over_a_checkerboard():
    layer = np.zeros((240, 240, 4), np.float32)
    layer[:120] = [0.5, 0, 0, 1]
    picture = paint_image(layer, "linear")
    assert len(np.unique(picture[:120].reshape(-1, 3), axis=0)) == 1
    assert len(np.unique(picture[120:].reshape(-1, 3), axis=0)) == 2


def test_a_picture_shows_where_it_is_not_a_number():
    pixels = np.full((240, 240, 3), 0.5, np.float32)
    pixels[7, 9, 1] = np.nan
    picture = paint_image(pixels, "linear")
    assert tuple(picture[7, 9]) == UNKNOWN_COLOUR
    assert tuple(picture[7, 10]) == (188, 188, 188)
