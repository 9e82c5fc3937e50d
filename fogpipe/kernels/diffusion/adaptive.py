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
from fogpipe.kernels.channels import load, store
from fogpipe.kernels.diffusion.grid import Level, hierarchy
from fogpipe.kernels.diffusion.partition import Partition, partition
from fogpipe.kernels.diffusion.polynomial import coefficients, degree_for, quantised
from fogpipe.kernels.diffusion.tiles import SQUARE, on_grid
from fogpipe.kernels.diffusion.transfer import averaged, collected, spread

RIM = 2
"""Squares at most around those that are taken from the cells: what is missing beyond shows in the last of these."""
CAP = 2.0
"""Largest rate of a link, in clips. Twice as much gains little and takes two fifths more steps."""


def adaptive(
    layer: FloatArray, rate: FloatArray, clip: float, share: float, after: FloatArray | None = None
) -> FloatArray:
    """Diffuse a layer (H, W, 4) on cells whose rates are about ``clip`` to four times as much.

    ``rate`` is ϱ (H, W) of its pixels, and ``share`` what a polynomial may leave out of any pattern. The result is
    written into ``after`` if that is given.
    """
    levels = hierarchy(rate, clip)
    if len(levels) == 1:
        return on_grid(layer, rate, float(rate.max()), share, after=after)
    near = _near(levels[0].joined, degree_for(8 * clip, share), degree_for(quantised(8 * CAP * clip), share))
    # A pixel with a face above the clip is in one of the other squares.
    after = on_grid(layer, rate, clip, share, near < 2, after)
    alone = [level.alone for level in levels]
    cells = partition(levels, [_pixels(alone[0], near, 1), *alone[1:]], CAP * clip)
    values = averaged(layer, levels)
    held = _evened(collected(values, cells), cells, share)
    spread(held, cells, [_pixels(alone[0], near, 2), *alone[1:]], levels, values, after, clip)
    return after


def _near(joined: np.ndarray, reach: int, degree: int) -> np.ndarray:
    """Squares: 2 for those whose light comes from a larger cell or goes there, 1 for a rim around them, 0 for others.

    ``joined`` are the pixels of larger cells, ``reach`` is how many pixels far light gets, and ``degree`` how many steps
    the cells take, which is how far one notices what is cut off.
    """
    import cv2

    with_cells = np.empty([-(-count * 2 // SQUARE) for count in joined.shape], np.uint8)
    in_bands(_with_cells, with_cells.shape[0], joined.shape[1] * SQUARE, joined, with_cells)
    squares = -(-reach // SQUARE)
    rim = min(-(-degree // SQUARE), RIM)
    inner, outer = (cv2.dilate(with_cells, np.ones((2 * r + 1, 2 * r + 1), np.uint8)) for r in (squares, squares + rim))
    return inner + outer


def _evened(held: FloatArray, cells: Partition, share: float) -> FloatArray:
    """Diffused for a unit of time, by the recurrence of Chebyshev polynomials T(k) of X = 1 − 2A/λ."""
    leaving = np.empty_like(cells.mass)
    in_bands(_leaving, len(leaving), 4, cells.weights, cells.starts[1], cells.first, cells.rates, leaving)
    spectrum = quantised(2 * float(leaving.max(initial=0)))
    if spectrum == 0:
        return held
    series = coefficients(spectrum, degree_for(spectrum, share)).astype(held.dtype)
    now, older, total = held, held.copy(), series[0] * held
    links = cells.neighbours.ravel(), cells.weights.ravel(), cells.starts[1], cells.first, cells.finer, cells.rates
    rate = held.dtype.type(2 / spectrum)  # T(1) = X T(0) is half a step from T(0) = T(−1)
    for factor in series[1:]:
        in_bands(_step, len(leaving), 4, *links, rate, now, older, total, factor)
        older, now = now, older
        rate = held.dtype.type(4 / spectrum)
    return total


def _pixels(alone: np.ndarray, near: np.ndarray, least: int) -> np.ndarray:
    """Of two by two pixels, those that are cells by themselves where a square is ``least`` or more."""
    found = np.empty_like(alone)
    in_bands(_select, *alone.shape, alone, near, least, found)
    return found


_ONE, _TWO, _FOUR = np.uintp(1), np.uintp(2), np.uintp(4)


@numba.njit(nogil=True, cache=True)
def _with_cells(first, last, joined, with_cells):
    """1 for the squares of four by four pixels in which some are joined."""
    rows, columns = joined.shape
    for square in range(first, last):
        upper, lower, found = joined[2 * square], joined[min(2 * square + 1, rows - 1)], with_cells[square]
        for x in range(np.uintp(columns // 2)):
            left, right = _TWO * x, _TWO * x + _ONE
            found[x] = (upper[left] | upper[right] | lower[left] | lower[right]) > 0
        if columns % 2:
            found[-1] = (upper[-1] | lower[-1]) > 0


@numba.njit(nogil=True, cache=True)
def _select(first, last, alone, near, least, found):
    size = SQUARE // 2
    for y in range(first, last):
        for x in range(alone.shape[1]):
            found[y, x] = alone[y, x] if near[y // size, x // size] >= least else 0


@numba.njit(nogil=True, cache=True)
def _leaving(lowest, highest, weights, start, first, rates, leaving):
    """What leaves a cell in a unit of time, over what it holds: half of what the eigenvalues may be."""
    for number in range(lowest, highest):
        total = (weights[number, 0] + weights[number, 1]) + (weights[number, 2] + weights[number, 3])
        if number >= start:
            for link in range(first[number - start], first[number - start + 1]):
                total += rates[link]
        leaving[number] = total


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step(lowest, highest, neighbours, weights, start, first, finer, rates, rate, now, older, total, share):
    """The recurrence T(k+1) = 2 X T(k) − T(k−1) with X = 1 − 2A/λ; ``older`` holds T(k−1), then T(k+1)."""
    for number in range(lowest, highest):
        own = np.uintp(number) * _FOUR
        here = load(now, own)
        flow = here - here
        for side in range(own, own + _FOUR):
            flow = flow + weights[side] * (load(now, np.uintp(neighbours[side]) * _FOUR) - here)
        if number >= start:
            for link in range(first[number - start], first[number - start + 1]):
                flow = flow + rates[link] * (load(now, np.uintp(finer[link]) * _FOUR) - here)
        after = (here - load(older, own)) + here + rate * flow
        store(older, own, after)
        store(total, own, load(total, own) + share * after)
