"""Implicit diffusion, rows and columns in turn (after Kass, Lefohn and Owens 2006)."""

from __future__ import annotations

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.grid import rates
from fogpipe.kernels.diffusion.published import prepared

STEPS = 8


def adi(layer: np.ndarray, scale: np.ndarray, finest: float, steps: int = STEPS) -> FloatArray:
    """Backward Euler, one tridiagonal system for each row, then for each column: stable at any step, first order."""
    layer, scale = prepared(layer, scale, finest)
    rate = rates(scale, finest) / scale.dtype.type(2 * steps)
    east, south = rate[:, :-1] + rate[:, 1:], (rate[:-1] + rate[1:]).T
    rows, columns = scale.shape
    now = layer.copy()
    for _ in range(steps):
        in_bands(_implicit_rows, rows, columns, now, east)
        turned = np.ascontiguousarray(now.transpose(1, 0, 2))
        in_bands(_implicit_rows, columns, rows, turned, south)
        now = np.ascontiguousarray(turned.transpose(1, 0, 2))
    return now


@numba.njit(nogil=True, cache=True)
def _implicit_rows(first, last, values, rates):
    _, columns, channels = values.shape
    one = rates.dtype.type(1)
    share = np.empty(columns, rates.dtype)
    for y in range(first, last):
        west = rates.dtype.type(0)
        before = rates.dtype.type(0)
        for x in range(columns):
            east = rates[y, x] if x < columns - 1 else rates.dtype.type(0)
            inverse = one / (one + west * (one - before) + east)
            for k in range(channels):
                older = values[y, x - 1, k] if x else rates.dtype.type(0)
                values[y, x, k] = (values[y, x, k] + west * older) * inverse
            before = east * inverse
            share[x] = before
            west = east
        for x in range(columns - 2, -1, -1):
            for k in range(channels):
                values[y, x, k] += share[x] * values[y, x + 1, k]
