"""The cells of a hierarchy that are joined to no coarser one, numbered, and the links between them.

Every pixel is in exactly one of them. Two linked cells may lie on different levels; the finer one then knows its four
neighbours, and the coarser one keeps a list of the finer ones beside it. A link is capped where it would even out its
smaller cell many times over, so that one polynomial of a low degree serves them all.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.grid import Level


class Partition(NamedTuple):
    """Cells, level by level from the pixels on.

    Attributes
    ----------
    alone : for each level, which of two by two cells are such cells: 1, 2, 4, 8 by rows.
    numbers : for each level the number of the cell that each place is in, −1 for none; empty where there are none.
    starts : number of the first cell of each level, and of all.
    mass : (N,) pixels in a cell.
    neighbours : (N, 4) to the west, east, north and south; the cell itself where there is none.
    weights : (N, 4) G/m of the links to them, 0 for none.
    first, finer, rates : the links of cell ``starts[1] + k`` to finer ones are ``first[k]`` to ``first[k + 1]`` of
        ``finer``, their numbers, and ``rates``, G/m.
    """

    alone: list[np.ndarray]
    numbers: list[np.ndarray]
    starts: list[int]
    mass: FloatArray
    neighbours: np.ndarray
    weights: FloatArray
    first: np.ndarray
    finer: np.ndarray
    rates: FloatArray


def partition(levels: list[Level], alone: list[np.ndarray], cap: float) -> Partition:
    """Number the cells, and link them.

    Parameters
    ----------
    alone : for each level, which of two by two cells are to be numbered: those it has alone, or fewer pixels.
    cap : largest G/m of a link for the smaller of its cells.
    """
    rows, starts = [], [0]
    for own in alone:
        counts = np.empty(len(own), np.int64)
        in_bands(_count, *own.shape, own, counts)
        rows.append(starts[-1] + np.cumsum(counts) - counts)
        starts.append(starts[-1] + int(counts.sum()))
    dtype = levels[0].rate.dtype
    mass = np.empty(starts[-1], dtype)
    numbers = [np.empty((0, 0), np.int32) for _ in levels]
    above = numbers[-1]
    for k in reversed(range(0 if starts[1] else 1, len(levels))):
        numbers[k] = np.empty(levels[k].shape, np.int32)
        in_bands(_number, *alone[k].shape, levels[k].mass, levels[k].joined, alone[k], rows[k], above, numbers[k], mass)
        above = numbers[k]
    neighbours, weights = np.empty((starts[-1], 4), np.uint32), np.empty((starts[-1], 4), dtype)
    for level, single, own in zip(levels, alone, numbers, strict=True):
        if own.size:
            links = (level.rate, level.east, level.south, single, own, dtype.type(cap), mass)
            in_bands(_links, *single.shape, *links, neighbours, weights)
    bounds = np.array(starts)
    counts = np.zeros(starts[-1] - starts[1] + 1, np.int64)
    _count_finer(bounds, neighbours, weights, counts)
    first = np.cumsum(counts)
    finer, rates = np.empty(first[-1], np.uint32), np.empty(first[-1], dtype)
    _list_finer(bounds, neighbours, weights, mass, first[:-1].copy(), finer, rates)
    return Partition(alone, numbers, starts, mass, neighbours, weights, first, finer, rates)


@numba.njit(nogil=True, cache=True)
def _count(first, last, alone, counts):
    for y in range(first, last):
        count = np.uint32(0)
        for x in range(np.uintp(alone.shape[1])):
            own = alone[y, x]
            count += (own & 1) + (own >> 1 & 1) + (own >> 2 & 1) + (own >> 3)
        counts[y] = count


@numba.njit(nogil=True, cache=True)
def _number(first, last, mass, joined, alone, starts, coarse, numbers, masses):
    rows, columns = numbers.shape
    one = masses.dtype.type(1)
    for y in range(first, last):
        number = starts[y]
        for x in range(joined.shape[1]):
            part, single = joined[y, x], alone[y, x]
            above = coarse[y, x] if part else -1
            for k in range(4):
                j, i = 2 * y + (k >> 1), 2 * x + (k & 1)
                if single >> k & 1:
                    numbers[j, i] = number
                    masses[number] = mass[j, i] if mass.size else one
                    number += 1
                elif j < rows and i < columns:
                    numbers[j, i] = above if part >> k & 1 else -1


@numba.njit(nogil=True, cache=True)
def _links(first, last, rate, east, south, alone, numbers, cap, mass, neighbours, weights):
    rows, columns = numbers.shape
    zero = mass.dtype.type(0)
    for y in range(first, last):
        for x in range(alone.shape[1]):
            single = alone[y, x]
            for k in range(4):
                if not single >> k & 1:
                    continue
                j, i = 2 * y + (k >> 1), 2 * x + (k & 1)
                number = numbers[j, i]
                for side in range(4):
                    other, flow = -1, zero
                    if side == 0 and i > 0:
                        other, flow = numbers[j, i - 1], _face(rate, east, j, i - 1, j, i)
                    elif side == 1 and i + 1 < columns:
                        other, flow = numbers[j, i + 1], _face(rate, east, j, i, j, i + 1)
                    elif side == 2 and j > 0:
                        other, flow = numbers[j - 1, i], _face(rate, south, j - 1, i, j, i)
                    elif side == 3 and j + 1 < rows:
                        other, flow = numbers[j + 1, i], _face(rate, south, j, i, j + 1, i)
                    if other < 0:
                        other, flow = number, zero
                    neighbours[number, side] = other
                    weights[number, side] = min(flow, cap * min(mass[number], mass[other])) / mass[number]


@numba.njit(nogil=True, cache=True)
def _face(rate, conductance, y, x, j, i):
    """Between a cell and the next one, (j, i), to the east or south."""
    return rate.dtype.type(0.5) * (rate[y, x] + rate[j, i]) if rate.size else conductance[y, x]


@numba.njit(nogil=True, cache=True)
def _count_finer(starts, neighbours, weights, counts):
    for level in range(len(starts) - 2):
        for number in range(starts[level], starts[level + 1]):
            for side in range(4):
                other = np.int64(neighbours[number, side])
                if other >= starts[level + 1] and weights[number, side] > 0:
                    counts[other - starts[1] + 1] += 1


@numba.njit(nogil=True, cache=True)
def _list_finer(starts, neighbours, weights, mass, place, finer, rates):
    for level in range(len(starts) - 2):
        for number in range(starts[level], starts[level + 1]):
            for side in range(4):
                other = np.int64(neighbours[number, side])
                if other >= starts[level + 1] and weights[number, side] > 0:
                    k = place[other - starts[1]]
                    finer[k] = number
                    rates[k] = weights[number, side] * mass[number] / mass[other]
                    place[other - starts[1]] = k + 1
