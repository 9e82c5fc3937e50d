r"""The sRGB transfer curve (IEC 61966-2-1), compiled, without a power in the loops over integers.

With display value :math:`v` and linear light :math:`l`, both 1 at display white,

.. math:: l = v / 12.92 \quad (v \le 0.04045), \qquad l = ((v + 0.055) / 1.055)^{2.4} \quad\text{above}.

Integers to linear light is a table. Linear light to integers is exact, too: a uniform table over [0, 1]
whose cells are narrower than the narrowest level gives the level or the one below, and one comparison
with the threshold between the two decides.

Floats are extended as an odd function, so that the small negative values which filters leave behind
survive a round trip. Values above 1 follow the same formula.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

_KNEE_DISPLAY = 0.04045
_KNEE_LINEAR = _KNEE_DISPLAY / 12.92  # the standard rounds it to 0.0031308, which would not invert the other knee
_CELLS = {8: 2**12, 16: 2**20}
"""Powers of two above 12.92·(2^bits − 1), so that no cell holds two thresholds and no product rounds."""


def linear_from_srgb(display: np.ndarray) -> FloatArray:
    """Linear light from display values.

    Parameters
    ----------
    display : array of any shape, uint8 or uint16 (the largest integer is display white) or float32 or
        float64 (1 is display white). Floats: negative values by odd extension, NaN and infinity stay.

    Returns
    -------
    Array of the same shape; float32 for integers and float32, float64 for float64. Each value is the formula
    in double precision, rounded once.

    Raises
    ------
    ValueError
        For another dtype.
    """
    if display.dtype in (np.uint8, np.uint16):
        return _elementwise(_look_up, display, np.dtype(np.float32), _linear_of_level(display.dtype.itemsize * 8))
    return _elementwise(_linear_from_srgb, display, _float_dtype(display))


def srgb_from_linear(linear: np.ndarray) -> FloatArray:
    """Display values from linear light, unclipped: the inverse of :func:`linear_from_srgb` for floats.

    Parameters
    ----------
    linear : float32 or float64 array of any shape. Negative values by odd extension, NaN and infinity stay.

    Returns
    -------
    Array of the same shape and dtype, each value the formula in double precision, rounded once.

    Raises
    ------
    ValueError
        For another dtype.
    """
    return _elementwise(_srgb_from_linear, linear, _float_dtype(linear))


def srgb_levels_from_linear(linear: np.ndarray, bits: int = 8) -> np.ndarray:
    """Display values from linear light as integers, the largest of which is display white.

    The result is ``round((2**bits - 1) * srgb)`` of the clipped value. It can differ from that only where the exact
    value lies within 1e-6 of a level from a rounding boundary, the rounding error of the curve in double precision.

    Parameters
    ----------
    linear : float32 or float64 array of any shape. Below 0 and NaN give 0, above 1 and +inf the largest integer.
    bits : 8 or 16.

    Returns
    -------
    uint8 or uint16 array of the same shape. The first use of 16 bits builds a table of 2 MB (some 20 ms).

    Raises
    ------
    ValueError
        For another dtype or number of bits.
    """
    if bits not in _CELLS:
        raise ValueError(f"bits must be 8 or 16, not {bits}")
    level = np.dtype(np.uint8 if bits == 8 else np.uint16)
    return _elementwise(_level_from_linear, linear, level, *_levels_of_cells(bits, _float_dtype(linear)))


def _float_dtype(array: np.ndarray) -> np.dtype[Any]:
    if array.dtype not in (np.float32, np.float64):
        raise ValueError(f"dtype {array.dtype} where float32 or float64 is needed")
    return array.dtype


def _elementwise(kernel: Any, array: np.ndarray, dtype: np.dtype[Any], *tables: np.ndarray) -> np.ndarray:
    source = np.ascontiguousarray(array).reshape(-1).view()
    source.flags.writeable = False  # whatever the caller's is: one access mode, so one compilation
    result = np.empty(array.shape, dtype)
    in_bands(kernel, array.size, 1, source, result.reshape(-1), *tables)
    return result


@cache
def _linear_of_level(bits: int) -> FloatArray:
    top = 2**bits - 1
    return linear_from_srgb(np.arange(top + 1) / top).astype(np.float32)


@cache
def _levels_of_cells(bits: int, dtype: np.dtype[Any]) -> tuple[np.ndarray, FloatArray]:
    """The level at the lower end of each cell, and for each level the least ``dtype`` that belongs to the next."""
    top = 2**bits - 1
    exact = linear_from_srgb((np.arange(top) + 0.5) / top)
    threshold = exact.astype(dtype)
    threshold = np.where(threshold < exact, np.nextafter(threshold, dtype.type(1)), threshold)
    lowest = np.searchsorted(threshold, np.linspace(0, 1, _CELLS[bits] + 1), side="right")
    return lowest.astype(np.uint8 if bits == 8 else np.uint16), np.append(threshold, dtype.type(np.inf))


@njit(nogil=True, cache=True)
def _look_up(first, last, level, value, table):
    for i in range(first, last):
        value[i] = table[level[i]]


@njit(nogil=True, cache=True)
def _level_from_linear(first, last, linear, level, lowest, threshold):
    cells = linear.dtype.type(lowest.size - 1)
    for i in range(first, last):
        light = linear[i]
        light = light if light > 0 else linear.dtype.type(0)  # NaN, too
        light = light if light < 1 else linear.dtype.type(1)
        candidate = lowest[np.uint64(light * cells)]  # a signed index would be tested for counting from the end
        level[i] = candidate + (light >= threshold[candidate])


@njit(nogil=True, cache=True)
def _linear_from_srgb(first, last, display, linear):
    for i in range(first, last):
        value = np.float64(display[i])
        if abs(value) <= _KNEE_DISPLAY:
            linear[i] = value / 12.92
        else:
            linear[i] = np.copysign(((abs(value) + 0.055) / 1.055) ** 2.4, value)


@njit(nogil=True, cache=True)
def _srgb_from_linear(first, last, linear, display):
    for i in range(first, last):
        light = np.float64(linear[i])
        if abs(light) <= _KNEE_LINEAR:
            display[i] = 12.92 * light
        else:
            display[i] = np.copysign(1.055 * abs(light) ** (1 / 2.4) - 0.055, light)
