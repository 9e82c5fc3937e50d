"""The sRGB curve: exact where it is stored, a bijection where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fogpipe.kernels import bands
from fogpipe.kernels.srgb import linear_from_srgb, srgb_from_linear, srgb_levels_from_linear

INTEGERS = [np.uint8, np.uint16]
FLOATS = [np.float32, np.float64]


def curve(linear):
    """The standard's curve, written a second time and in NumPy."""
    linear = np.asarray(linear, np.float64)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def test_known_values():
    # Half of display white is 21.4 % of its light, and the 18 % grey card is level 118.
    assert linear_from_srgb(np.array([0.5]))[0] == pytest.approx(0.21404, abs=1e-5)
    assert srgb_levels_from_linear(np.array([0.18]))[0] == 118


@pytest.mark.parametrize("dtype", INTEGERS)
def test_every_level_survives_a_round_trip(dtype):
    levels = np.arange(np.iinfo(dtype).max + 1).astype(dtype)
    linear = linear_from_srgb(levels)
    assert linear.dtype == np.float32
    np.testing.assert_array_equal(srgb_levels_from_linear(linear, np.iinfo(dtype).bits), levels)


@pytest.mark.parametrize("dtype", INTEGERS)
def test_levels_decode_to_the_formula(dtype):
    levels = np.arange(np.iinfo(dtype).max + 1).astype(dtype)
    # One rounding to float32 (6e-8), and 2e-8 because the standard rounds the knee to seven digits.
    np.testing.assert_allclose(curve(linear_from_srgb(levels)), levels / np.iinfo(dtype).max, atol=1e-7)


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("bits", [8, 16])
@settings(deadline=None)  # the first example compiles
@given(data=st.data())
def test_encoding_to_levels_is_exact_rounding(bits, dtype, data):
    width = 8 * np.dtype(dtype).itemsize
    linear = data.draw(hnp.arrays(dtype, 64, elements=st.floats(-0.5, 1.5, width=width)))
    exact = (2**bits - 1) * np.clip(curve(linear), 0, 1)
    # Within 1e-6 of a level of a boundary the rounding of the curve itself may decide.
    decided = np.abs(exact - np.floor(exact) - 0.5) > 1e-6
    rounded = np.floor(exact + 0.5)
    np.testing.assert_array_equal(srgb_levels_from_linear(linear, bits)[decided], rounded[decided])


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("bits", [8, 16])
def test_the_level_changes_exactly_at_its_threshold(bits, dtype):
    top = 2**bits - 1
    threshold = linear_from_srgb((np.arange(top) + 0.5) / top)
    # Two steps of the dtype on either side: one for rounding the threshold, one to be past it.
    above, below = threshold.astype(dtype), threshold.astype(dtype)
    for _ in range(2):
        above, below = np.nextafter(above, dtype(2)), np.nextafter(below, dtype(-2))
    np.testing.assert_array_equal(srgb_levels_from_linear(above, bits), np.arange(1, top + 1))
    np.testing.assert_array_equal(srgb_levels_from_linear(below, bits), np.arange(top))


@pytest.mark.parametrize("dtype", FLOATS)
def test_integers_clip_and_have_no_nan(dtype):
    outside = np.array([-np.inf, -1, -0.0, 1, 5, np.inf, np.nan], dtype)
    np.testing.assert_array_equal(srgb_levels_from_linear(outside), [0, 0, 0, 255, 255, 255, 0])
    np.testing.assert_array_equal(srgb_levels_from_linear(outside, 16), [0, 0, 0, 65535, 65535, 65535, 0])


@pytest.mark.parametrize("dtype", FLOATS)
@settings(deadline=None)  # the first example compiles
@given(data=st.data())
def test_floats_round_trip_with_sign_and_highlights(dtype, data):
    values = data.draw(hnp.arrays(dtype, 32, elements=st.floats(-64, 64, width=8 * np.dtype(dtype).itemsize)))
    display = srgb_from_linear(values)
    assert display.dtype == dtype
    np.testing.assert_array_equal(np.signbit(display), np.signbit(values))
    # Two roundings, and at the knee the standard's two branches miss each other by 6e-7.
    back = linear_from_srgb(display)
    np.testing.assert_allclose(back, values, rtol=4 * np.finfo(dtype).eps, atol=1e-7)


@pytest.mark.parametrize("function", [linear_from_srgb, srgb_from_linear])
def test_floats_keep_nan_and_infinity(function):
    values = np.array([np.nan, np.inf, -np.inf])
    np.testing.assert_array_equal(function(values), values)


@pytest.mark.parametrize("shape", [(), (0, 3), (1, 1, 3), (5, 7, 3)])
@pytest.mark.parametrize("dtype", [*INTEGERS, *FLOATS])
def test_any_shape_and_layout(shape, dtype):
    values = (np.arange(np.prod(shape)) % 2).reshape(shape).astype(dtype)
    values.flags.writeable = False
    assert linear_from_srgb(values).shape == shape
    np.testing.assert_array_equal(linear_from_srgb(values.T), linear_from_srgb(values).T)


def test_the_number_of_threads_changes_no_bit():
    linear = np.random.default_rng(5).random((200, 300, 3), np.float32)
    threads = bands.threads()
    results = []
    try:
        for count in (1, 3):
            bands.set_threads(count)
            results.append((srgb_levels_from_linear(linear), srgb_from_linear(linear), linear_from_srgb(linear)))
    finally:
        bands.set_threads(threads)
    for one, three in zip(*results, strict=True):
        np.testing.assert_array_equal(one, three)


@pytest.mark.parametrize("function", [linear_from_srgb, srgb_from_linear, srgb_levels_from_linear])
@pytest.mark.parametrize("dtype", [np.int64, np.float16, bool])
def test_another_dtype_is_refused(function, dtype):
    with pytest.raises(ValueError, match=f"dtype {np.dtype(dtype)}"):
        function(np.zeros(3, dtype))


def test_other_bit_depths_are_refused():
    with pytest.raises(ValueError, match="8 or 16"):
        srgb_levels_from_linear(np.zeros(3), 10)
