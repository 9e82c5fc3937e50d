"""Which cells are joined to one of the next level.

A face is *strong* if it would even out the smaller of its cells many times over, G > clip · m. Of two by two cells,
those which strong faces connect are joined: what they hold is soon alike.
"""

from __future__ import annotations

import numba
import numpy as np

from fogpipe.kernels.diffusion.rows import flags, mean_rate, next_flag

_ONE, _TWO = np.uintp(1), np.uintp(2)


@numba.njit(nogil=True, cache=True)
def join(first, last, scale, finest, mass, east, south, clip, least, joined, alone, coarse_mass):
    """Of each two by two cells with a strong face, those that such faces connect: the most mass, if not all."""
    pixels, width = scale.size > 0, 2 * joined.shape[1] + 2
    rows, columns = scale.shape if pixels else mass.shape
    upper, lower = np.zeros(width, mass.dtype), np.zeros(width, mass.dtype)  # no mass behind the last column
    above, ours, beneath = np.zeros(width, np.uint8), np.zeros(width, np.uint8), np.zeros(width, np.uint8)
    mixed, eights = flags(joined.shape[1])
    level = scale, finest, mass, east, south, clip
    upper[:columns] = lower[:columns] = 1
    if first > 0:
        _strong_faces(2 * first - 1, *level, beneath)
    for y in range(first, last):
        above, beneath = beneath, above
        _strong_faces(2 * y, *level, ours)
        _strong_faces(2 * y + 1, *level, beneath)
        faces, found = (above, ours, beneath), (joined[y], alone[y], coarse_mass[y], mixed)
        if pixels and 2 * y + 1 < rows:
            _join_pixels(*faces, *found)
        else:
            _load_masses(2 * y, scale, mass, upper)
            _load_masses(2 * y + 1, scale, mass, lower)
            _join_all_or_none(upper, lower, *faces, least, *found)
        x = next_flag(0, mixed, eights)
        while x < joined.shape[1]:
            left, right = 2 * x, 2 * x + 1
            m0, m1, m2, m3 = upper[left], upper[right], lower[left], lower[right]
            a, b, c, d = ours[left], ours[right], beneath[left], beneath[right]
            there = (1 if m0 > 0 else 0) | (2 if m1 > 0 else 0) | (4 if m2 > 0 else 0) | (8 if m3 > 0 else 0)
            # Faces to the west and north belong to the cells there.
            touched = (1 if a else 0) | (2 if b | (a & 1) else 0) | (4 if c | (a & 2) else 0)
            touched |= 8 if d | (c & 1) | (b & 2) else 0
            if x:
                touched |= (ours[left - 1] & 1) | (beneath[left - 1] & 1) << 2
            if y:
                touched |= (above[left] & 2) >> 1 | (above[right] & 2)
            heavy = (1 if m0 >= least else 0) | (2 if m1 >= least else 0) | (4 if m2 >= least else 0)
            heavy |= 8 if m3 >= least else 0
            able = there & touched & heavy
            best, most = 0, mass.dtype.type(0)
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
            joined[y, x], alone[y, x], coarse_mass[y, x] = best, there & ~best, most
            x = next_flag(x + 1, mixed, eights)


@numba.njit(nogil=True, cache=True)
def _load_masses(y, scale, mass, masses):
    """Of a row of cells; 0 beyond the last one."""
    if y >= max(len(scale), len(mass)):
        masses[:] = 0
    elif scale.size:
        masses[: scale.shape[1]] = 1
    else:
        masses[: mass.shape[1]] = mass[y]


