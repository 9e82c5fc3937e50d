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
from fogpipe.kernels.diffusion.rows import face, flags, next_flag


class Partition(NamedTuple):
    """Cells, level by level from the pixels on.

    Attributes
    ----------
    starts : number of the first cell of each level, and of all.
    rows : in each level, number of the first cell of each two rows, and of all.
    places : (N,) where a cell is in its level, counted row by row; −1 less that for the rim, which gets nothing back.
    mass : (N,) pixels in a cell.
    neighbours : (N, 4) to the west, east, north and south; the cell itself where there is none.
    weights : (N, 4) G/m of the links to them, 0 for none.
    leaving : (N,) what leaves a cell by these links in a unit of time, over what it holds.
    coarser : (N,) which of the neighbours are on a coarser level: 1, 2, 4, 8.
    """

    starts: list[int]
    rows: list[np.ndarray]
    places: np.ndarray
    mass: FloatArray
    neighbours: np.ndarray
    weights: FloatArray
    leaving: FloatArray
    coarser: np.ndarray


class LinksBack(NamedTuple):
    """The links of coarser cells to finer ones.

    Attributes
    ----------
    first, finer, rates : those of cell ``starts[1] + k`` are ``first[k]`` to ``first[k + 1]`` of ``finer``, the numbers
        of the finer cells, and ``rates``, G/m.
    leaving : the largest part of what a cell holds that leaves it in a unit of time: half of what eigenvalues may be.
    """

    first: np.ndarray
    finer: np.ndarray
    rates: FloatArray
    leaving: float


def partition(levels: list[Level], near: np.ndarray, cap: float) -> Partition:
    """Number the cells, and link them to cells as large as they are and larger ones.

    Parameters
    ----------
    near : of squares of two by two pixels, 2 or 1 for those whose pixels are numbered, 1 for the rim.
    cap : largest G/m of a link for the smaller of its cells.
    """
    alone = [levels[0].alone * (near > 0).view(np.uint8), *(level.alone for level in levels[1:])]
    starts, rows = [0], []  # of each level, and in it of each two rows
    for own in alone:
        rows.append(_counted(own, starts[-1]))
        starts.append(int(rows[-1][-1]))
    count, dtype = starts[-1], levels[0].scale.dtype
    places, mass = np.empty(count, np.int32), np.empty(count, dtype)
    neighbours, weights = np.empty((count, 4), np.uint32), np.empty((count, 4), dtype)
    leaving, coarser = np.empty(count, dtype), np.empty(count, np.uint8)
    numbers = np.empty((0, 0), np.int32)
    for k in range(len(levels) - 1, -1, -1):
        level, own, rim = levels[k], alone[k], near[: len(near) if k == 0 else 0]
        coarse, numbers = numbers, np.empty(level.shape, np.int32)
        in_bands(_number, *own.shape, level.mass, level.joined, own, rim, rows[k], coarse, numbers, places, mass)
        # Coarser cells are done, and a link needs no more of finer ones than their links back.
        conductances, limits = (level.scale, level.finest, level.east, level.south), (dtype.type(cap), starts[k + 1])
        cells = places, mass, neighbours, weights, leaving, coarser
        in_bands(_links, *own.shape, *conductances, numbers, rows[k], *limits, *cells)
    return Partition(starts, rows, places, mass, neighbours, weights, leaving, coarser)


def links_back(cells: Partition) -> LinksBack:
    """The links to coarser cells turned round: listed for those."""
    links, start = (cells.coarser, cells.neighbours, cells.weights, cells.mass), cells.starts[1]
    first, finer, rates, leaving = _turned(*links, start, cells.leaving[start:].copy())
    return LinksBack(first, finer, rates, float(max(cells.leaving[:start].max(initial=0), leaving.max(initial=0))))


_ONE, _TWO = np.uintp(1), np.uintp(2)


@numba.njit(nogil=True, cache=True)
def _counted(alone, start):
    """Number of the first cell of each two rows, and of all."""
    starts, counts, one = np.empty(len(alone) + 1, np.int64), np.empty(alone.shape[1], np.uint8), np.uint8(1)
    starts[0] = start
    for y in range(len(alone)):
        row, count = alone[y], np.uint32(0)
        for x in range(np.uintp(len(row))):  # in bytes, of which most fit into a vector
            own = row[x]
            counts[x] = (own & one) + (own >> one & one) + (own >> np.uint8(2) & one) + (own >> np.uint8(3))
        for x in range(np.uintp(len(row))):
            count += np.uint32(counts[x])
        starts[y + 1] = starts[y] + count
    return starts


@numba.njit(nogil=True, cache=True)
def _number(first, last, mass, joined, alone, near, starts, coarse, numbers, places, masses):
    """Cells by themselves, two by two of them after the others in two rows. Parts of a coarser one have its number."""
    columns, one = numbers.shape[1], masses.dtype.type(1)
    (beside, eights), (some, eights_of_some) = flags(alone.shape[1]), flags(alone.shape[1])
    for y in range(first, last):
        if near.size:
            # No finer cell asks for the numbers of pixels, only those beside them.
            _beside(y, alone, beside)
            _inherit_some(2 * y, joined[y], coarse, beside, eights, numbers)
        else:
            _inherit(2 * y, joined[y], coarse, numbers)
        for x in range(np.uintp(alone.shape[1])):
            some[x] = alone[y, x] > 0
        number = starts[y]
        x = next_flag(0, some, eights_of_some)
        while x < alone.shape[1]:
            rim = near.size and near[y, x] == 1
            for k in range(4):
                if alone[y, x] >> k & 1:
                    j, i = 2 * y + (k >> 1), 2 * x + (k & 1)
                    place = j * columns + i
                    numbers[j, i] = number
                    places[number] = -1 - place if rim else place
                    masses[number] = mass[j, i] if mass.size else one
                    number += 1
            x = next_flag(x + 1, some, eights_of_some)


