"""Steps of a polynomial on a few rows that roll down a tile: each follows the one before it, a row behind.

All that a step touches stays in the cache, and no rows are computed in vain but those of a tile's margins. The rows are
records in one array, in turn: each takes the place of one that is done. A record holds T(k) of the latest even k and of
the latest odd one, the polynomial so far, each with its four channels one after the other, and the conductances to the
east and south in 2/λ. Sixteen cells are done at once, whose conductances are loaded once for the four channels. Nothing
that is needed depends on what is computed beyond the part of a row that is, which may be anything.
"""

from __future__ import annotations

import numba
import numpy as np

from fogpipe.kernels.channels import SPLIT, fetch, load_many, merge, split, store
from fogpipe.kernels.diffusion.rows import mean_rate

COLUMNS = 512
"""Of a tile with its margins."""
AHEAD = 2
"""Rows after which one is written that is fetched now: too short for a processor to see what comes next."""

_ONE, _FOUR, _LANES = np.uintp(1), np.uintp(4), np.uintp(SPLIT)
_WIDTH = np.uintp(COLUMNS + 2 * SPLIT)  # with cells before and behind, so that vectors lie on their boundaries
_ODD, _TOTAL, _EAST, _SOUTH, _RECORD = (np.uintp(k) * _WIDTH for k in (4, 8, 12, 13, 14))


@numba.njit(nogil=True, cache=True)
def records(steps, layer):
    """Room for the rows that so many steps need, on a boundary of the first cache's lines."""
    size = (steps + 2) * int(_RECORD)
    block = np.empty(size + 64, layer.dtype)
    start = (-block.ctypes.data % 64) // block.itemsize
    return block[start : start + size]


