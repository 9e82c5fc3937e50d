"""Four channels as one number of compiled code."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from fogpipe.kernels.channels import SPLIT, load, split, store


@numba.njit
def blended(values, first, second, share, result):
    one, other = load(values, first), load(values, second)
    store(result, np.uintp(4), one + share * (other - one))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_arithmetic_is_that_of_each_channel(dtype):
    values = np.random.default_rng(0).random(12).astype(dtype)
    result = np.full(12, -1, dtype)
    share = dtype(0.3)
    # Not on a boundary of four numbers, since a pixel need not be.
    blended(values, np.uintp(1), np.uintp(7), share, result)
    one, other = values[1:5], values[7:11]
    np.testing.assert_array_equal(result[4:8], one + share * (other - one))
    np.testing.assert_array_equal(result[[0, 1, 2, 3, 8, 9, 10, 11]], -1)


def test_an_unknown_channel_leaves_the_others_known():
    values = np.array([np.nan, 1, np.inf, 2, 0, 1, 1, 1], np.float32)
    result = np.zeros(8, np.float32)
    blended(values, np.uintp(0), np.uintp(4), np.float32(0.5), result)
    assert np.isnan(result[4:7:2]).all()
    np.testing.assert_array_equal(result[5:8:2], [1, 1.5])


def test_four_channels_are_one_instruction():
    blended(np.zeros(12, np.float32), np.uintp(0), np.uintp(4), np.float32(0), np.zeros(12, np.float32))
    (code,) = (blended.inspect_llvm(signature) for signature in blended.signatures if "float32" in str(signature[0]))
    assert "fmul <4 x float>" in code


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_pixels_are_split_into_planes(dtype):
    pixels, planes = np.arange(4 * SPLIT + 3).astype(dtype), np.full(90, -1, dtype)
    numba.njit(lambda a, b: split(a, np.uintp(3), b, np.uintp(5), np.uintp(20)))(pixels, planes)
    wanted = np.full(90, -1, dtype)
    for k in range(4):
        wanted[5 + 20 * k :][:SPLIT] = pixels[3 + k :: 4]
    np.testing.assert_array_equal(planes, wanted)


def test_channels_of_two_precisions_do_not_mix():
    with pytest.raises(numba.TypingError):
        numba.njit(lambda a, b: store(a, np.uintp(0), load(a, np.uintp(0)) + load(b, np.uintp(0))))(
            np.zeros(4, np.float32), np.zeros(4)
        )
