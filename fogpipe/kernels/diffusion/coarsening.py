"""What moves between joined cells: resistances 1/G add along the way between centres, conductances side by side."""

from __future__ import annotations

import numba
import numpy as np

from fogpipe.kernels.diffusion.rows import end_of_run, flags, four_rows, load_row, next_flag

WEAK = 0.1
"""A face inside a cell that is this much weaker than the one beside it has a way round it."""

_ONE, _TWO = np.uintp(1), np.uintp(2)


@numba.njit(nogil=True, cache=True, error_model="numpy")
def coarsen(first, last, rate, mass, east, south, joined, whole, full, blur, least, coarse_east, coarse_south):
    """Resistances 1/G add along the way between the centres of joined cells, conductances side by side.

    Most cells have ``full`` mass, as those beside them: these are done in runs, of which the compiler makes vectors.
    """
    rows, columns = joined.shape
    width = 2 * columns + 2
    masses, across, down = four_rows(width, rate, mass)
    level = rate, mass, east, south
    (alike, alike_eights), (others, eights), zero = flags(columns), flags(columns), mass.dtype.type(0)
    for row in range(2 * first, 2 * first + 2):
        load_row(row, *level, masses, across, down)
    for y in range(first, last):
        for row in range(2 * y + 2, 2 * y + 4):
            load_row(row, *level, masses, across, down)
        one, three = 2 * y & 3, 2 * y + 2 & 3
        two, four = one + 1, three + 1
        _sort(whole[y], whole[min(y + 1, rows - 1)], full if y + 1 < rows else -full, alike, others)
        coarse_east[y], coarse_south[y] = 0, 0
        x = next_flag(0, alike, alike_eights)
        while x < columns:
            end = end_of_run(x, alike, alike_eights)
            run = slice(2 * x, 2 * end + 1)
            _along(across[one, run], across[two, run], blur, least, coarse_east[y, x:end])
            _down(down[one, run], down[two, run], down[three, run], blur, least, coarse_south[y, x:end])
            x = next_flag(end, alike, alike_eights)
        x = next_flag(0, others, eights)
        while x < columns:
            i, part = 2 * x, joined[y, x]
            beside = joined[y, x + 1] if x + 1 < columns else np.uint8(0)
            below = joined[y + 1, x] if y + 1 < rows else np.uint8(0)
            a, b = masses[one, i] if part & 1 else zero, masses[one, i + 1] if part & 2 else zero
            c, d = masses[two, i] if part & 4 else zero, masses[two, i + 1] if part & 8 else zero
            flow = zero
            if part & 2 and beside & 1:
                far = masses[one, i + 3] if beside & 2 else zero
                faces = across[one, i], across[one, i + 1], across[one, i + 2]
                flow += _in_series(a, b, masses[one, i + 2], far, faces)
            if part & 8 and beside & 4:
                far = masses[two, i + 3] if beside & 8 else zero
                faces = across[two, i], across[two, i + 1], across[two, i + 2]
                flow += _in_series(c, d, masses[two, i + 2], far, faces)
            coarse_east[y, x] = max(flow - blur, least * flow)
            flow = zero
            if part & 4 and below & 1:
                far = masses[four, i] if below & 4 else zero
                flow += _in_series(a, c, masses[three, i], far, (down[one, i], down[two, i], down[three, i]))
            if part & 8 and below & 2:
                far, i = masses[four, i + 1] if below & 8 else zero, i + 1
                flow += _in_series(b, d, masses[three, i], far, (down[one, i], down[two, i], down[three, i]))
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
def _along(upper, lower, blur, least, coarse):
    """To the east of cells of two by two, of which all have the same mass."""
    for x in range(np.uintp(len(coarse))):
        i = _TWO * x
        flow = _in_line(upper[i], upper[i + _ONE], upper[i + _TWO])
        flow += _in_line(lower[i], lower[i + _ONE], lower[i + _TWO])
        coarse[x] = max(flow - blur, least * flow)


@numba.njit(nogil=True, cache=True, fastmath={"contract"}, error_model="numpy")
def _down(upper, middle, lower, blur, least, coarse):
    for x in range(np.uintp(len(coarse))):
        i = _TWO * x
        flow = _in_line(upper[i], middle[i], lower[i])
        flow += _in_line(upper[i + _ONE], middle[i + _ONE], lower[i + _ONE])
        coarse[x] = max(flow - blur, least * flow)


@numba.njit(nogil=True, fastmath={"contract"}, error_model="numpy", inline="always")
def _in_line(before, middle, after):
    """Conductance across three faces in a line, between the centres of two and two cells of the same mass."""
    half, none = np.float32(0.5), middle - middle
    to_before, to_after = (none if before < WEAK * middle else half), (none if after < WEAK * middle else half)
    before, after = (middle if before < WEAK * middle else before), (middle if after < WEAK * middle else after)
    product = before * after
    flow = middle * product / (product + middle * (to_before * after + to_after * before))
    return flow if middle > 0 else none


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