@numba.njit(nogil=True, cache=True)
def place_of(y, rows):
    """Where the record of a row begins."""
    return np.uintp(y) % (np.uintp(len(rows)) // _RECORD) * _RECORD


@numba.njit(nogil=True, cache=True)
def place_above(place, rows):
    """Where the record of the row above one begins."""
    return (place if place > np.uintp(0) else np.uintp(len(rows))) - _RECORD


@numba.njit(nogil=True, cache=True)
def load_row(y, place, x0, x1, begin, end, layer, scale, finest, spectrum, rows):
    """Columns ``begin`` to ``end`` of a row, as seen from x0, of a tile that ends at x1; and their conductances."""
    zero, half, share = type(spectrum)(0), type(spectrum)(0.5), type(spectrum)(4) / spectrum
    last, x = np.uintp(x1 - x0), np.uintp(x0)
    begin, behind = _vectors(begin, end)
    end = min(behind, last)
    start = place + _LANES
    here, below, pixels = scale[y], scale[min(y + 1, len(scale) - 1)], layer[y]
    b = start + _EAST
    for i in range(begin, min(end, last - _ONE)):
        rows[b + i] = min(share * mean_rate(here[x + i], here[x + i + _ONE], finest), half)
    if end == last:
        rows[b + last - _ONE] = zero
    b = start + _SOUTH
    for i in range(begin, end):
        rows[b + i] = min(share * mean_rate(here[x + i], below[x + i], finest), half) if y + 1 < len(scale) else zero
    whole = begin + (end - begin) // _LANES * _LANES
    for i in range(begin, whole, _LANES):
        split(pixels, _FOUR * (x + i), rows, start + i, _WIDTH)
    for i in range(whole, behind):
        for k in range(_FOUR):
            rows[start + k * _WIDTH + i] = pixels[_FOUR * (x + i) + k] if i < end else zero


@numba.njit(nogil=True, cache=True)
def load_nothing(place, rows):
    """The row beyond the last one: what is left in its place would be harmless but for NaN."""
    rows[place : place + _RECORD] = 0


@numba.njit(nogil=True, cache=True)
def step_row(place, begin, end, step, degree, series, rows):
    """T(step) of a row where T(step − 1) is known of those beside it, and what it adds to the polynomial."""
    begin, end = _vectors(begin, end)
    below = place + _RECORD if place + _RECORD < np.uintp(len(rows)) else np.uintp(0)
    here, north, south = place + _LANES, place_above(place, rows) + _LANES, below + _LANES
    # Two terms are added to the sum at once, in the last step and every second one before it.
    if step == 1:
        share = series[1] if degree % 2 else series.dtype.type(0)
        _first_step(begin, end, here, north, south, series[0], share, rows)
    else:
        odd = np.uintp(step % 2)
        of_now, of_older = _ODD * (_ONE - odd), _ODD * odd
        if (degree - step) % 2:
            _step(begin, end, here, north, south, of_now, of_older, rows)
        else:
            _step_and_sum(begin, end, here, north, south, of_now, of_older, series[step - 1], series[step], rows)


@numba.njit(nogil=True, cache=True)
def _vectors(begin, end):
    """The same, from a boundary of vectors to one."""
    return np.uintp(begin) // _LANES * _LANES, (np.uintp(end) + _LANES - _ONE) // _LANES * _LANES


@numba.njit(nogil=True, inline="always")
def _weights(b, north, rows):
    west, east = load_many(rows, b + _EAST - _ONE), load_many(rows, b + _EAST)
    return west, east, load_many(rows, north + _SOUTH), load_many(rows, b + _SOUTH)


@numba.njit(nogil=True, inline="always")
def _flow(a, north, south, here, weights, rows):
    """What flows into cells."""
    to_west, to_east, to_north, to_south = weights
    return (
        to_west * (load_many(rows, a - _ONE) - here)
        + to_east * (load_many(rows, a + _ONE) - here)
        + to_north * (load_many(rows, north) - here)
        + to_south * (load_many(rows, south) - here)
    )


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _first_step(begin, end, here, north, south, constant, share, rows):
    """T(1) = X T(0)."""
    half = rows.dtype.type(0.5)
    for i in range(begin, end, _LANES):
        weights = _weights(here + i, north + i, rows)
        for k in range(_FOUR):
            c = i + k * _WIDTH
            a = here + c
            before = load_many(rows, a)
            after = before + half * _flow(a, north + c, south + c, before, weights, rows)
            store(rows, a + _ODD, after)
            store(rows, a + _TOTAL, constant * before + share * after)


@numba.njit(nogil=True, inline="always")
def _next(c, here, north, south, of_now, of_older, weights, rows):
    """The recurrence T(k+1) = 2 X T(k) − T(k−1) with X = 1 − 2A/λ; T(k+1) takes the place of T(k−1)."""
    at_now, at_older = here + c + of_now, here + c + of_older
    now = load_many(rows, at_now)
    flow = _flow(at_now, north + c + of_now, south + c + of_now, now, weights, rows)
    after = (now - load_many(rows, at_older)) + now + flow
    store(rows, at_older, after)
    return now, after


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step(begin, end, here, north, south, of_now, of_older, rows):
    """A step that leaves the polynomial as it is."""
    for i in range(begin, end, _LANES):
        weights = _weights(here + i, north + i, rows)
        for k in range(_FOUR):
            _next(i + k * _WIDTH, here, north, south, of_now, of_older, weights, rows)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step_and_sum(begin, end, here, north, south, of_now, of_older, share, next_share, rows):
    """A step, and what T(k) and T(k+1) add to the polynomial."""
    for i in range(begin, end, _LANES):
        weights = _weights(here + i, north + i, rows)
        for k in range(_FOUR):
            c = i + k * _WIDTH
            now, after = _next(c, here, north, south, of_now, of_older, weights, rows)
            total = here + c + _TOTAL
            store(rows, total, load_many(rows, total) + share * now + next_share * after)


@numba.njit(nogil=True, cache=True)
def store_row(y, place, x0, begin, end, bottom, rows, after):
    """Write the polynomial of a row of a tile that ends before row ``bottom``."""
    first, count = np.uintp(4 * (x0 + begin)), np.uintp(end - begin)
    soon, pixels = after[min(y + AHEAD, bottom - 1)], after[y]
    for i in range(np.uintp(0), _FOUR * count, _LANES):
        fetch(soon, first + i)
    start = place + _LANES + _TOTAL + np.uintp(begin)
    whole = count // _LANES * _LANES
    for i in range(np.uintp(0), whole, _LANES):
        merge(rows, start + i, _WIDTH, pixels, first + _FOUR * i)
    for i in range(whole, count):
        for k in range(_FOUR):
            pixels[first + _FOUR * i + k] = rows[start + i + k * _WIDTH]
