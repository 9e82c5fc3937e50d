"""Diffusion on cells as large as the blur allows: all of them take their steps together, and keep the mean.

Where the blur is wide a cell stands for many pixels, and one polynomial of a low degree moves light on all cells at
once, so nothing waits at an edge. Pixels far from any larger cell are stepped on the grid, in tiles. At the end each
cell gives its pixels what it has, along the slope to its neighbours.
"""

from __future__ import annotations

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.grid import WEAK, Level, conductances, hierarchy
from fogpipe.kernels.diffusion.partition import Partition, partition
from fogpipe.kernels.diffusion.polynomial import coefficients, degree_for, quantised
from fogpipe.kernels.diffusion.tiles import SQUARE, on_grid

RIM = 2
"""Squares around those that are taken from the cells: what is missing beyond would show in the last of these."""
CAP = 2.0
"""Largest rate of a link, in clips. Twice as much gains little and takes two fifths more steps."""


def adaptive(layer: FloatArray, scale: FloatArray, finest: float, clip: float, share: float) -> FloatArray:
    """Diffuse a layer (H, W, 4) on cells whose rates are about ``clip`` to four times as much.

    ``share`` is what a polynomial may leave out of any pattern.
    """
    east, south = conductances(scale, finest)
    levels = hierarchy(east, south, clip)
    near, calm = _near(levels[0], clip, share)
    after = on_grid(layer, east, south, calm, share, near < 2)
    cells = partition(levels, _by_twos(near > 0, levels[0]), CAP * clip)
    nothing = np.empty((0, 0), layer.dtype)
    levels[0] = levels[0]._replace(east=nothing, south=nothing)  # they are large, and have served
    del east, south
    values = _averaged(layer, levels)
    held = _evened(_collected(values, cells), cells, share)
    _spread(held, cells, levels, values, after, near, clip)
    return after


