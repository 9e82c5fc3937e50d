r"""Weighted total variation with a lower bound, by the primal-dual method of Chambolle and Pock 2011.

.. math:: \min_{u \ge b} \sum_x \tfrac12 w(x) |u(x) - f(x)|^2 + g(x) |\nabla u(x)|
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray, floats
from fogpipe.kernels.bands import in_bands

STEP = 0.35
"""Square root of the product of the two steps; the method converges below 1/√8, the norm of the gradient being √8."""
RATIO = 3.0
"""Of the steps, dual over primal and relative to the edge weight: found by trying 0.1 to 10."""


def total_variation(
    data: np.ndarray, weight: np.ndarray, edge: np.ndarray, bound: np.ndarray | None, iterations: int
) -> FloatArray:
    """The minimiser, after a number of iterations.

    Parameters
    ----------
    data : (H, W, C) float, f.
    weight : (H, W) float, w, 0 or more.
    edge : (H, W) float, g, 0 or more.
    bound : (H, W, C) float, b; None for no bound.
    iterations : Each is two passes over the data, about 7 ns per value.

    Returns
    -------
    (H, W, C) float, u. The gradient is isotropic, of forward differences, with the channels taken together (an edge of
    all channels at one place costs less than edges at three); no flux crosses the border.
    """
    data, weight, edge, bound = floats(data, weight, edge, np.full_like(data, -np.inf) if bound is None else bound)
    value = np.array(data)
    leading = np.array(data)
    dual = np.zeros((*data.shape, 2), data.dtype)
    rows, columns = weight.shape
    # Steps in the proportion of what they move: values of about 1, duals of at most the edge weight.
    scale = float(max(edge.max(), 1e-6)) * RATIO
    up, down = data.dtype.type(STEP * scale), data.dtype.type(STEP / scale)
    for _ in range(iterations):
        in_bands(_ascend, rows, columns, leading, edge, up, dual)
        in_bands(_descend, rows, columns, dual, data, weight, bound, down, value, leading)
    return value


@njit(nogil=True, cache=True)
def _ascend(first, last, leading, edge, step, dual):
    height, width, channels = leading.shape
    zero = leading.dtype.type(0)
    for y in range(first, last):
        for x in range(width):
            square = zero
            for c in range(channels):
                here = leading[y, x, c]
                down = leading[y + 1, x, c] - here if y + 1 < height else zero
                right = leading[y, x + 1, c] - here if x + 1 < width else zero
                dual[y, x, c, 0] += step * down
                dual[y, x, c, 1] += step * right
                square += dual[y, x, c, 0] ** 2 + dual[y, x, c, 1] ** 2
            limit = edge[y, x]
            if square > limit * limit:
                scale = limit / np.sqrt(square)
                for c in range(channels):
                    dual[y, x, c, 0] *= scale
                    dual[y, x, c, 1] *= scale


@njit(nogil=True, cache=True)
def _descend(first, last, dual, data, weight, bound, step, value, leading):
    _, width, channels = data.shape
    one, two = data.dtype.type(1), data.dtype.type(2)
    for y in range(first, last):
        for x in range(width):
            pull = step * weight[y, x]
            for c in range(channels):
                divergence = dual[y, x, c, 0] + dual[y, x, c, 1]
                if y > 0:
                    divergence -= dual[y - 1, x, c, 0]
                if x > 0:
                    divergence -= dual[y, x - 1, c, 1]
                old = value[y, x, c]
                new = max((old + step * divergence + pull * data[y, x, c]) / (one + pull), bound[y, x, c])
                value[y, x, c] = new
                leading[y, x, c] = two * new - old
