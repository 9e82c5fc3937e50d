"""What moves between joined cells: resistances 1/G add along the way between centres, conductances side by side."""

from __future__ import annotations

import numba
import numpy as np

from fogpipe.kernels.diffusion.rows import end_of_run, face, flags, mass_of, next_flag, rate_of

WEAK = 0.1
"""A face inside a cell that is this much weaker than the one beside it has a way round it."""

_ONE, _TWO = np.uintp(1), np.uintp(2)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def coarsen(first, last, scale, finest, mass, east, south, joined, whole, full, blur, least, coarse_east, coarse_south):
    """Resistances 1/G add along the way between the centres of joined cells, conductances side by side.

    Most cells have ``full`` mass, as those beside them: these are done in runs, of which the compiler makes vectors.
    """
    rows, columns = joined.shape
    (alike, alike_eights), (others, eights) = flags(columns), flags(columns)
    room = np.empty((5, scale.shape[1]), scale.dtype)
    for y in range(first, last):
        _sort(whole[y], whole[min(y + 1, rows - 1)], full if y + 1 < rows else -full, alike, others)
        coarse_east[y], coarse_south[y] = 0, 0
        x = next_flag(0, alike, alike_eights)
        while x < columns:
            end = end_of_run(x, alike, alike_eights)
            if scale.size:
                _among_pixels(y, x, end, scale, finest, blur, least, room, coarse_east, coarse_south)
            else:
                _along(y, x, end, east, blur, least, coarse_east)
                _down(y, x, end, south, blur, least, coarse_south)
            x = next_flag(end, alike, alike_eights)
        x = next_flag(0, others, eights)
        while x < columns:
            part = joined[y, x]
            if x + 1 < columns:
                flow = _to_east(y, x, part, joined[y, x + 1], scale, finest, mass, east)
                coarse_east[y, x] = max(flow - blur, least * flow)
            if y + 1 < rows:
                flow = _to_south(y, x, part, joined[y + 1, x], scale, finest, mass, south)
                coarse_south[y, x] = max(flow - blur, least * flow)
            x = next_flag(x + 1, others, eights)


@numba.njit(nogil=True, cache=True)
def _sort(ours, beneath, full, alike, others):
    """Cells that are whole as those to the east and south are, none in the last column; and the other joined ones."""
    last = np.uintp(len(ours) - 1)
    for x in range(last):
        every = (ours[x] == full) & (ours[x + _ONE] == full) & (beneath[x] == full)
        alike[x], others[x] = every, (ours[x] > 0) ^ every
    others[last] = ours[last] > 0


@numba.njit(nogil=True, cache=True, fastmath={"contract"}, error_model="numpy")
def _among_pixels(y, x, end, scale, finest, blur, least, room, coarse_east, coarse_south):
    """Of whole cells of two by two pixels in a row. Conductances are sums of two halves of rates."""
    half, row, j = type(finest)(0.5), np.uintp(y), _TWO * np.uintp(y)
    first, last = _TWO * np.uintp(x), _TWO * np.uintp(end)
    upper, lower, below, beyond, flows = room[0], room[1], room[2], room[3], room[4]
    for k in range(np.uintp(4)):
        for i in range(first, last + _TWO):
            room[k, i] = half * rate_of(scale[j + k, i], finest)
    for i in range(first, last):
        flows[i] = _in_line(upper[i] + lower[i], lower[i] + below[i], below[i] + beyond[i])
    for cell in range(np.uintp(x), np.uintp(end)):
        flow = flows[_TWO * cell] + flows[_TWO * cell + _ONE]
        coarse_south[row, cell] = max(flow - blur, least * flow)
    for cell in range(np.uintp(x), np.uintp(end)):
        i = _TWO * cell
        k, m, n = i + _ONE, i + _TWO, i + _TWO + _ONE
        flow = _in_line(upper[i] + upper[k], upper[k] + upper[m], upper[m] + upper[n])
        flow += _in_line(lower[i] + lower[k], lower[k] + lower[m], lower[m] + lower[n])
        coarse_east[row, cell] = max(flow - blur, least * flow)


