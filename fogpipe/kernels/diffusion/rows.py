"""Cells of a level one by one and row by row. What pixels have is made from their scales as it is needed."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

_ALL = np.uint64(0x0101010101010101)


@numba.njit(nogil=True, cache=True)
def flags(count):
    """So many flags and one that stays off, and the same memory as eight of them in one number."""
    eights = np.zeros(count // 8 + 1, np.uint64)
    return eights.view(np.uint8), eights


@numba.njit(nogil=True, cache=True)
def end_of_run(x, flags, eights):
    """The next place from x on whose flag is off."""
    while flags[x]:
        x += 8 if x % 8 == 0 and eights[x // 8] == _ALL else 1
    return x


@numba.njit(nogil=True, cache=True)
def next_flag(x, flags, eights):
    """The next place from x on whose flag is on, or one behind the last."""
    while x < len(flags) and not flags[x]:
        x += 8 if x % 8 == 0 and eights[x // 8] == 0 else 1
    return x


@numba.njit(nogil=True, cache=True)
def mass_of(y, x, mass):
    """A pixel has a mass of 1."""
    return mass[y, x] if mass.size else mass.dtype.type(1)


@numba.njit(nogil=True, cache=True)
def rate_of(scale, finest):
    """ϱ = (σ² − σ0²)/2 of a pixel, in px² per unit of time; 0 where σ is unknown or below σ0."""
    half, zero = type(finest)(0.5), type(finest)(0)
    return half * (scale * scale - finest * finest) if scale > finest else zero


@numba.njit(nogil=True, cache=True)
def mean_rate(scale, beside, finest):
    """Conductance between two pixels."""
    return type(finest)(0.5) * (rate_of(scale, finest) + rate_of(beside, finest))


@numba.njit(nogil=True, cache=True)
def face(y, x, j, i, scale, finest, conductance):
    """Conductance between a cell and the next one, (j, i), to the east or south."""
    return mean_rate(scale[y, x], scale[j, i], finest) if scale.size else conductance[y, x]


@numba.njit(nogil=True, cache=True)
def count_above(values, limit):
    """How many of a row are larger; NaN is not."""
    count = np.uint32(0)
    for x in range(np.uintp(len(values))):
        count += np.uint32(values[x] > limit)
    return count


def as_integers(numbers: Any) -> Any:
    """The bits of floats that are not negative: of integers the largest is found nine times as quickly."""
    return numbers.view(np.int32 if numbers.itemsize == 4 else np.int64)


@numba.njit(nogil=True, cache=True)
def largest_of(bits):
    """Largest of a row of integers, 0 for none. Those of floats that are not negative are in the same order."""
    most = bits.dtype.type(0)
    for i in range(np.uintp(len(bits))):
        most = max(most, bits[i])
    return most


@numba.njit(nogil=True, cache=True)
def largest_known(bits):
    """The same of floats and their signs, where what is negative or NaN is passed over."""
    most, infinite = bits.dtype.type(0), bits.dtype.type(0x7F800000 if bits.itemsize == 4 else 0x7FF0000000000000)
    for i in range(np.uintp(len(bits))):
        most = max(most, bits[i] if bits[i] <= infinite else bits.dtype.type(0))
    return most
