r"""One pass of the transmission solver: at each pixel, a weighted quantile of its neighbours, drawn to the data.

.. math:: \min_u C (u - a)^2 + \lambda \sum_{y \in W,\ D(y) \ge v} w_y\, \rho_p(D(y) - u), \qquad
          w_y = \frac{g(S(x) - S(y))}{\sum g}

with :math:`\rho_p(e) = 2 p\,e` above 0 and :math:`2 (p - 1)\,e` below, so that :math:`\rho_{1/2} = |e|`. Where F is the
share of the weight that lies below u, the derivative is zero where

.. math:: \tfrac{2C}{\lambda} (u - a) + 2 F(u) - 2 p = 0.

The left side grows with u, so there is one solution. ``exact`` sorts the neighbours; ``binned``, in
:mod:`~fogpipe.kernels.dehazing.binned_quantile`, counts them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands


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


@njit(nogil=True, cache=True)
def _exact(first, last, log_t, bound, guide, pull, quantile, radius, deviation, out):
    most = (2 * radius + 1) ** 2
    values, weights = np.empty(most, log_t.dtype), np.empty(most, np.float64)
    for y in range(first, last):
        for x in range(log_t.shape[1]):
            out[y, x] = at_pixel(y, x, log_t, bound, guide, pull, quantile, radius, deviation, values, weights)


@njit(nogil=True, cache=True)
def at_pixel(y, x, log_t, bound, guide, pull, quantile, radius, deviation, values, weights):
    """The solution at one pixel; ``values`` and ``weights`` have room for its window."""
    height, width = log_t.shape
    count, total = 0, 0.0
    for j in range(max(0, y - radius), min(height, y + radius + 1)):
        for i in range(max(0, x - radius), min(width, x + radius + 1)):
            if log_t[j, i] >= bound[y, x]:
                z = (guide[y, x] - guide[j, i]) / deviation
                values[count] = log_t[j, i]
                weights[count] = math.exp(-z * z / 2)
                total += weights[count]
                count += 1
    return crossing(values[:count], weights[:count], total, log_t[y, x], pull, quantile)


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
