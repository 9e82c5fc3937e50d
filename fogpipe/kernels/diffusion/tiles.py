"""Diffusion on the pixels, in tiles that stay in the cache.

A tile is computed with a margin of as many pixels as there are steps, in which the values age, so that no tile depends
on another, and its rows roll through the steps (see :mod:`~fogpipe.kernels.diffusion.rolling`). A polynomial of high
degree is the product of several, each of which is one pass over the tiles. A tile in which no light moves is copied,
and one in which little moves takes fewer steps.
"""

from __future__ import annotations

from functools import lru_cache

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.polynomial import coefficients, degree_for, passes, quantised
from fogpipe.kernels.diffusion.rolling import (
    COLUMNS,
    load_nothing,
    load_row,
    place_above,
    place_of,
    records,
    step_row,
    store_row,
)
from fogpipe.kernels.diffusion.rows import as_integers, largest_known, largest_of

LEAST_ROWS, ROWS = 64, 16
"""Of a tile: at least so many, and so many for each step, since in all each step computes one more above and below."""
SQUARE = 2
"""Pixels across the squares that are computed or not."""


def on_grid(
    layer: FloatArray,
    scale: FloatArray,
    finest: float,
    largest: float,
    share: float,
    wanted: np.ndarray | None = None,
    after: FloatArray | None = None,
) -> FloatArray:
    """Diffuse a layer (H, W, 4) on its pixels for a unit of time.

    Parameters
    ----------
    scale, finest : σ (H, W) and σ0. The rate between two neighbours is the mean of both ϱ = (σ² − σ0²)/2.
    largest : rates above this, which only squares that are not wanted may have, are taken to be this.
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
        margin = series.shape[1] - 1
        height, width = max(LEAST_ROWS, ROWS * margin), COLUMNS - 2 * margin
        # Those that follow take what they need from beyond the squares that are wanted.
        where = _around(wanted.view(np.uint8), sum(len(each) - 1 for each in factors[number + 1 :]))
        limits = as_integers(np.sqrt(spectra / 4 + finest * finest, dtype=layer.dtype))  # the scales of these rates
        scales = scale, as_integers(scale), scale.dtype.type(finest), as_integers(scale.dtype.type(finest))
        arguments = (height, width, in_rows(layer), *scales, where, spectra, limits, series)
        in_bands(_tiles, -(-rows // height) * -(-columns // width), height * width, *arguments, in_rows(after))
        layer = after
    return layer


def _around(wanted: np.ndarray, reach: int) -> np.ndarray:
    """Those squares, and all that are not farther from them than so many pixels."""
    import cv2

    if reach == 0:
        return wanted
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


@numba.njit(nogil=True, cache=True)
def _tiles(
    first, last, height, width, layer, scale, bits, finest, bits_of_finest, wanted, spectra, limits, series, after
):
    rows, columns = scale.shape
    margin, strips = series.shape[1] - 1, (columns + width - 1) // width
    held = records(margin, layer)
    begins = np.empty((margin + 1, height + 2 * margin + 2), np.int64)
    parts = begins, np.empty_like(begins)
    for tile in range(first, last):
        top, left = tile // strips * height, tile % strips * width
        bottom, right = min(top + height, rows), min(left + width, columns)
        x0, x1 = max(left - margin, 0), min(right + margin, columns)
        y0, y1 = _find_parts(wanted, top, bottom, left, right, x0, x1, rows, *parts)
        above = top - margin - 1  # row of the first place in parts
        most = min(_largest(y0, y1, above, x0, bits, *parts), limits[-1])
        if most <= bits_of_finest:
            _copy(max(top, y0), min(bottom, y1), above, x0, layer, *parts, after)
            continue
        kind = 0
        while limits[kind] < most:
            kind += 1
        held[:] = 0  # of another tile
        _roll(y0, y1, above, bottom, x0, x1, layer, scale, finest, spectra[kind], series[kind], *parts, held, after)


@numba.njit(nogil=True, cache=True)
def _roll(y0, y1, above, bottom, x0, x1, layer, scale, finest, spectrum, series, begins, ends, held, after):
    """Load rows y0 to y1 of a tile one by one; each step follows the one before it, a row behind."""
    degree = len(series) - 1
    while degree > 1 and series[degree] == 0:
        degree -= 1
    for y in range(y0, y1 + degree):
        place, row = place_of(y, held), y
        if y < y1:
            begin, end = begins[degree, y - above], ends[degree, y - above]
            if begin < end:
                load_row(y, place, x0, x1, begin, end, layer, scale, finest, spectrum, held)
        elif y == len(scale):
            load_nothing(place, held)
        for step in range(1, min(y - y0, degree) + 1):
            place, row = place_above(place, held), y - step
            begin, end = begins[degree - step, row - above], ends[degree - step, row - above]
            if row < y1 and begin < end:
                step_row(place, begin, end, step, degree, series, held)
        if row == y - degree:
            begin, end = begins[0, row - above], ends[0, row - above]
            if begin < end:
                store_row(row, place, x0, begin, end, bottom, held, after)


@numba.njit(nogil=True, cache=True)
def _find_parts(wanted, top, bottom, left, right, x0, x1, rows, begins, ends):
    """Columns of each row, as seen from x0, that are needed 0, 1, … steps before the last; and the rows to be loaded.

    Rows begin as many above the tile as there are steps, and one more. Where nothing is needed columns end at once.
    """
    margin, size, one = len(begins) - 1, np.uintp(begins.shape[1]), np.uintp(1)
    begins[:], ends[:] = COLUMNS, -COLUMNS
    y0, y1 = rows, 0
    for y in range(top, bottom):
        row = wanted[y // SQUARE, left // SQUARE : -(-right // SQUARE)]
        if largest_of(row):
            begin, end = 0, len(row)
            while not row[begin]:
                begin += 1
            while not row[end - 1]:
                end -= 1
            begins[0, y - top + margin + 1] = left + SQUARE * begin - x0
            ends[0, y - top + margin + 1] = min(left + SQUARE * end, right) - x0
            y0, y1 = min(y0, y), max(y1, y + 1)
    if y0 >= y1:
        return y0, y1
    for step in range(1, margin + 1):
        # A step earlier, one cell more to every side is needed.
        left_now, left_before, right_now, right_before = begins[step - 1], begins[step], ends[step - 1], ends[step]
        for j in range(one, size - one):
            left_before[j] = max(min(left_now[j - one], left_now[j], left_now[j + one]) - 1, 0)
            right_before[j] = min(max(right_now[j - one], right_now[j], right_now[j + one]) + 1, x1 - x0)
    return max(y0 - margin, 0), min(y1 + margin, rows)


@numba.njit(nogil=True, cache=True)
def _largest(y0, y1, above, x0, bits, begins, ends):
    """Of the scales that are loaded; 0 for none."""
    most = bits.dtype.type(0)
    for y in range(y0, y1):
        begin, end = begins[-1, y - above], ends[-1, y - above]
        if begin < end:
            most = max(most, largest_known(bits[y, x0 + begin : x0 + end]))
    return most


@numba.njit(nogil=True, cache=True)
def _copy(top, bottom, above, x0, layer, begins, ends, after):
    for y in range(top, bottom):
        begin, end = begins[0, y - above], ends[0, y - above]
        if begin < end:
            source, target = layer[y, 4 * (x0 + begin) : 4 * (x0 + end)], after[y, 4 * (x0 + begin) : 4 * (x0 + end)]
            for i in range(np.uintp(len(source))):
                target[i] = source[i]