def _near(pixels: Level, clip: float, share: float) -> tuple[np.ndarray, float]:
    """Squares: 2 for those whose light comes from a larger cell or goes there, 1 for a rim around them, 0 for others.

    And the largest rate among the others, whose polynomial reaches as many pixels as it has degrees.
    """
    from scipy.ndimage import maximum_filter

    squares = tuple(-(-count // SQUARE) for count in pixels.mass.shape)
    with_cells, largest = np.empty(squares, np.uint8), np.empty(squares, pixels.mass.dtype)
    in_bands(
        _sort, squares[0], pixels.mass.shape[1] * SQUARE, pixels.east, pixels.south, pixels.joined, with_cells, largest
    )
    reach = -(-degree_for(8 * clip, share) // SQUARE)
    near = maximum_filter(with_cells, 2 * reach + 1) + maximum_filter(with_cells, 2 * (reach + RIM) + 1)
    return near, float(largest[near < 2].max(initial=0))


def _averaged(layer: FloatArray, levels: list[Level]) -> list[FloatArray]:
    """The layer, and for each further level the means over the pixels in its cells."""
    values = [layer]
    for level in levels[:-1]:
        coarse = np.empty((*level.joined.shape, 4), layer.dtype)
        in_bands(_average, *level.joined.shape, values[-1], level.mass, level.joined, coarse)
        values.append(coarse)
    return values


def _collected(values: list[FloatArray], cells: Partition) -> FloatArray:
    """What each cell holds (N, 4)."""
    held = np.empty((len(cells.mass), 4), values[0].dtype)
    for own, alone, numbers in zip(values, cells.alone, cells.numbers, strict=True):
        if numbers.size:
            in_bands(_collect, *alone.shape, own, alone, numbers, held)
    return held


def _evened(held: FloatArray, cells: Partition, share: float) -> FloatArray:
    """Diffused for a unit of time, by the recurrence of Chebyshev polynomials T(k) of X = 1 − 2A/λ."""
    own = np.einsum("ns->n", cells.weights, dtype=np.float64)
    others = np.concatenate([[0.0], np.cumsum(cells.rates, dtype=np.float64)])[cells.first]
    own[cells.starts[1] :] += np.diff(others)
    spectrum = quantised(2 * float(own.max(initial=0)))
    if spectrum == 0:
        return held
    series = coefficients(spectrum, degree_for(spectrum, share)).astype(held.dtype)
    now = held.ravel()
    older, total = now.copy(), series[0] * now
    links = cells.neighbours.ravel(), cells.weights.ravel(), cells.starts[1], cells.first, cells.finer, cells.rates
    rate = held.dtype.type(2 / spectrum)  # T(1) = X T(0) is half a step from T(0) = T(−1)
    for factor in series[1:]:
        in_bands(_step, len(held), 4, *links, rate, now, older, total, factor)
        older, now = now, older
        rate = held.dtype.type(4 / spectrum)
    return total.reshape(held.shape)


def _spread(
    held: FloatArray,
    cells: Partition,
    levels: list[Level],
    values: list[FloatArray],
    after: FloatArray,
    near: np.ndarray,
    clip: float,
) -> None:
    """Write what the cells hold into the pixels near to them."""
    below = [after, *values[1:]]
    weakest = held.dtype.type(WEAK * clip / 4)
    for k in range(len(levels) - 1, -1, -1):
        numbers = cells.numbers[k]
        if k + 1 < len(levels):
            coarse, level = levels[k + 1], levels[k]
            own = (level.joined, level.mass, below[k + 1], coarse.mass, coarse.east, coarse.south, weakest, below[k])
            in_bands(_fill, *level.joined.shape, *own)
        if numbers.size:
            alone = cells.alone[k] if k else np.where(_by_twos(near > 1, levels[0]), cells.alone[0], np.uint8(0))
            in_bands(_give, *alone.shape, held, alone, numbers, below[k])


def _by_twos(squares: np.ndarray, pixels: Level) -> np.ndarray:
    """A mask of squares as one of two by two pixels."""
    rows, columns = pixels.joined.shape
    size = SQUARE // 2
    return squares.repeat(size, axis=0)[:rows].repeat(size, axis=1)[:, :columns]


@numba.njit(nogil=True, cache=True)
def _sort(first, last, east, south, joined, with_cells, largest):
    rows, columns = east.shape
    size = SQUARE
    for square in range(first, last):
        top, bottom = square * size, min(square * size + size, rows)
        for number in range(with_cells.shape[1]):
            left, right = number * size, min(number * size + size, columns)
            found = False
            for y in range(top // 2, (bottom + 1) // 2):
                for x in range(left // 2, (right + 1) // 2):
                    found = found or joined[y, x] > 0
            with_cells[square, number] = 1 if found else 0
            most = east.dtype.type(0)
            if not found:
                for y in range(top, bottom):
                    for x in range(left, right):
                        most = max(most, max(east[y, x], south[y, x]))
            largest[square, number] = most


@numba.njit(nogil=True, cache=True)
def _average(first, last, values, mass, joined, coarse):
    zero, quarter = mass.dtype.type(0), mass.dtype.type(0.25)
    for y in range(first, last):
        for x in range(joined.shape[1]):
            part = joined[y, x]
            j, i = 2 * y, 2 * x
            if part == 15 and mass[j, i] == mass[j, i + 1] == mass[j + 1, i] == mass[j + 1, i + 1]:
                for k in range(4):
                    total = values[j, i, k] + values[j, i + 1, k] + values[j + 1, i, k] + values[j + 1, i + 1, k]
                    coarse[y, x, k] = quarter * total
                continue
            a = mass[j, i] if part & 1 else zero
            b = mass[j, i + 1] if part & 2 else zero
            c = mass[j + 1, i] if part & 4 else zero
            d = mass[j + 1, i + 1] if part & 8 else zero
            whole = a + b + c + d
            for k in range(4):
                total = zero
                if part & 1:
                    total += a * values[j, i, k]
                if part & 2:
                    total += b * values[j, i + 1, k]
                if part & 4:
                    total += c * values[j + 1, i, k]
                if part & 8:
                    total += d * values[j + 1, i + 1, k]
                coarse[y, x, k] = total / whole if part else zero


@numba.njit(nogil=True, cache=True)
def _collect(first, last, values, alone, numbers, held):
    for y in range(first, last):
        for x in range(alone.shape[1]):
            single = alone[y, x]
            if single:
                for k in range(4):
                    if single >> k & 1:
                        j, i = 2 * y + (k >> 1), 2 * x + (k & 1)
                        for channel in range(4):
                            held[numbers[j, i], channel] = values[j, i, channel]


@numba.njit(nogil=True, cache=True)
def _give(first, last, held, alone, numbers, values):
    for y in range(first, last):
        for x in range(alone.shape[1]):
            single = alone[y, x]
            if single:
                for k in range(4):
                    if single >> k & 1:
                        j, i = 2 * y + (k >> 1), 2 * x + (k & 1)
                        for channel in range(4):
                            values[j, i, channel] = held[numbers[j, i], channel]


_ONE, _TWO, _THREE, _FOUR = np.uintp(1), np.uintp(2), np.uintp(3), np.uintp(4)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step(lowest, highest, neighbours, weights, start, first, finer, rates, rate, now, older, total, share):
    """The recurrence T(k+1) = 2 X T(k) − T(k−1) with X = 1 − 2A/λ; ``older`` holds T(k−1), then T(k+1)."""
    for number in range(lowest, highest):
        own = np.uintp(number) * _FOUR
        if number >= start:
            for link in range(first[number - start], first[number - start + 1]):
                other, flow = np.uintp(finer[link]) * _FOUR, rate * rates[link]
                for k in range(_FOUR):
                    older[own + k] -= flow * (now[other + k] - now[own + k])
        west, east = np.uintp(neighbours[own]) * _FOUR, np.uintp(neighbours[own + _ONE]) * _FOUR
        north, south = np.uintp(neighbours[own + _TWO]) * _FOUR, np.uintp(neighbours[own + _THREE]) * _FOUR
        a, b, c, d = weights[own], weights[own + _ONE], weights[own + _TWO], weights[own + _THREE]
        for k in range(_FOUR):
            here = now[own + k]
            flow = a * (now[west + k] - here) + b * (now[east + k] - here)
            flow += c * (now[north + k] - here) + d * (now[south + k] - here)
            after = (here - older[own + k]) + here + rate * flow
            older[own + k] = after
            total[own + k] += share * after


@numba.njit(nogil=True, cache=True)
def _fill(first, last, joined, mass, coarse, whole, east, south, weakest, values):
    """Each joined cell gets what its coarse cell holds, a quarter of the way to each of the two that it lies next to.

    The cell beyond gives as much as it takes, so the mean is kept. Level upon level this makes a smooth surface.
    """
    rows, columns = joined.shape
    zero, quarter = mass.dtype.type(0), mass.dtype.type(0.25)
    for y in range(first, last):
        for x in range(columns):
            part = joined[y, x]
            if not part:
                continue
            m, j, i = whole[y, x], 2 * y, 2 * x
            w, e, n, s = max(x - 1, 0), min(x + 1, columns - 1), max(y - 1, 0), min(y + 1, rows - 1)
            # Which of the cells beyond may give: those at the same height, or above and below, if the way is open.
            to_west = joined[y, w] & 10 if x and east[y, w] > weakest * min(m, whole[y, w]) else 0
            to_east = joined[y, e] & 5 if east[y, x] > weakest * min(m, whole[y, e]) else 0
            to_north = joined[n, x] & 12 if y and south[n, x] > weakest * min(m, whole[n, x]) else 0
            to_south = joined[s, x] & 3 if south[y, x] > weakest * min(m, whole[s, x]) else 0
            around = to_west == 10 and to_east == 5 and to_north == 12 and to_south == 3
            alike = m == whole[y, w] and m == whole[y, e] and m == whole[n, x] and m == whole[s, x]
            if part == 15 and around and alike and m == 4 * mass[j, i] and m == 4 * mass[j + 1, i + 1]:
                for k in range(4):
                    here = coarse[y, x, k]
                    a, b = quarter * (coarse[y, w, k] - here), quarter * (coarse[y, e, k] - here)
                    c, d = here + quarter * (coarse[n, x, k] - here), here + quarter * (coarse[s, x, k] - here)
                    values[j, i, k], values[j, i + 1, k] = c + a, c + b
                    values[j + 1, i, k], values[j + 1, i + 1, k] = d + a, d + b
                continue
            for cell in range(4):
                if part >> cell & 1:
                    right, lower = cell & 1, cell >> 1
                    own = mass[j + lower, i + right]
                    beside, below = zero, zero
                    if (to_east if right else to_west) >> (cell ^ 1) & 1:
                        beside = quarter * min(own, mass[j + lower, i + 3 * right - 1]) / own
                    if (to_south if lower else to_north) >> (cell ^ 2) & 1:
                        below = quarter * min(own, mass[j + 3 * lower - 1, i + right]) / own
                    across, down = e if right else w, s if lower else n
                    for k in range(4):
                        here = coarse[y, x, k]
                        change = beside * (coarse[y, across, k] - here) + below * (coarse[down, x, k] - here)
                        values[j + lower, i + right, k] = here + change