@numba.njit(nogil=True, cache=True)
def _beside(y, alone, beside):
    """Which two by two cells of a row have some by themselves among them or next to them."""
    columns = np.uintp(alone.shape[1])
    above, ours, below = alone[max(y - 1, 0)], alone[y], alone[min(y + 1, len(alone) - 1)]
    for x in range(columns):
        beside[x] = (above[x] | ours[x] | below[x]) > 0
    for x in range(_ONE, columns):
        beside[x - _ONE] |= ours[x] > 0
    for x in range(_ONE, columns):
        beside[x] |= ours[x - _ONE] > 0


@numba.njit(nogil=True, cache=True)
def _inherit_some(top, joined, coarse, some, eights, numbers):
    rows, columns = numbers.shape
    x = next_flag(0, some, eights)
    while x < len(joined):
        for k in range(4):
            j, i = top + (k >> 1), 2 * x + (k & 1)
            if j < rows and i < columns:
                numbers[j, i] = coarse[top // 2, x] if joined[x] >> k & 1 else -1
        x = next_flag(x + 1, some, eights)


@numba.njit(nogil=True, cache=True)
def _inherit(top, joined, coarse, numbers):
    """Of two rows of cells, the numbers of the coarser ones that they are part of; −1 for those of none."""
    one, none = np.uint8(1), np.int32(-1)
    for j in range(top, min(top + 2, len(numbers))):
        row, shift = numbers[j], np.uint8(2 * (j - top))
        if coarse.size == 0:
            row[:] = none
            continue
        above = coarse[top // 2]
        for x in range(np.uintp(len(row) // 2)):
            part = joined[x] >> shift
            row[_TWO * x] = above[x] if part & one else none
            row[_TWO * x + _ONE] = above[x] if part >> one & one else none
        if len(row) % 2:
            row[-1] = above[-1] if joined[-1] >> shift & one else none


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _links(
    first, last, scale, finest, east, south, numbers, starts, cap, end,
    places, mass, neighbours, weights, leaving, coarser,
):  # fmt: skip
    """The four of each cell, and which of them go to one from number ``end`` on: 1, 2, 4, 8."""
    rows, columns = np.uintp(numbers.shape[0]), np.uintp(numbers.shape[1])
    none, zero, cells = np.int32(-1), mass.dtype.type(0), (mass, neighbours, weights)
    for y in range(first, last):
        for number in range(np.uintp(starts[y]), np.uintp(starts[y + 1])):
            place = np.uintp(max(places[number], -1 - places[number]))
            j = np.uintp(2 * y) if place < np.uintp(2 * y + 1) * columns else np.uintp(2 * y + 1)
            i = place - j * columns
            at_west = at_east = at_north = at_south = none
            to_west = to_east = to_north = to_south = zero
            if i > 0:
                at_west, to_west = numbers[j, i - _ONE], face(j, i - _ONE, j, i, scale, finest, east)
            if i + _ONE < columns:
                at_east, to_east = numbers[j, i + _ONE], face(j, i, j, i + _ONE, scale, finest, east)
            if j > 0:
                at_north, to_north = numbers[j - _ONE, i], face(j - _ONE, i, j, i, scale, finest, south)
            if j + _ONE < rows:
                at_south, to_south = numbers[j + _ONE, i], face(j, i, j + _ONE, i, scale, finest, south)
            found = _link(number, 0, at_west, to_west, cap, end, *cells)
            found |= _link(number, 1, at_east, to_east, cap, end, *cells)
            found |= _link(number, 2, at_north, to_north, cap, end, *cells)
            coarser[number] = found | _link(number, 3, at_south, to_south, cap, end, *cells)
            own = weights[number]
            leaving[number] = (own[0] + own[1]) + (own[2] + own[3])


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _link(number, side, other, flow, cap, end, mass, neighbours, weights):
    there = other >= 0
    beside, own = np.uintp(other) if there else number, mass[number]
    neighbours[number, side] = beside
    weights[number, side] = min(flow, cap * min(own, mass[beside])) / own if there else flow - flow
    return np.uint8((other >= end) & (flow > 0)) << np.uint8(side)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _turned(coarser, neighbours, weights, mass, start, leaving):
    """See ``LinksBack``. What leaves coarser cells by these links is added to what leaves them by others."""
    most, count = 4 * np.count_nonzero(coarser), 0
    links, others, flows = np.empty(most, np.uint32), np.empty(most, np.uint32), np.empty(most, mass.dtype)
    first = np.zeros(len(mass) - start + 1, np.int64)
    for number in range(len(coarser)):
        if coarser[number]:
            for side in range(4):
                if coarser[number] >> side & 1:
                    other = neighbours[number, side] - start
                    links[count], others[count], flows[count] = number, other, weights[number, side] * mass[number]
                    first[other + 1] += 1
                    count += 1
    first[:] = np.cumsum(first)
    place, finer, rates = first.copy(), np.empty(count, np.uint32), np.empty(count, mass.dtype)
    for link in range(count):
        other = others[link]
        k = place[other]
        finer[k], rates[k] = links[link], flows[link] / mass[start + other]
        leaving[other] += rates[k]
        place[other] = k + 1
    return first, finer, rates, leaving
