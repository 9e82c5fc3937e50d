"""What compiled loops are given, and what is kept from them."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels.arrays import floats, require_maps, require_nonnegative


@pytest.mark.parametrize(
    ("given", "computed"),
    [
        (np.float16, np.float32),
        (np.float32, np.float32),
        (np.float64, np.float64),
        (">f4", np.float32),
        (np.uint8, np.float32),
    ],
)
def test_the_first_array_decides_the_precision(given, computed):
    first, second = floats(np.ones((2, 3), given), np.ones((2, 3), np.float64))
    assert first.dtype == second.dtype == computed


def test_no_copy_where_none_is_needed_and_no_writing_ever():
    array = np.ones((4, 6), np.float32)
    (same,), (turned,) = floats(array), floats(array.T)
    assert np.shares_memory(same, array)
    assert turned.flags.c_contiguous
    assert not same.flags.writeable
    assert array.flags.writeable


def test_maps_of_one_size():
    require_maps(a=(np.ones((2, 3)), 1), b=(np.ones((2, 3, 4)), 4))
    with pytest.raises(ValueError, match=r"b has 3 × 3 pixels but a has 3 × 2"):
        require_maps(a=(np.ones((2, 3)), 1), b=(np.ones((3, 3)), 1))
    with pytest.raises(ValueError, match=r"b has shape \(2, 3\), not \(height, width, 4\)"):
        require_maps(a=(np.ones((2, 3)), 1), b=(np.ones((2, 3)), 4))
    with pytest.raises(ValueError, match="at least one pixel"):
        require_maps(a=(np.ones((0, 3)), 1))


def test_negative_values_are_named():
    require_nonnegative(depth=np.array([[0.0, np.nan, np.inf]]))
    require_nonnegative(depth=np.array([[np.nan]]))
    with pytest.raises(ValueError, match=r"depth is negative at 2 pixels \(smallest -3\)"):
        require_nonnegative(depth=np.array([[-1.0, -3.0, np.nan]]))
