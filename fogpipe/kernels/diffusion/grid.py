"""Grids of cells that fit the scales: where the rate jumps, no coarse cell joins both sides.

Light moves between neighbouring cells of mass m by conductances G across their common face, dF/dt = Σ G ΔF / m. Pixels
have the mass 1 and the conductance ϱ, the mean of both sides. A level diffuses at rates G/m of ``clip`` at most. What
is above that is left to the next level, whose cells join those of two by two cells that have any of it: the *mobile*
ones. The mass of a cell is the number of its pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands


class Level(NamedTuple):
    """Cells (H, W) of a level and what it may move.

    Attributes
    ----------
    mass : pixels in a cell; 0 for none.
    east, south : conductances to the next column and row, in px² per unit of time; 0 in the last one.
    clip : largest rate G/m of this level.
    mobile : mass of a cell where some rate is above the clip, else 0.
    """

    mass: FloatArray
    east: FloatArray
    south: FloatArray
    clip: float
    mobile: FloatArray


def finest_level(scale: FloatArray, finest: float, time: float, clip: float) -> Level:
    """The pixels: ϱ = (σ² − σ0²)/2 at the centres, for a stretch of the unit of time."""
    rows, columns = scale.shape
    east, south = np.empty_like(scale), np.empty_like(scale)
    real = scale.dtype.type
    in_bands(_faces, rows, columns, scale, real(finest), real(time), east, south)
    return _level(np.ones_like(scale), east, south, clip)


def coarser_level(level: Level, clip: float) -> Level:
    """Cells of two by two mobile cells, with the conductances that the level leaves over.

    Resistances 1/G add along the way between the centres of mass of two cells, conductances side by side.
    """
    rows, columns = ((size + 1) // 2 for size in level.mass.shape)
    dtype = level.mass.dtype
    mass, east, south = (np.empty((rows, columns), dtype) for _ in range(3))
    limit = dtype.type(level.clip)
    in_bands(_coarse_mass, rows, columns, level.mobile, mass)
    in_bands(_coarse_east, rows, columns, level.east, level.mass, level.mobile, limit, east)
    in_bands(_coarse_south, rows, columns, level.south, level.mass, level.mobile, limit, south)
    return _level(mass, east, south, clip)


def averages(layer: FloatArray, level: Level) -> FloatArray:
    """Means (H/2, W/2, 4) of a layer over the mobile cells of two by two; 0 where there are none."""
    rows, columns = ((size + 1) // 2 for size in level.mass.shape)
    coarse = np.empty((rows, columns, layer.shape[2]), layer.dtype)
    in_bands(_averages, rows, 4 * columns, layer, level.mobile, coarse)
    return coarse


def sharpened(added: FloatArray, level: Level) -> FloatArray:
    """What is added to cells (H, W, 4), so that means over two by two of it come out right.

    Taking means and giving each cell its mean dampens a wave of k radians per fine cell by cos²(k/2) ≈ 1 − k²/4; a
    sixteenth of the second difference, between cells that light connects, makes up for it.
    """
    after = np.empty_like(added)
    in_bands(_sharpened, added.shape[0], 4 * added.shape[1], added, level.mass, level.east, level.south, after)
    return after


def _level(mass: FloatArray, east: FloatArray, south: FloatArray, clip: float) -> Level:
    mobile = np.empty_like(mass)
    in_bands(_mobile, *mass.shape, mass, east, south, mass.dtype.type(clip), mobile)
    return Level(mass, east, south, clip, mobile)


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
def _mobile(first, last, mass, east, south, clip, mobile):
    rows, columns = mass.shape
    zero = mass.dtype.type(0)
    for y in range(first, last):
        above, below = max(y - 1, 0), min(y + 1, rows - 1)
        out, here = mobile[y], mass[y]
        # What each of the four faces has above the clip; a border has no face.
        for x in range(columns):
            out[x] = max(
                south[y, x] - clip * min(here[x], mass[below, x]),
                (south[above, x] - clip * min(here[x], mass[above, x])) if y else zero,
            )
        for x in range(columns - 1):
            out[x] = max(out[x], east[y, x] - clip * min(here[x], here[x + 1]))
        for x in range(columns - 1, 0, -1):
            out[x] = max(out[x], east[y, x - 1] - clip * min(here[x], here[x - 1]))
        for x in range(columns):
            out[x] = here[x] if out[x] > zero else zero


@numba.njit(nogil=True, cache=True)
def _coarse_mass(first, last, mobile, mass):
    rows, columns = mobile.shape
    for y in range(first, last):
        for x in range(mass.shape[1]):
            total = mobile[2 * y, 2 * x]
            if 2 * x + 1 < columns:
                total += mobile[2 * y, 2 * x + 1]
            if 2 * y + 1 < rows:
                total += mobile[2 * y + 1, 2 * x]
                if 2 * x + 1 < columns:
                    total += mobile[2 * y + 1, 2 * x + 1]
            mass[y, x] = total


@numba.njit(nogil=True, cache=True)
def _coarse_east(first, last, fine, mass, mobile, clip, coarse):
    rows, columns = fine.shape
    zero = mass.dtype.type(0)
    for y in range(first, last):
        coarse[y, :] = zero
        for j in range(2 * y, min(2 * y + 2, rows)):
            flow, m, moving = fine[j], mass[j], mobile[j]
            for x in range((columns - 1) // 2):
                a, b, c = 2 * x, 2 * x + 1, 2 * x + 2
                d = min(2 * x + 3, columns - 1)
                middle = flow[b] - clip * min(m[b], m[c])
                if middle > zero:
                    before = flow[a] - clip * min(m[a], m[b])
                    after = flow[c] - clip * min(m[c], m[d])
                    last_mass = moving[d] if d > c else zero
                    coarse[y, x] += _in_series(moving[a], before, moving[b], middle, moving[c], after, last_mass)


@numba.njit(nogil=True, cache=True)
def _coarse_south(first, last, fine, mass, mobile, clip, coarse):
    rows, columns = fine.shape
    zero = mass.dtype.type(0)
    for y in range(first, last):
        coarse[y, :] = zero
        a, b, c = 2 * y, 2 * y + 1, 2 * y + 2
        if c >= rows:
            continue
        d = min(2 * y + 3, rows - 1)
        for x in range(columns):
            middle = fine[b, x] - clip * min(mass[b, x], mass[c, x])
            if middle > zero:
                before = fine[a, x] - clip * min(mass[a, x], mass[b, x])
                after = fine[c, x] - clip * min(mass[c, x], mass[d, x])
                last_mass = mobile[d, x] if d > c else zero
                coarse[y, x // 2] += _in_series(
                    mobile[a, x], before, mobile[b, x], middle, mobile[c, x], after, last_mass
                )


@numba.njit(nogil=True, inline="always")
def _in_series(a, before, b, middle, c, after, d):
    """Conductance from the centre of mass of cells a and b to that of c and d, across three faces."""
    # A wall inside a pair of cells that both are mobile lets nothing through.
    if (a > 0 and before <= 0) or (d > 0 and after <= 0):
        return middle - middle
    before, after = (before if a > 0 else middle), (after if d > 0 else middle)
    product = before * after
    return middle * product / (product + middle * (a / (a + b) * after + d / (c + d) * before))


@numba.njit(nogil=True, cache=True)
def _averages(first, last, layer, mobile, coarse):
    rows, columns = mobile.shape
    size = coarse.shape[1]
    zero, one = mobile.dtype.type(0), mobile.dtype.type(1)
    for y in range(first, last):
        upper, lower = layer[2 * y], layer[min(2 * y + 1, rows - 1)]
        mass_above, mass_below = mobile[2 * y], mobile[min(2 * y + 1, rows - 1)]
        inside = one if 2 * y + 1 < rows else zero
        for x in range(size):
            left, right = 2 * x, min(2 * x + 1, columns - 1)
            beside = one if 2 * x + 1 < columns else zero
            a, b = mass_above[left], mass_above[right] * beside
            c, d = mass_below[left] * inside, mass_below[right] * inside * beside
            inverse = one / max(a + b + c + d, one)
            for k in range(4):
                coarse[y, x, k] = inverse * (
                    a * upper[left, k] + b * upper[right, k] + c * lower[left, k] + d * lower[right, k]
                )


@numba.njit(nogil=True, cache=True)
def _sharpened(first, last, added, mass, east, south, after):
    rows, columns = mass.shape
    zero, sixteenth = mass.dtype.type(0), mass.dtype.type(1 / 16)
    for y in range(first, last):
        above, below = max(y - 1, 0), min(y + 1, rows - 1)
        for x in range(columns):
            left, right = max(x - 1, 0), min(x + 1, columns - 1)
            m = mass[y, x]
            share = sixteenth / m if m > zero else zero
            to_west = share * min(m, mass[y, left]) if east[y, left] > zero and x > 0 else zero
            to_east = share * min(m, mass[y, right]) if east[y, x] > zero else zero
            to_north = share * min(m, mass[above, x]) if south[above, x] > zero and y > 0 else zero
            to_south = share * min(m, mass[below, x]) if south[y, x] > zero else zero
            for k in range(4):
                here = added[y, x, k]
                after[y, x, k] = here - (
                    to_west * (added[y, left, k] - here)
                    + to_east * (added[y, right, k] - here)
                    + to_north * (added[above, x, k] - here)
                    + to_south * (added[below, x, k] - here)
                )