@numba.njit(nogil=True, cache=True)
def _strong_faces(y, scale, finest, mass, east, south, clip, strong):
    """Of the cells of a row, 1 for a strong face to the east, 2 for one to the south, 3 for both."""
    rows = len(scale) if scale.size else len(mass)
    if y >= rows:
        strong[:] = 0
    elif scale.size:
        _strong_of_pixels(scale[y], scale[min(y + 1, rows - 1)], finest, clip, strong)
    else:
        _strong_of_cells(mass[y], mass[min(y + 1, rows - 1)], east[y], south[y], clip, strong)
    if y == rows - 1:
        for x in range(np.uintp(len(strong))):
            strong[x] &= np.uint8(1)


@numba.njit(nogil=True, cache=True)
def _strong_of_pixels(here, below, finest, clip, strong):
    last = np.uintp(len(here) - 1)
    for x in range(last):
        to_east = mean_rate(here[x], here[x + _ONE], finest) > clip
        to_south = mean_rate(here[x], below[x], finest) > clip
        strong[x] = np.uint8(to_east) | np.uint8(to_south) << np.uint8(1)
    strong[last] = np.uint8(mean_rate(here[last], below[last], finest) > clip) << np.uint8(1)


@numba.njit(nogil=True, cache=True)
def _strong_of_cells(here, below, across, down, clip, strong):
    last = np.uintp(len(here) - 1)
    for x in range(last):
        to_east = across[x] > clip * min(here[x], here[x + _ONE])
        to_south = down[x] > clip * min(here[x], below[x])
        strong[x] = np.uint8(to_east) | np.uint8(to_south) << np.uint8(1)
    strong[last] = np.uint8(down[last] > clip * min(here[last], below[last])) << np.uint8(1)


@numba.njit(nogil=True, cache=True)
def _faces(above, ours, beneath, i):
    """Whether strong faces connect all of two by two cells, and whether any of these has one."""
    one, two, three = np.uint8(1), np.uint8(2), np.uint8(3)
    connected = ours[i] & (ours[i + _ONE] | one) & (beneath[i] << one | one) == three
    touched = ours[i] | ours[i + _ONE] | beneath[i] | beneath[i + _ONE] | ((above[i] | above[i + _ONE]) & two)
    return connected, (touched | ((ours[i - _ONE] | beneath[i - _ONE]) & one)) > np.uint8(0)


@numba.njit(nogil=True, cache=True)
def _join_pixels(above, ours, beneath, joined, alone, coarse_mass, mixed):
    """As below, where every cell is there and has the mass of a pixel."""
    none, all_four = np.uint8(0), np.uint8(15)
    for x in range(_ONE, np.uintp(len(joined))):
        i = _TWO * x
        every, touched = _faces(above, ours, beneath, i)
        mixed[x] = touched & ~every
        joined[x], alone[x] = (all_four if every else none), (none if every else all_four)
        coarse_mass[x] = coarse_mass.dtype.type(4) if every else coarse_mass.dtype.type(0)
    joined[0], mixed[0], mixed[len(joined) - 1] = none, 1, 1  # no cells to the west, or maybe to the east


@numba.njit(nogil=True, cache=True)
def _join_all_or_none(upper, lower, above, ours, beneath, least, joined, alone, coarse_mass, mixed):
    """Those of a row of two by two cells that can all be joined, or that have no strong face; ``mixed`` are others."""
    none, one, two, three = np.uint8(0), np.uint8(1), np.uint8(2), np.uint8(3)
    joined[0], mixed[0] = none, True  # it has no cells to its west
    for x in range(_ONE, np.uintp(len(joined))):
        i = _TWO * x
        a, b, c, d = upper[i], upper[i + _ONE], lower[i], lower[i + _ONE]
        connected, touched = _faces(above, ours, beneath, i)
        every = connected & (min(min(a, b), min(c, d)) >= least)
        there = np.uint8(a > 0) | np.uint8(b > 0) << one | np.uint8(c > 0) << two | np.uint8(d > 0) << three
        mixed[x] = touched & ~every
        joined[x] = np.uint8(15) if every else none
        alone[x] = none if every else there
        coarse_mass[x] = (a + b) + (c + d) if every else upper.dtype.type(0)


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
