"""From pixels to the cells of a hierarchy and back: means on the way up, slopes between neighbours on the way down."""

from __future__ import annotations

import itertools

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray, floats
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.channels import load, store
from fogpipe.kernels.diffusion.coarsening import WEAK
from fogpipe.kernels.diffusion.grid import Level
from fogpipe.kernels.diffusion.partition import Partition
from fogpipe.kernels.diffusion.rows import end_of_run, flags, mass_of, next_flag
from fogpipe.kernels.diffusion.tiles import in_rows

_ONE, _FOUR, _EIGHT = np.uintp(1), np.uintp(4), np.uintp(8)


def gathered(layer: FloatArray, levels: list[Level], cells: Partition) -> tuple[list[FloatArray], FloatArray]:
    """The layer (H, W, 4) in rows of four numbers a cell, and for each further level the means over its cells.

    And what each cell of the partition holds, four numbers one after the other (4 N).
    """
    values, held = list(floats(in_rows(layer))), np.empty(4 * len(cells.mass), layer.dtype)
    for k, (level, above) in enumerate(itertools.pairwise(levels)):
        rows, columns = above.shape
        coarse, full = np.empty((rows, 4 * columns), layer.dtype), layer.dtype.type(4 ** (k + 1))
        means = level.mass, level.joined, above.mass, full, coarse
        in_bands(_gather, rows, columns, values[k], *means, cells.rows[k], cells.places, held)
        values.append(coarse)
    _collect(0, len(levels[-1].joined), values[-1].ravel(), cells.rows[-1], cells.places, held)
    return values, held


def spread(
    held: FloatArray,
    cells: Partition,
    levels: list[Level],
    values: list[FloatArray],
    after: FloatArray,
    clip: float,
) -> None:
    """Write what the cells hold into their pixels, but for those of the rim."""
    below = [in_rows(after), *values[1:]]
    real = held.dtype.type
    _give(0, len(levels[-1].joined), held, cells.rows[-1], cells.places, below[-1].reshape(-1))
    for k in range(len(levels) - 2, -1, -1):
        level, above = levels[k], levels[k + 1]
        ways = above.mass, real(4 ** (k + 1)), above.east, above.south, real(WEAK * clip / 4)
        found = held, cells.rows[k], cells.places
        in_bands(_spread, *level.joined.shape, level.joined, level.mass, *ways, below[k + 1], *found, below[k])


@numba.njit(nogil=True, cache=True)
def _gather(first, last, values, mass, joined, whole, full, coarse, starts, places, held):
    _average(first, last, values, mass, joined, whole, full, coarse)
    _collect(first, last, values.ravel(), starts, places, held)


@numba.njit(nogil=True, cache=True)
def _spread(first, last, joined, mass, whole, full, east, south, weakest, coarse, held, starts, places, values):
    _fill(first, last, joined, mass, whole, full, east, south, weakest, coarse, values)
    _give(first, last, held, starts, places, values.reshape(values.size))


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _average(first, last, values, mass, joined, whole, full, coarse):
    columns = joined.shape[1]
    (alike, alike_eights), (others, eights) = flags(columns), flags(columns)
    for y in range(first, last):
        for x in range(np.uintp(columns)):
            alike[x] = whole[y, x] == full
            others[x] = (joined[y, x] > 0) & (whole[y, x] != full)
        x = next_flag(0, alike, alike_eights)
        while x < columns:
            end = end_of_run(x, alike, alike_eights)
            _mean_of_four(values[2 * y, 8 * x :], values[2 * y + 1, 8 * x :], coarse[y, 4 * x : 4 * end])
            x = next_flag(end, alike, alike_eights)
        x = next_flag(0, others, eights)
        while x < columns:
            own = np.uintp(4 * x)
            coarse[y, 4 * x : 4 * x + 4] = 0
            for k in range(4):
                if joined[y, x] >> k & 1:
                    row, column = 2 * y + (k >> 1), 2 * x + (k & 1)
                    share = mass_of(row, column, mass) / whole[y, x]
                    store(coarse[y], own, load(coarse[y], own) + share * load(values[row], np.uintp(4 * column)))
            x = next_flag(x + 1, others, eights)


