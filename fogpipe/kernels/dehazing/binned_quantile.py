"""The weighted quantile of :mod:`~fogpipe.kernels.dehazing.weighted_quantile` without sorting.

A histogram of the window over D and S moves on by one column of pixels at a time, so that its cost hangs on the number
of bins and not on the window. The bins of D form groups. Counts of the groups are always kept; those of the bins of a
group are brought up to date when it is asked for, which is where the bound lies and where the solution does.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.dehazing.weighted_quantile import at_pixel

CELLS_PER_DEVIATION = 2
"""Bins of the guide per standard deviation of its weight."""
GROUP = 16
"""Bins of D in a group, which are passed over together."""
LEAST_LIKENESS = 1e-4
"""A bin of the guide with a smaller weight is left out."""
SHARES = 4
"""A pixel counts as four, shared between the two bins of the guide that it lies between."""
LARGEST_RADIUS = 63
"""Four times the pixels of a window must be counted in 16 bits."""
FEW = 20.0
"""Neighbours of less weight in all are sorted: among few, a small error of a weight makes another one the quantile."""


def binned(
    log_t: FloatArray,
    bound: FloatArray,
    guide: FloatArray,
    pull: float,
    quantile: float,
    radius: int,
    deviation: float,
    levels: int,
) -> FloatArray:
    """The same from histograms of ``levels`` bins of D, a multiple of 16; parameters as :func:`exact`.

    Time grows with the bins of D and S, and memory is that of one row of columns, 2 B a bin.
    """
    if radius > LARGEST_RADIUS:
        raise ValueError(
            f"a radius of {radius} pixels is more than {LARGEST_RADIUS}, the most that fits the histograms."
        )
    real = log_t.dtype.type
    low, high, members = _bins(log_t, levels)
    level, start = np.empty(log_t.shape, np.uint16), np.empty(log_t.shape, np.uint16)
    in_bands(_find, *log_t.shape, log_t, high, level)
    in_bands(_find, *log_t.shape, bound, high, start)
    cell = real(deviation / CELLS_PER_DEVIATION)
    place = (guide - guide.min()) / cell
    within = cell**2 / 6  # the variance that sharing between two bins adds to that of the weight
    fall = real(cell**2 / (2 * (deviation**2 - within)))
    out = np.empty_like(log_t)
    in_bands(
        _binned, *out.shape,
        level, start, place, low, high, members, bound, log_t, real(pull), real(quantile), radius, fall,
        guide, deviation, out,
    )  # fmt: skip
    return np.maximum(out, bound, out=out)


def _bins(log_t: FloatArray, levels: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least and largest value in each bin, and how many different ones it holds.

    Where there are few values, as without noise from 8 bit, each has a bin. Else the bins are of equal widths in t, and
    the ends and what occurs most often are by themselves.
    """
    values, counts = np.unique(log_t, return_counts=True)
    last = np.arange(values.size)
    if values.size > levels:
        often = np.flatnonzero(counts > log_t.size / levels)
        often = often[np.argsort(-counts[often], kind="stable")[: levels // 4]]
        alone = np.concatenate([[0, values.size - 1], often])
        steps = np.log(np.linspace(np.exp(values[0]), np.exp(values[-1]), levels - 2 * alone.size))
        inner = np.searchsorted(values, steps.astype(values.dtype), side="right") - 1
        last = np.unique(np.maximum([*inner, *alone, *(alone - 1)], 0))
    first = np.concatenate([[0], last[:-1] + 1])
    rest = (0, levels - last.size)
    low, high = (np.pad(values[place], rest, mode="edge") for place in (first, last))
    return low, high, np.pad(last - first + 1, rest, constant_values=1).astype(values.dtype)


@njit(nogil=True, cache=True)
def _find(first, last, values, high, place):
    """The first bin that reaches up to each value, by halving; values are at most the largest of all."""
    for y in range(first, last):
        for x in range(values.shape[1]):
            low, count = 0, high.size - 1
            while count > 0:
                half = count // 2
                if high[low + half] < values[y, x]:
                    low += half + 1
                    count -= half + 1
                else:
                    count = half
            place[y, x] = low


@njit(nogil=True, cache=True, error_model="numpy")
def _binned(
    first,
    last,
    level,
    start,
    place,
    low,
    high,
    members,
    bound,
    data,
    pull,
    quantile,
    radius,
    fall,
    guide,
    deviation,
    out,
):
    height, columns = level.shape
    cells, groups = 4 * ((int(place.max()) + 2 + 3) // 4), high.size // GROUP
    column = np.zeros((groups, columns, cells * GROUP), np.uint16)
    column_groups = np.zeros((1, columns, cells * groups), np.uint16)
    window = np.zeros((groups, cells * GROUP), np.uint16)
    window_groups = np.zeros((1, cells * groups), np.uint16)
    window_cells, window_groups_cells = window.reshape(groups, cells, GROUP), window_groups.reshape(1, cells, groups)
    at = np.empty(groups, np.int64)
    likeness = np.zeros(cells, out.dtype)
    reach = int(math.sqrt(-math.log(LEAST_LIKENESS) / fall)) + 1
    falls = np.exp(-fall * np.arange(reach + 1, dtype=out.dtype) ** 2)
    weight_groups, weight = np.empty(groups, out.dtype), np.empty(GROUP, out.dtype)
    most = (2 * radius + 1) ** 2
    values, weights = np.empty(most, data.dtype), np.empty(most, np.float64)
    for y in range(max(0, first - radius), min(height, first + radius)):
        _count(column, column_groups, place[y], level[y], np.uint16(1))
    for y in range(first, last):
        if y + radius < height:
            _count(column, column_groups, place[y + radius], level[y + radius], np.uint16(1))
        if y > first and y - radius > 0:
            _count(column, column_groups, place[y - radius - 1], level[y - radius - 1], np.uint16(0xFFFF))  # minus one
        at[:] = -radius - 1  # nowhere
        window_groups[:] = 0
        for x in range(min(radius, columns)):
            _add(window_groups, column_groups, 0, x)
        for x in range(columns):
            if x + radius < columns:
                _add(window_groups, column_groups, 0, x + radius)
            if x > radius:
                _subtract(window_groups, column_groups, 0, x - radius - 1)
            nearest = _likenesses(place[y, x], falls, fall, likeness)
            lowest, highest = 4 * (max(nearest - reach, 0) // 4), min(nearest + reach + 1, cells)
            _weighted(window_groups_cells, 0, likeness, lowest, highest, weight_groups)
            # From the bin that the bound is in, of which a part may lie below it.
            begin = int(start[y, x])
            group = begin // GROUP
            _move(window, column, at, group, x, radius)
            _weighted(window_cells, group, likeness, lowest, highest, weight)
            for q in range(begin % GROUP):
                weight[q] = 0
            if bound[y, x] > low[begin]:  # of n values, at even steps from the least to the largest
                above = max(high[begin] - bound[y, x], 0) / (high[begin] - low[begin])
                weight[begin % GROUP] *= (above * (members[begin] - 1) + 1) / members[begin]
            weight_groups[group] = weight[0]
            for q in range(1, GROUP):
                weight_groups[group] += weight[q]
            total = weight_groups[group]
            for g in range(group + 1, groups):
                total += weight_groups[g]
            if total < FEW * SHARES:
                out[y, x] = at_pixel(y, x, data, bound, guide, pull, quantile, radius, deviation, values, weights)
                continue
            # The derivative grows: first the group in which it passes zero is sought, then the place in that.
            below = total * 0
            while group + 1 < groups:
                further = below + weight_groups[group]
                if _derivative(low[(group + 1) * GROUP], further, total, data[y, x], pull, quantile) >= 0:
                    break
                below = further
                group += 1
            if group > begin // GROUP:
                _move(window, column, at, group, x, radius)
                _weighted(window_cells, group, likeness, lowest, highest, weight)
            out[y, x] = _zero(low, high, group, weight, below, total, data[y, x], pull, quantile)


@njit(nogil=True, cache=True)
def _count(column, column_groups, place, level, one):
    groups = column.shape[0]
    for x in range(place.size):
        shares = int(place[x] * SHARES + 0.5)
        cell, group, q = shares // SHARES, level[x] // GROUP, level[x] % GROUP
        upper = one * (shares % SHARES)
        lower = one * SHARES - upper
        i, j = cell * GROUP + q, cell * groups + group
        column[group, x, i] += lower
        column[group, x, i + GROUP] += upper
        column_groups[0, x, j] += lower
        column_groups[0, x, j + groups] += upper


@njit(nogil=True, cache=True)
def _move(window, column, at, group, x, radius):
    """Bring the window of a group from column ``at[group]``, where it was last asked for, to x."""
    columns = column.shape[1]
    if x - at[group] > radius:
        for i in range(window.shape[1]):
            window[group, i] = 0
        for i in range(max(0, x - radius), min(columns, x + radius + 1)):
            _add(window, column, group, i)
    else:
        for i in range(at[group] + 1, x + 1):
            if i + radius < columns:
                _add(window, column, group, i + radius)
            if i > radius:
                _subtract(window, column, group, i - radius - 1)
    at[group] = x


@njit(nogil=True, cache=True, inline="always")
def _add(window, column, group, x):
    for i in range(window.shape[1]):
        window[group, i] += column[group, x, i]


@njit(nogil=True, cache=True, inline="always")
def _subtract(window, column, group, x):
    for i in range(window.shape[1]):
        window[group, i] -= column[group, x, i]


@njit(nogil=True, cache=True, error_model="numpy")
def _likenesses(place, falls, fall, likeness):
    """The Gaussian at the centre of each bin of the guide that is within reach; returns the nearest bin.

    With the distance f to that, e^(−c (j − f)²) = e^(−c f²) · e^(2 c f j) · e^(−c j²), where the second is a power.
    """
    nearest = int(place + 0.5)
    away = place - nearest
    up = down = math.exp(-fall * away * away)
    likeness[:] = 0
    ratio = math.exp(2 * fall * away)
    likeness[nearest] = up
    for j in range(1, falls.size):
        up *= ratio
        down /= ratio
        if nearest + j < likeness.size:
            likeness[nearest + j] = up * falls[j]
        if nearest - j >= 0:
            likeness[nearest - j] = down * falls[j]
    return nearest


@njit(nogil=True, cache=True, fastmath={"contract"})
def _weighted(window, group, likeness, lowest, highest, weight):
    """Weight of each bin of D: its counts, weighted over the bins of the guide."""
    real, size = weight.dtype.type, weight.size
    weight[:] = 0
    for k in range(lowest, highest, 4):  # four in one, since each sum waits for the one before
        a, b, c, d = likeness[k], likeness[k + 1], likeness[k + 2], likeness[k + 3]
        for q in range(size):
            weight[q] += (
                a * real(window[group, k, q])
                + b * real(window[group, k + 1, q])
                + c * real(window[group, k + 2, q])
                + d * real(window[group, k + 3, q])
            )


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
def _zero(low, high, group, weight, below, total, data, pull, quantile):
    """Where the derivative passes zero: in a bin, whose weight is spread evenly over it, or between two."""
    first = group * GROUP
    for q in range(first, first + GROUP):
        at_low = _derivative(low[q], below, total, data, pull, quantile)
        if at_low >= 0:
            between = low[q] - at_low / (pull * total) if pull > 0 else low[q]
            return max(between, high[q - 1]) if q > first else between
        below += weight[q - first]
        at_high = _derivative(high[q], below, total, data, pull, quantile)
        if at_high >= 0:
            return low[q] - (high[q] - low[q]) * at_low / (at_high - at_low)
    top = high[first + GROUP - 1]
    return top - _derivative(top, below, total, data, pull, quantile) / (pull * total) if pull > 0 else top


@njit(nogil=True, cache=True, inline="always")
def _derivative(u, below, total, data, pull, quantile):
    """Times the weight of all neighbours, which is above 0."""
    return pull * total * (u - data) + (below - quantile * total) * 2
