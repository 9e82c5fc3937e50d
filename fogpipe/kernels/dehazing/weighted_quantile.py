r"""One pass of the transmission solver: at each pixel, a weighted quantile of its neighbours, drawn to the data.

.. math:: \min_u C (u - a)^2 + \lambda \sum_{y \in W,\ D(y) \ge v} w_y\, \rho_p(D(y) - u), \qquad
          w_y = \frac{g(S(x) - S(y))}{\sum g}

with :math:`\rho_p(e) = 2 p\,e` above 0 and :math:`2 (p - 1)\,e` below, so that :math:`\rho_{1/2} = |e|`. Where F is the
share of the weight that lies below u, the derivative is zero where

.. math:: \tfrac{2C}{\lambda} (u - a) + 2 F(u) - 2 p = 0.

The left side grows with u, so there is one solution. ``exact`` sorts the neighbours. ``binned`` keeps a histogram of
the window over D and S, which moves on by one column of pixels at a time, so that its cost hangs on the number of
bins and not on the window.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

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


def exact(
    log_t: FloatArray,
    bound: FloatArray,
    guide: FloatArray,
    pull: float,
    quantile: float,
    radius: int,
    deviation: float,
) -> FloatArray:
    """The equation itself, by sorting each window.

    Parameters
    ----------
    log_t : (H, W) float, D of the pass before, which is also the data a.
    bound : (H, W) float, v, at most D.
    guide : (H, W) float, S.
    pull : 2C/λ, how strongly the data holds.
    quantile : p.
    radius : of the square window.
    deviation : σs, of the weight on S.

    Returns
    -------
    (H, W) float, in [v, max D].
    """
    out = np.empty_like(log_t)
    in_bands(_exact, *out.shape, log_t, bound, guide, pull, quantile, radius, deviation, out)
    return out


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
    edges = _edges(log_t.min(), log_t.max(), levels)
    inner = np.minimum((log_t - edges[1]) / max(edges[2] - edges[1], real(1e-9)), levels - 3).astype(np.uint16) + 1
    level = np.where(log_t <= edges[0], 0, np.where(log_t >= edges[-1], levels - 1, inner)).astype(np.uint16)
    darkest, cell_width = guide.min(), real(deviation / CELLS_PER_DEVIATION)
    place = np.rint((guide - darkest) / cell_width * SHARES).astype(np.uint16)
    center = darkest + np.arange(place.max() // SHARES + 2, dtype=log_t.dtype) * cell_width
    within = cell_width**2 / 6  # the variance that sharing between two bins adds to that of the weight
    narrowness = real(1 / (2 * (deviation**2 - within)))
    out = np.empty_like(log_t)
    in_bands(
        _binned, *out.shape,
        level, place, center, edges, bound, guide, log_t, real(pull), real(quantile), radius, narrowness,
        out,
    )  # fmt: skip
    return np.maximum(out, bound, out=out)


def _edges(lowest: float, highest: float, levels: int) -> FloatArray:
    """Edges of the bins: the first and the last have no width, since many pixels may lie at the very ends."""
    inner = np.linspace(lowest, highest, levels - 1, dtype=type(lowest))
    return np.concatenate([inner[:1], inner, inner[-1:]])


@njit(nogil=True, cache=True)
def _exact(first, last, log_t, bound, guide, pull, quantile, radius, deviation, out):
    height, width = log_t.shape
    most = (2 * radius + 1) ** 2
    values, weights = np.empty(most, log_t.dtype), np.empty(most, np.float64)
    for y in range(first, last):
        for x in range(width):
            count, total = 0, 0.0
            for j in range(max(0, y - radius), min(height, y + radius + 1)):
                for i in range(max(0, x - radius), min(width, x + radius + 1)):
                    if log_t[j, i] >= bound[y, x]:
                        z = (guide[y, x] - guide[j, i]) / deviation
                        values[count] = log_t[j, i]
                        weights[count] = math.exp(-z * z / 2)
                        total += weights[count]
                        count += 1
            out[y, x] = crossing(values[:count], weights[:count], total, log_t[y, x], pull, quantile)


@njit(nogil=True, cache=True)
def crossing(values, weights, total, data, pull, quantile):
    """Where the derivative, which jumps up at each neighbour, passes zero: the median of eq. 25 for p = 1/2."""
    order = np.argsort(values)
    below = 0.0
    value = values[order[0]]
    for h in order:
        free = data + 2 * (quantile - below / total) / pull if pull > 0 else (quantile - below / total) * np.inf
        if free <= values[h]:
            return max(free, value)
        value = values[h]
        below += weights[h]
    free = data + 2 * (quantile - 1) / pull if pull > 0 else -np.inf
    return max(value, free)


@njit(nogil=True, cache=True)
def _binned(first, last, level, place, center, edges, bound, guide, data, pull, quantile, radius, narrowness, out):
    height, columns = level.shape
    cells, levels = center.size, edges.size - 1
    column = np.zeros((columns, cells, levels), np.uint16)
    column_groups = np.zeros((columns, cells, levels // GROUP), np.uint16)
    window, window_groups = np.empty_like(column[0]), np.empty_like(column_groups[0])
    likeness = np.empty(cells, out.dtype)
    for y in range(max(0, first - radius), min(height, first + radius)):
        _count(column, column_groups, place[y], level[y], np.uint16(1))
    for y in range(first, last):
        if y + radius < height:
            _count(column, column_groups, place[y + radius], level[y + radius], np.uint16(1))
        if y > first and y - radius > 0:
            _count(column, column_groups, place[y - radius - 1], level[y - radius - 1], np.uint16(0xFFFF))  # minus one
        window[:] = 0
        window_groups[:] = 0
        for x in range(min(radius, columns)):
            _add(window, column[x])
            _add(window_groups, column_groups[x])
        for x in range(columns):
            if x + radius < columns:
                _add(window, column[x + radius])
                _add(window_groups, column_groups[x + radius])
            if x > radius:
                _subtract(window, column[x - radius - 1])
                _subtract(window_groups, column_groups[x - radius - 1])
            for k in range(cells):
                difference = guide[y, x] - center[k]
                likeness[k] = math.exp(-difference * difference * narrowness)
            out[y, x] = _binned_crossing(
                window, window_groups, likeness, edges, bound[y, x], data[y, x], pull, quantile
            )


@njit(nogil=True, cache=True)
def _count(column, column_groups, place, level, one):
    for x in range(place.size):
        cell, group = place[x] // SHARES, level[x] // GROUP
        upper = one * (place[x] % SHARES)
        lower = one * SHARES - upper
        column[x, cell, level[x]] += lower
        column[x, cell + 1, level[x]] += upper
        column_groups[x, cell, group] += lower
        column_groups[x, cell + 1, group] += upper


@njit(nogil=True, cache=True)
def _add(window, column):
    for k in range(window.shape[0]):
        for q in range(window.shape[1]):
            window[k, q] += column[k, q]


@njit(nogil=True, cache=True)
def _subtract(window, column):
    for k in range(window.shape[0]):
        for q in range(window.shape[1]):
            window[k, q] -= column[k, q]


@njit(nogil=True, cache=True)
def _weighted(window, likeness, first, weight):
    """Weight of as many bins as ``weight`` holds, from the first."""
    weight[:] = 0
    for k in range(likeness.size):
        if likeness[k] > LEAST_LIKENESS:
            for q in range(weight.size):
                weight[q] += likeness[k] * window[k, first + q]


@njit(nogil=True, cache=True)
def _binned_crossing(window, window_groups, likeness, edges, bound, data, pull, quantile):
    """Where the derivative passes zero if the weight of a bin is spread evenly over it, from the bound up.

    The derivative grows, so the group in which it passes zero is sought first, and only the bins of that are looked at.
    """
    levels = edges.size - 1
    groups = np.empty(levels // GROUP, edges.dtype)
    weight = np.empty(GROUP, edges.dtype)
    start, share = 0, edges.dtype.type(1)
    if bound > edges[1]:
        start = min(1 + int((bound - edges[1]) / (edges[2] - edges[1])), levels - 1)
        if start < levels - 1:  # the part of the bin that is not below the bound
            share = min(max((edges[start + 1] - bound) / (edges[2] - edges[1]), 0), 1)
    _weighted(window_groups, likeness, 0, groups)
    group = start // GROUP
    _weighted(window, likeness, group * GROUP, weight)
    weight[: start % GROUP] = 0
    weight[start % GROUP] *= share
    groups[group] = weight.sum()
    total = groups[group:].sum()
    if total <= 0:
        return data
    below = edges.dtype.type(0)
    while group < groups.size - 1:
        if _derivative(edges[(group + 1) * GROUP], below + groups[group], total, data, pull, quantile) >= 0:
            break
        below += groups[group]
        group += 1
    if group > start // GROUP:
        _weighted(window, likeness, group * GROUP, weight)
    for q in range(max(start, group * GROUP), (group + 1) * GROUP):
        left, right = edges[q], edges[q + 1]
        at_left = _derivative(left, below, total, data, pull, quantile)
        below += weight[q % GROUP]
        at_right = _derivative(right, below, total, data, pull, quantile)
        if at_right >= 0:
            return left + (right - left) * min(max(-at_left / (at_right - at_left), 0), 1) if right > left else left
    return edges[levels]


@njit(nogil=True, cache=True, inline="always")
def _derivative(u, below, total, data, pull, quantile):
    return pull * (u - data) + 2 * below / total - 2 * quantile