@numba.njit(nogil=True, cache=True, fastmath={"contract"}, error_model="numpy")
def _along(y, x, end, east, blur, least, coarse_east):
    """To the east of cells of two by two, of which all have the same mass."""
    row, upper, lower = np.uintp(y), _TWO * np.uintp(y), _TWO * np.uintp(y) + _ONE
    for cell in range(np.uintp(x), np.uintp(end)):
        i = _TWO * cell
        flow = _in_line(east[upper, i], east[upper, i + _ONE], east[upper, i + _TWO])
        flow += _in_line(east[lower, i], east[lower, i + _ONE], east[lower, i + _TWO])
        coarse_east[row, cell] = max(flow - blur, least * flow)


@numba.njit(nogil=True, cache=True, fastmath={"contract"}, error_model="numpy")
def _down(y, x, end, south, blur, least, coarse_south):
    row, upper, lower, below = np.uintp(y), _TWO * np.uintp(y), _TWO * np.uintp(y) + _ONE, _TWO * np.uintp(y) + _TWO
    for cell in range(np.uintp(x), np.uintp(end)):
        i = _TWO * cell
        flow = _in_line(south[upper, i], south[lower, i], south[below, i])
        flow += _in_line(south[upper, i + _ONE], south[lower, i + _ONE], south[below, i + _ONE])
        coarse_south[row, cell] = max(flow - blur, least * flow)


@numba.njit(nogil=True, fastmath={"contract"}, error_model="numpy", inline="always")
def _in_line(before, middle, after):
    """Conductance across three faces in a line, between the centres of two and two cells of the same mass."""
    half, none = np.float32(0.5), middle - middle
    to_before, to_after = (none if before < WEAK * middle else half), (none if after < WEAK * middle else half)
    before, after = (middle if before < WEAK * middle else before), (middle if after < WEAK * middle else after)
    product = before * after
    flow = middle * product / (product + middle * (to_before * after + to_after * before))
    return flow if middle > 0 else none


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _to_east(y, x, part, beside, scale, finest, mass, east):
    """Between a cell with parts missing, or next to one, and that to its east."""
    flow, i, none = mass.dtype.type(0), 2 * x, mass.dtype.type(0)
    for lower in range(2):
        ours, other, j = part >> 2 * lower, beside >> 2 * lower, 2 * y + lower
        if ours & 2 and other & 1:
            a = mass_of(j, i, mass) if ours & 1 else none
            d = mass_of(j, i + 3, mass) if other & 2 else none
            after = face(j, i + 2, j, i + 3, scale, finest, east) if other & 2 else none
            faces = face(j, i, j, i + 1, scale, finest, east), face(j, i + 1, j, i + 2, scale, finest, east), after
            flow += _in_series(a, mass_of(j, i + 1, mass), mass_of(j, i + 2, mass), d, faces)
    return flow


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _to_south(y, x, part, below, scale, finest, mass, south):
    flow, j, none = mass.dtype.type(0), 2 * y, mass.dtype.type(0)
    for right in range(2):
        ours, other, i = part >> right, below >> right, 2 * x + right
        if ours & 4 and other & 1:
            a = mass_of(j, i, mass) if ours & 1 else none
            d = mass_of(j + 3, i, mass) if other & 4 else none
            after = face(j + 2, i, j + 3, i, scale, finest, south) if other & 4 else none
            faces = face(j, i, j + 1, i, scale, finest, south), face(j + 1, i, j + 2, i, scale, finest, south), after
            flow += _in_series(a, mass_of(j + 1, i, mass), mass_of(j + 2, i, mass), d, faces)
    return flow


@numba.njit(nogil=True, cache=True, fastmath={"contract"}, error_model="numpy")
def _in_series(a, b, c, d, faces):
    """Conductance from the centre of mass of cells a and b to that of c and d, across three faces; a, d 0 for none."""
    before, middle, after = faces
    if middle <= 0:
        return middle - middle
    if before < WEAK * middle:
        before, a = middle, a - a
    if after < WEAK * middle:
        after, d = middle, d - d
    product = before * after
    return middle * product / (product + middle * (a / (a + b) * after + d / (c + d) * before))
