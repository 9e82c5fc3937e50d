"""A hierarchy of cells that fit the scales: large where the blur is wide, never on both sides of a wall.

Light moves between neighbouring cells of mass m by conductances G across their common face, dF/dt = Σ G ΔF / m. Pixels
have the mass 1 and the conductance ϱ, the mean of both sides. A face is *strong* if it would even out the smaller of
its cells many times over, G > clip · m. Of two by two cells, those which strong faces connect are joined to one cell of
the next level: what they hold is soon alike. The others stay as they are, however much is blurred beside them.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

LEAST_SHARE = 0.25
"""Part of its square that a cell must fill to be joined again: the tip of something else would only drag it along."""
WEAK = 0.1
"""A face inside a cell that is this much weaker than the one beside it has a way round it."""

BLUR = 0.5
"""What means over two cells and interpolation between such means blur, as ϱ, in squares of the smaller cells."""
LEAST_LEFT = 0.4
"""Of a conductance, when that is taken off it."""


class Level(NamedTuple):
    """Cells (H, W) of 2^k pixels across.

    Attributes
    ----------
    mass : pixels in a cell; 0 for none.
    east, south : conductances to the next column and row, in px² per unit of time; 0 in the last one.
    joined : (H/2, W/2) uint8, which of two by two cells are joined to one of the next level: 1, 2, 4, 8 by rows.
    alone : the same of those that are not.
    """

    mass: FloatArray
    east: FloatArray
    south: FloatArray
    joined: np.ndarray
    alone: np.ndarray


def conductances(scale: FloatArray, finest: float, time: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """To the east and south of each pixel, the mean of ϱ = (σ² − σ0²)/2 of both sides, for a stretch of the time."""
    rows, columns = scale.shape
    east, south = np.empty_like(scale), np.empty_like(scale)
    real = scale.dtype.type
    in_bands(_faces, rows, columns, scale, real(finest), real(time), east, south)
    return east, south


def hierarchy(east: FloatArray, south: FloatArray, clip: float) -> list[Level]:
    """Levels of cells, beginning with the pixels, until nothing is left to join."""
    mass = np.ones_like(east)
    levels: list[Level] = []
    while True:
        joined, alone = _joined(mass, east, south, clip, LEAST_SHARE * 4 ** len(levels))
        levels.append(Level(mass, east, south, joined, alone))
        if not joined.any():
            return levels
        coarse = [np.empty(joined.shape, mass.dtype) for _ in range(3)]
        blur, least = mass.dtype.type(BLUR * 4 ** (len(levels) - 1)), mass.dtype.type(max(1 - BLUR / clip, LEAST_LEFT))
        in_bands(_coarsen, *joined.shape, mass, east, south, joined, blur, least, *coarse)
        mass, east, south = coarse


def _joined(
    mass: FloatArray, east: FloatArray, south: FloatArray, clip: float, least: float
) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = mass.shape
    real = mass.dtype.type
    joined, alone = (np.empty(((rows + 1) // 2, (columns + 1) // 2), np.uint8) for _ in range(2))
    strong = np.zeros(mass.shape, np.uint8)
    if min(rows, columns) > 2:
        in_bands(_strong, rows, columns, mass, east, south, real(clip), strong)
    in_bands(_join, *joined.shape, strong, mass, real(least), joined, alone)
    return joined, alone


@numba.njit(nogil=True, cache=True)
def _faces(first, last, scale, finest, time, east, south):
    rows, columns = scale.shape
    quarter = time * scale.dtype.type(0.25)
    twice = finest * finest + finest * finest
    for y in range(first, last):
        here, below = scale[y], scale[min(y + 1, rows - 1)]
        for x in range(columns - 1):
            east[y, x] = quarter * (here[x] * here[x] + here[x + 1] * here[x + 1] - twice)
        east[y, columns - 1] = 0
        for x in range(columns):
            south[y, x] = quarter * (here[x] * here[x] + below[x] * below[x] - twice)
        if y == rows - 1:
            south[y, :] = 0


@numba.njit(nogil=True, cache=True)
def _strong(first, last, mass, east, south, clip, strong):
    """1 for a strong face to the east, 2 for one to the south."""
    rows, columns = mass.shape
    for y in range(first, last):
        here, below, out = mass[y], mass[min(y + 1, rows - 1)], strong[y]
        across, down = east[y], south[y]
        for x in range(columns):
            out[x] = 2 if down[x] > clip * min(here[x], below[x]) else 0
        for x in range(columns - 1):
            out[x] += 1 if across[x] > clip * min(here[x], here[x + 1]) else 0


@numba.njit(nogil=True, cache=True)
def _join(first, last, strong, mass, least, joined, alone):
    """Of each two by two cells with a strong face, those that such faces connect: the most mass, if not all."""
    rows, columns = strong.shape
    for y in range(first, last):
        upper, lower = 2 * y, min(2 * y + 1, rows - 1)
        below = 2 * y + 1 < rows
        for x in range(joined.shape[1]):
            left, right = 2 * x, min(2 * x + 1, columns - 1)
            beside = 2 * x + 1 < columns
            m0, m1, m2, m3 = mass[upper, left], mass[upper, right], mass[lower, left], mass[lower, right]
            a, b = strong[upper, left], strong[upper, right]
            c, d = strong[lower, left], strong[lower, right]
            if a == 3 and b & 2 and c & 1 and min(min(m0, m1), min(m2, m3)) >= least:
                joined[y, x], alone[y, x] = 15, 0
                continue
            there = 1 if m0 > 0 else 0
            there |= 2 if m1 > 0 and beside else 0
            there |= 4 if m2 > 0 and below else 0
            there |= 8 if m3 > 0 and beside and below else 0
            # Faces to the west and north belong to the cells there.
            touched = (1 if a else 0) | (2 if b | (a & 1) else 0) | (4 if c | (a & 2) else 0)
            touched |= 8 if d | (c & 1) | (b & 2) else 0
            if x:
                touched |= (strong[upper, left - 1] & 1) | (strong[lower, left - 1] & 1) << 2
            if y:
                touched |= (strong[upper - 1, left] & 2) >> 1 | (strong[upper - 1, right] & 2)
            heavy = (1 if m0 >= least else 0) | (2 if m1 >= least else 0) | (4 if m2 >= least else 0)
            heavy |= 8 if m3 >= least else 0
            able = there & touched & heavy
            best, most = 0, mass.dtype.type(-1)
            while able:
                part = _connected(able, a & 1, c & 1, a & 2, b & 2)
                total = mass.dtype.type(0)
                total += m0 if part & 1 else 0
                total += m1 if part & 2 else 0
                total += m2 if part & 4 else 0
                total += m3 if part & 8 else 0
                if total > most:
                    best, most = part, total
                able &= ~part
            joined[y, x], alone[y, x] = best, there & ~best


@numba.njit(nogil=True, cache=True)
def _connected(able, upper, lower, left, right):
    """The first of the able cells and those that it reaches by the four faces between them."""
    part = able & -able
    for _ in range(2):
        if upper and part & 3:
            part |= able & 3
        if lower and part & 12:
            part |= able & 12
        if left and part & 5:
            part |= able & 5
        if right and part & 10:
            part |= able & 10
    return part


@numba.njit(nogil=True, cache=True)
def _coarsen(first, last, mass, east, south, joined, blur, least, coarse_mass, coarse_east, coarse_south):
    """Mass of the joined cells; resistances 1/G add along the way between their centres, conductances side by side."""
    rows, columns = joined.shape
    zero = mass.dtype.type(0)
    for y in range(first, last):
        j = 2 * y
        for x in range(columns):
            part, i = joined[y, x], 2 * x
            beside = joined[y, x + 1] if x + 1 < columns else np.uint8(0)
            below = joined[y + 1, x] if y + 1 < rows else np.uint8(0)
            a, b = mass[j, i] if part & 1 else zero, mass[j, i + 1] if part & 2 else zero
            c, d = mass[j + 1, i] if part & 4 else zero, mass[j + 1, i + 1] if part & 8 else zero
            coarse_mass[y, x] = a + b + c + d
            flow = zero
            if part & 2 and beside & 1:
                far = mass[j, i + 3] if beside & 2 else zero
                flow += _in_series(a, east[j, i], b, east[j, i + 1], mass[j, i + 2], east[j, i + 2], far)
            if part & 8 and beside & 4:
                far = mass[j + 1, i + 3] if beside & 8 else zero
                flow += _in_series(
                    c, east[j + 1, i], d, east[j + 1, i + 1], mass[j + 1, i + 2], east[j + 1, i + 2], far
                )
            coarse_east[y, x] = max(flow - blur, least * flow)
            flow = zero
            if part & 4 and below & 1:
                far = mass[j + 3, i] if below & 4 else zero
                flow += _in_series(a, south[j, i], c, south[j + 1, i], mass[j + 2, i], south[j + 2, i], far)
            if part & 8 and below & 2:
                far = mass[j + 3, i + 1] if below & 8 else zero
                flow += _in_series(
                    b, south[j, i + 1], d, south[j + 1, i + 1], mass[j + 2, i + 1], south[j + 2, i + 1], far
                )
            coarse_south[y, x] = max(flow - blur, least * flow)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _in_series(a, before, b, middle, c, after, d):
    """Conductance from the centre of mass of cells a and b to that of c and d, across three faces; a, d 0 for none."""
    if middle <= 0:
        return middle - middle
    if before < WEAK * middle:
        before, a = middle, a - a
    if after < WEAK * middle:
        after, d = middle, d - d
    product = before * after
    if a == b and c == d:
        half = np.float32(0.5)
        return middle * product / (product + half * middle * (after + before))
    return middle * product / (product + middle * (a / (a + b) * after + d / (c + d) * before))
