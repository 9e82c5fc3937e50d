"""Rows of the cells of a level, as kernels take them: those of pixels are made from their rates as they are needed."""

from __future__ import annotations

import numba
import numpy as np

_ALL = np.uint64(0x0101010101010101)
_ONE = np.uintp(1)


@numba.njit(nogil=True, cache=True)
def four_rows(width, rate, mass):
    """Room for masses and conductances of four rows, of which row y is in place y % 4.

    Pixels have their mass of 1 already, and cells behind the last column have none.
    """
    masses = np.zeros((4, width), mass.dtype)
    masses[:, : rate.shape[1]] = 1
    return masses, np.zeros_like(masses), np.zeros_like(masses)


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
def load_row(y, rate, mass, east, south, masses, across, down):
    """Masses of a row, and conductances to the east and south, in their places; beyond the last row all are 0."""
    rows = len(rate) if rate.size else len(mass)
    here, across, down = masses[y & 3], across[y & 3], down[y & 3]
    if y >= rows:
        here[:], across[:], down[:] = 0, 0, 0
    elif rate.size:
        _load_pixels(rate[y], rate[min(y + 1, rows - 1)], across, down)
        if y == rows - 1:
            down[:] = 0
    else:
        _load_cells(mass[y], east[y], south[y], here, across, down)


@numba.njit(nogil=True, cache=True)
def _load_pixels(rate, below, across, down):
    half, last = rate.dtype.type(0.5), np.uintp(len(rate) - 1)
    for x in range(last):
        across[x], down[x] = half * (rate[x] + rate[x + _ONE]), half * (rate[x] + below[x])
    down[last] = half * (rate[last] + below[last])


@numba.njit(nogil=True, cache=True)
def _load_cells(mass, east, south, here, across, down):
    for x in range(np.uintp(len(mass))):
        here[x], across[x], down[x] = mass[x], east[x], south[x]


@numba.njit(nogil=True, cache=True)
def count_above(values, limit):
    """How many of a row are larger; NaN is not."""
    count = np.uint32(0)
    for x in range(np.uintp(len(values))):
        count += np.uint32(values[x] > limit)
    return count


def as_integers(numbers: np.ndarray) -> np.ndarray:
    """The bits of floats that are not negative: of integers the largest is found nine times as quickly."""
    return numbers.view(np.dtype(f"i{numbers.itemsize}"))


@numba.njit(nogil=True, cache=True)
def largest_of(bits):
    """Largest of a row of integers, 0 for none. Those of floats that are not negative are in the same order."""
    most = bits.dtype.type(0)
    for i in range(np.uintp(len(bits))):
        most = max(most, bits[i])
    return most
