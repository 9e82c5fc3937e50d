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
REACH = 4
"""Standard deviations of the guide beyond which a neighbour has no weight (3e-4)."""
LARGEST_RADIUS = 127
"""The pixels of a window must be counted in 16 bits."""


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
    """The same from histograms of ``levels`` bins of D; parameters as :func:`exact`.

    Time grows with the bins of D and S, and memory is that of one row of columns, 2 B a bin.
    """
    if radius > LARGEST_RADIUS:
        raise ValueError(
            f"a radius of {radius} pixels is more than {LARGEST_RADIUS}, the most that fits the histograms."
        )
    real = log_t.dtype.type
    lowest = log_t.min()
    width = real(max((log_t.max() - lowest) / levels, 1e-6))
    level = np.minimum((log_t - lowest) / width, levels - 1).astype(np.uint16)
    darkest, cell_width = guide.min(), real(deviation / CELLS_PER_DEVIATION)
    cell = ((guide - darkest) / cell_width).astype(np.uint16)
    center = darkest + (np.arange(cell.max() + 1, dtype=log_t.dtype) + real(0.5)) * cell_width
    within = cell_width**2 / 12  # the variance inside a bin, which the bins add to that of the weight
    narrowness = real(1 / (2 * (deviation**2 - within)))
    out = np.empty_like(log_t)
    in_bands(
        _binned, *out.shape,
        level, cell, center, bound, guide, lowest, width, levels, log_t, real(pull), real(quantile), radius, narrowness, out,
    )  # fmt: skip
    return np.maximum(out, bound, out=out)


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
def _binned(
    first, last, level, cell, center, bound, guide, lowest, width, levels, data, pull, quantile, radius, narrowness, out
):
    height, columns = level.shape
    cells = center.size
    column = np.zeros((columns, cells, levels), np.uint16)
    window = np.empty((cells, levels), np.uint16)
    weight = np.empty(levels, out.dtype)
    reach = REACH * CELLS_PER_DEVIATION
    for y in range(max(0, first - radius), min(height, first + radius)):
        for x in range(columns):
            column[x, cell[y, x], level[y, x]] += np.uint16(1)
    for y in range(first, last):
        if y + radius < height:
            for x in range(columns):
                column[x, cell[y + radius, x], level[y + radius, x]] += np.uint16(1)
        if y > first and y - radius > 0:
            for x in range(columns):
                column[x, cell[y - radius - 1, x], level[y - radius - 1, x]] -= np.uint16(1)
        window[:] = 0
        for x in range(min(radius, columns)):
            _add(window, column[x])
        for x in range(columns):
            if x + radius < columns:
                _add(window, column[x + radius])
            if x > radius:
                _subtract(window, column[x - radius - 1])
            weight[:] = 0
            for k in range(max(0, cell[y, x] - reach), min(cells, cell[y, x] + reach + 1)):
                difference = guide[y, x] - center[k]
                g = math.exp(-difference * difference * narrowness)
                for q in range(levels):
                    weight[q] += g * window[k, q]
            out[y, x] = _binned_crossing(weight, bound[y, x], lowest, width, data[y, x], pull, quantile)


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
def _binned_crossing(weight, bound, lowest, width, data, pull, quantile):
    """Where the derivative passes zero if the weight of a bin is spread evenly over it, from the bound up."""
    levels = weight.size
    start = min(max(int((bound - lowest) / width), 0), levels - 1)
    inside = (bound - lowest) / width - start
    weight[start] *= 1 - min(max(inside, 0), 1)  # the part of the bin that is not below the bound
    total = weight[start:].sum()
    if total <= 0:
        return data
    below = weight.dtype.type(0)
    for q in range(start, levels):
        left, right = lowest + q * width, lowest + (q + 1) * width
        at_left = pull * (left - data) + 2 * below / total - 2 * quantile
        below += weight[q]
        at_right = pull * (right - data) + 2 * below / total - 2 * quantile
        if at_right >= 0:
            return left + width * min(max(-at_left / (at_right - at_left), 0), 1) if at_right > at_left else left
    return lowest + levels * width