@numba.njit(nogil=True, cache=True)
def _mean_of_four(upper, lower, coarse):
    quarter = coarse.dtype.type(0.25)
    for x in range(np.uintp(len(coarse)) // _FOUR):
        left, right = _EIGHT * x, _EIGHT * x + _FOUR
        both = (load(upper, left) + load(upper, right)) + (load(lower, left) + load(lower, right))
        store(coarse, _FOUR * x, quarter * both)


@numba.njit(nogil=True, cache=True)
def _collect(first, last, values, starts, places, held):
    for number in range(np.uintp(starts[first]), np.uintp(starts[last])):
        place = max(places[number], -1 - places[number])
        store(held, _FOUR * number, load(values, _FOUR * np.uintp(place)))


@numba.njit(nogil=True, cache=True)
def _give(first, last, held, starts, places, values):
    for number in range(np.uintp(starts[first]), np.uintp(starts[last])):
        if places[number] >= 0:
            store(values, _FOUR * np.uintp(places[number]), load(held, _FOUR * number))


@numba.njit(nogil=True, cache=True)
def _fill(first, last, joined, mass, whole, full, east, south, weakest, coarse, values):
    """Each joined cell gets what its coarse cell holds, a quarter of the way to each of the two that it lies next to.

    The cell beyond gives as much as it takes, so the mean is kept. Level upon level this makes a smooth surface.
    """
    rows, columns = joined.shape
    (smooth, smooth_eights), (others, eights) = flags(columns), flags(columns)
    quarter = mass.dtype.type(0.25)
    for y in range(first, last):
        n, s = max(y - 1, 0), min(y + 1, rows - 1)
        if 0 < y < rows - 1:
            _open_around(whole[n], whole[y], whole[s], full, south[n], east[y], south[y], weakest, smooth)
        else:
            smooth_eights[:] = 0
        for x in range(np.uintp(columns)):
            others[x] = (joined[y, x] > 0) & (smooth[x] == 0)
        x = next_flag(0, smooth, smooth_eights)
        while x < columns:
            end = end_of_run(x, smooth, smooth_eights)
            run = slice(4 * x, 4 * end)
            above, ours, beneath = coarse[n, run], coarse[y, 4 * x - 4 :], coarse[s, run]
            _fill_four(above, ours, beneath, values[2 * y, 8 * x :], values[2 * y + 1, 8 * x :])
            x = next_flag(end, smooth, smooth_eights)
        x = next_flag(0, others, eights)
        while x < columns:
            part, m, w, e = joined[y, x], whole[y, x], max(x - 1, 0), min(x + 1, columns - 1)
            # Which of the cells beyond may give: those at the same height, or above and below, if the way is open.
            to_west = joined[y, w] & 10 if x and east[y, w] > weakest * min(m, whole[y, w]) else 0
            to_east = joined[y, e] & 5 if east[y, x] > weakest * min(m, whole[y, e]) else 0
            to_north = joined[n, x] & 12 if y and south[n, x] > weakest * min(m, whole[n, x]) else 0
            to_south = joined[s, x] & 3 if south[y, x] > weakest * min(m, whole[s, x]) else 0
            here = load(coarse[y], np.uintp(4 * x))
            for k in range(4):
                if part >> k & 1:
                    right, lower = k & 1, k >> 1
                    row, column = 2 * y + lower, 2 * x + right
                    own, value = mass_of(row, column, mass), here
                    if (to_east if right else to_west) >> (k ^ 1) & 1:
                        share = quarter * min(own, mass_of(row, column + 2 * right - 1, mass)) / own
                        value = value + share * (load(coarse[y], np.uintp(4 * (e if right else w))) - here)
                    if (to_south if lower else to_north) >> (k ^ 2) & 1:
                        share = quarter * min(own, mass_of(row + 2 * lower - 1, column, mass)) / own
                        value = value + share * (load(coarse[s if lower else n], np.uintp(4 * x)) - here)
                    store(values[row], np.uintp(4 * column), value)
            x = next_flag(x + 1, others, eights)


@numba.njit(nogil=True, cache=True)
def _open_around(above, ours, beneath, full, north, east, south, weakest, smooth):
    """Whether a cell and the four around it are whole, and the ways between them open; not so in the outer columns."""
    least = weakest * full
    for x in range(_ONE, np.uintp(len(ours) - 1)):
        alike = (ours[x - _ONE] == full) & (ours[x] == full) & (ours[x + _ONE] == full)
        alike &= (above[x] == full) & (beneath[x] == full)
        smooth[x] = alike & (east[x - _ONE] > least) & (east[x] > least) & (north[x] > least) & (south[x] > least)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _fill_four(above, ours, beneath, upper, lower):
    """Of cells of two by two; ``ours`` begins and ends with one cell more."""
    half, quarter = above.dtype.type(0.5), above.dtype.type(0.25)
    for x in range(np.uintp(len(above)) // _FOUR):
        own, left, right = _FOUR * x, _EIGHT * x, _EIGHT * x + _FOUR
        # Half of its own and a quarter of both, in each of the four corners.
        here = half * load(ours, own + _FOUR)
        west, east = quarter * load(ours, own), quarter * load(ours, own + _EIGHT)
        north, south = here + quarter * load(above, own), here + quarter * load(beneath, own)
        store(upper, left, north + west)
        store(upper, right, north + east)
        store(lower, left, south + west)
        store(lower, right, south + east)
