"""Diffusion on the pixels, in tiles that stay in the cache.

A tile is computed with a margin of as many pixels as there are steps, in which the values age, so that all steps run in
the cache and no tile depends on another. A polynomial of high degree is the product of several, each of which is one
pass over the tiles. A tile in which no light moves is copied, and one in which little moves takes fewer steps.
"""

from __future__ import annotations

from functools import lru_cache

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.channels import SPLIT, fetch, split
from fogpipe.kernels.diffusion.polynomial import coefficients, degree_for, passes, quantised
from fogpipe.kernels.diffusion.rows import as_integers, largest_of

COLUMNS = 256
"""Of a tile with its margins."""
LEAST_ROWS = 24
"""Of a tile without what its margins add: few enough for what a step touches to stay in the second cache."""
AHEAD = 2
"""Rows of a tile after which one is written that is fetched now: too short for a processor to see what comes next."""
SQUARE = 2
"""Pixels across the squares that are computed or not."""


def on_grid(
    layer: FloatArray,
    rate: FloatArray,
    largest: float,
    share: float,
    wanted: np.ndarray | None = None,
    after: FloatArray | None = None,
) -> FloatArray:
    """Diffuse a layer (H, W, 4) on its pixels for a unit of time.

    Parameters
    ----------
    rate : ϱ (H, W); between two neighbours, the mean of both.
    largest : rates above this, which only tiles that are not wanted may have, are taken to be this.
    share : of any pattern, left out at most.
    wanted : of squares of ``SQUARE`` pixels, those that are computed; the others may hold anything. None for all.
    after : (H, W, 4) C-contiguous, where the result goes; not the layer itself. None for new memory.
    """
    spectrum = quantised(8 * largest)
    factors = passes(spectrum, degree_for(spectrum, share))
    rows, columns, _ = layer.shape
    wanted = np.ones((-(-rows // SQUARE), -(-columns // SQUARE)), np.bool_) if wanted is None else wanted
    result = np.empty_like(layer) if after is None else after
    between = np.empty_like(layer) if len(factors) > 1 else result
    for number, factor in enumerate(factors):
        after = between if (len(factors) - number) % 2 == 0 else result
        # A whole polynomial may be another one in tiles of smaller rates; a factor of one may not.
        if len(factors) == 1:
            spectra, series = _by_rate(spectrum, share, layer.dtype)
        else:
            spectra, series = np.array([spectrum], layer.dtype), _in_precision(factor, layer.dtype)[None]
        # As many rows again as the margins have: a tile of many steps would else be little but margins.
        margin = series.shape[1] - 1
        height, width = LEAST_ROWS + 2 * margin, COLUMNS - 2 * margin
        # Those that follow take what they need from beyond the squares that are wanted.
        where = _around(wanted.view(np.uint8), sum(len(each) - 1 for each in factors[number + 1 :]))
        limits = as_integers(spectra / 8)
        arguments = (height, width, in_rows(layer), rate, as_integers(rate), where, spectra, limits, series)
        in_bands(_tiles, -(-rows // height), height * columns, *arguments, in_rows(after))
        layer = after
    return layer


def _around(wanted: np.ndarray, reach: int) -> np.ndarray:
    """Those squares, and all that are not farther from them than so many pixels."""
    import cv2

    size = 2 * -(-reach // SQUARE) + 1
    return cv2.dilate(wanted, np.ones((size, size), np.uint8))


@lru_cache(64)
def _by_rate(spectrum: float, share: float, dtype: np.dtype) -> tuple[FloatArray, FloatArray]:
    """Spectra of halves, quarters … of the largest rate, and the series for each, padded with zeros to one length."""
    spectra = [spectrum / 2**k for k in range(8) if spectrum / 2**k > 0.01 or k == 0]
    found = [_in_precision(coefficients(each, degree_for(each, share)), dtype) for each in reversed(spectra)]
    series = np.zeros((len(found), len(found[-1])), dtype)
    for row, own in zip(series, found, strict=True):
        row[: len(own)] = own
    return np.array(spectra[::-1], dtype), series


def in_rows(layer: FloatArray) -> FloatArray:
    """A layer (H, W, 4) as rows of four numbers a pixel (H, 4 W), which is the same memory."""
    return layer.reshape(len(layer), -1)


def _in_precision(series: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Rounded so that the sum still is 1."""
    rounded = series.astype(dtype)
    rounded[0] += dtype.type(1 - rounded.sum(dtype=np.float64))
    return rounded


# Tiles have one fixed width of 288 cells, the four channels of a row one after the other, and indices that cannot be
# negative: only then does the compiler see that the arrays of a step are apart, and works on 16 cells at once, whose
# weights it loads once for the four channels. Rows begin 16 cells in, so that vectors lie on their boundaries.
_ONE, _FOUR, _SPLIT = np.uintp(1), np.uintp(4), np.uintp(SPLIT)
_CHANNEL = np.uintp(COLUMNS + 32)
_ROW = np.uintp(4 * _CHANNEL)
_WIDTH = int(_CHANNEL)


@numba.njit(nogil=True, cache=True)
def _tiles(first, last, height, width, layer, rate, bits, wanted, spectra, limits, series, after):
    rows, columns = rate.shape
    margin = series.shape[1] - 1
    zero = layer.dtype.type(0)
    # One row more on each side, of conductance 0, so that every cell of a tile has four neighbours.
    tall = min(height + 2 * margin, rows) + 2
    size = tall * _WIDTH
    now, before, total = _zeros(4 * size, layer), _zeros(4 * size, layer), _zeros(4 * size, layer)
    beside, below = _zeros(size, layer), _zeros(size, layer)
    values, sums = before.reshape(tall, 4, _WIDTH), total.reshape(tall, 4, _WIDTH)
    grid = beside.reshape(tall, _WIDTH), below.reshape(tall, _WIDTH)
    for tile in range(first, last):
        for place in range(0, columns, width):
            whole = tile * height, min(tile * height + height, rows), place, min(place + width, columns)
            top, bottom, left, right = _wanted_part(wanted, *whole)
            if top >= bottom:
                continue
            y0, y1 = max(top - margin, 0), min(bottom + margin, rows)
            x0, x1 = max(left - margin, 0), min(right + margin, columns)
            most = min(_largest(y0, y1, x0, x1, bits), limits[-1])
            if most == 0:
                for y in range(top, bottom):
                    _copy(layer[y, 4 * left : 4 * right], after[y, 4 * left : 4 * right])
                continue
            kind = 0
            while limits[kind] < most:
                kind += 1
            _load_rates(y0, y1, x0, x1, rate, spectra[kind], *grid)
            _load_layer(y0, y1, x0, x1, layer, values)
            own = series[kind]
            last_degree = margin
            while last_degree > 1 and own[last_degree] == zero:
                last_degree -= 1
            loaded = _range(1, y1 - y0 + 1, 0, x1 - x0)
            # Two terms are added to the sum at once, in the last step and every second one before it.
            share = own[1] if last_degree % 2 else zero
            _first_step(*loaded, before, beside, below, own[0], share, now, total)
            older, newer = before, now
            for degree in range(2, last_degree + 1):
                # Values one step from a cut are one step less good: only what the tile still needs is computed.
                needed = last_degree - degree
                part = _range(
                    max(top - needed, y0) - y0 + 1,
                    min(bottom + needed, y1) - y0 + 1,
                    max(left - needed, x0) - x0,
                    min(right + needed, x1) - x0,
                )
                if needed % 2:
                    _step(*part, newer, beside, below, older)
                else:
                    shares = own[degree - 1], own[degree]
                    _step_and_sum(*part, newer, beside, below, *shares, older, total)
                older, newer = newer, older
            _store(top, bottom, left, right, y0, x0, sums, after)


@numba.njit(nogil=True, cache=True)
def _wanted_part(wanted, top, bottom, left, right):
    """The rectangle of a tile that holds all of its squares that are wanted; of no rows if none is."""
    first, last, west, east = bottom, top, right, left
    for j in range(top // SQUARE, -(-bottom // SQUARE)):
        row = wanted[j, left // SQUARE : -(-right // SQUARE)]
        if largest_of(row):
            first, last = min(first, SQUARE * j), SQUARE * j + SQUARE
            begin, end = 0, len(row)
            while not row[begin]:
                begin += 1
            while not row[end - 1]:
                end -= 1
            west, east = min(west, left + SQUARE * begin), max(east, left + SQUARE * end)
    return first, min(last, bottom), west, min(east, right)


@numba.njit(nogil=True, cache=True)
def _zeros(size, layer):
    """On a boundary of the first cache's lines."""
    block = np.zeros(size + 64, layer.dtype)
    start = (-block.ctypes.data % 64) // block.itemsize
    return block[start : start + size]


@numba.njit(nogil=True, cache=True)
def _range(j0, j1, i0, i1):
    """Rows, first column and columns of a part of a tile, whole vectors of it."""
    start = i0 // 16 * 16
    return np.uintp(j0), np.uintp(j1), np.uintp(start + 16), np.uintp((i1 - start + 15) // 16 * 16)


@numba.njit(nogil=True, cache=True)
def _largest(y0, y1, x0, x1, bits):
    most = bits.dtype.type(0)
    for y in range(y0, y1):
        most = max(most, largest_of(bits[y, x0:x1]))
    return most


@numba.njit(nogil=True, cache=True)
def _load_rates(y0, y1, x0, x1, rate, spectrum, beside, below):
    """Conductances in steps, 0 beyond the part."""
    zero, half = rate.dtype.type(0), rate.dtype.type(0.5)
    share = rate.dtype.type(2) / spectrum
    size = x1 - x0
    for y in range(y0, y1):
        j = y - y0 + 1
        here, next_row = rate[y, x0:], rate[min(y + 1, y1 - 1), x0:]
        across, down = beside[j, 16:], below[j, 16:]
        for i in range(size):
            down[i] = min(share * (here[i] + next_row[i]), half)
        for i in range(size - 1):
            across[i] = min(share * (here[i] + here[i + 1]), half)
        across[size - 1 :] = zero
        down[size:] = zero
    below[y1 - y0, :] = zero


@numba.njit(nogil=True, cache=True)
def _load_layer(y0, y1, x0, x1, layer, values):
    zero = layer.dtype.type(0)
    whole = np.uintp(x1 - x0) // _SPLIT * _SPLIT
    for y in range(y0, y1):
        pixels, row = layer[y, 4 * x0 : 4 * x1], values[y - y0 + 1]
        planes = row.reshape(4 * row.shape[1])
        for i in range(np.uintp(0), whole, _SPLIT):
            split(pixels, _FOUR * i, planes, np.uintp(16) + i, _CHANNEL)
        a, b, c, d = row[0, 16:], row[1, 16:], row[2, 16:], row[3, 16:]
        for i in range(whole, np.uintp(x1 - x0)):
            a[i], b[i], c[i], d[i] = pixels[4 * i], pixels[4 * i + 1], pixels[4 * i + 2], pixels[4 * i + 3]
        row[:, 16 + x1 - x0 :] = zero


@numba.njit(nogil=True, cache=True)
def _store(top, bottom, left, right, y0, x0, sums, after):
    for y in range(top, bottom):
        soon = after[min(y + AHEAD, bottom - 1), 4 * left : 4 * right]
        for i in range(np.uintp(0), np.uintp(len(soon)), _SPLIT):
            fetch(soon, i)
        row, start = sums[y - y0 + 1], 16 + left - x0
        a, b, c, d = row[0, start:], row[1, start:], row[2, start:], row[3, start:]
        pixels = after[y, 4 * left : 4 * right]
        for i in range(right - left):
            pixels[4 * i], pixels[4 * i + 1], pixels[4 * i + 2], pixels[4 * i + 3] = a[i], b[i], c[i], d[i]


@numba.njit(nogil=True, cache=True)
def _copy(source, target):
    for i in range(len(source)):
        target[i] = source[i]


@numba.njit(nogil=True, inline="always")
def _flow(now, a, to_west, to_east, to_north, to_south):
    """What flows into a cell."""
    here = now[a]
    return (
        to_west * (now[a - _ONE] - here)
        + to_east * (now[a + _ONE] - here)
        + to_north * (now[a - _ROW] - here)
        + to_south * (now[a + _ROW] - here)
    )


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _first_step(j0, j1, start, size, now, beside, below, constant, share, after, total):
    """T(1) = X T(0)."""
    half = now.dtype.type(0.5)
    for j in range(j0, j1):
        for i in range(size):
            b = j * _CHANNEL + start + i
            west, east, north, south = beside[b - _ONE], beside[b], below[b - _CHANNEL], below[b]
            for k in range(_FOUR):
                a = j * _ROW + k * _CHANNEL + start + i
                after[a] = now[a] + half * _flow(now, a, west, east, north, south)
                total[a] = constant * now[a] + share * after[a]


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step(j0, j1, start, size, now, beside, below, older):
    """The recurrence T(k+1) = 2 X T(k) − T(k−1) with X = 1 − 2A/λ; ``older`` holds T(k−1), then T(k+1)."""
    for j in range(j0, j1):
        for i in range(size):
            b = j * _CHANNEL + start + i
            west, east, north, south = beside[b - _ONE], beside[b], below[b - _CHANNEL], below[b]
            for k in range(_FOUR):
                a = j * _ROW + k * _CHANNEL + start + i
                older[a] = (now[a] - older[a]) + now[a] + _flow(now, a, west, east, north, south)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step_and_sum(j0, j1, start, size, now, beside, below, share, next_share, older, total):
    """A step, and what T(k) and T(k+1) add to the polynomial."""
    for j in range(j0, j1):
        for i in range(size):
            b = j * _CHANNEL + start + i
            west, east, north, south = beside[b - _ONE], beside[b], below[b - _CHANNEL], below[b]
            for k in range(_FOUR):
                a = j * _ROW + k * _CHANNEL + start + i
                after = (now[a] - older[a]) + now[a] + _flow(now, a, west, east, north, south)
                older[a] = after
                total[a] += share * now[a] + next_share * after
