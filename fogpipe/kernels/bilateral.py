"""The bilateral filter of a map in [0, 1] with itself: by its sum, and by a few Gaussian blurs."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

REACH = 4
"""Half the width of the window in standard deviations; what lies outside weighs 6e-5 of the whole."""


def exact(values: FloatArray, spatial: float, tonal: float) -> FloatArray:
    """The sum over the window, pixel by pixel. NaN stays, and counts for no neighbour."""
    smooth = np.empty_like(values)
    near = np.exp(-((np.arange(math.ceil(REACH * spatial) + 1) / spatial) ** 2) / 2)
    in_bands(_sums, *values.shape, values, near, -1 / (2 * tonal**2), smooth)
    return smooth


def fast(values: FloatArray, spatial: float, tonal: float, error: float) -> FloatArray:
    r"""The same, up to an ``error`` in each weight.

    A Gaussian of the difference u − v is a sum of cosines, and a cosine of a difference one of products:

    .. math:: e^{-x^2/2\sigma^2} \approx \sum_k c_k \cos k\omega x, \qquad
              \cos k\omega(u - v) = \cos k\omega u \cos k\omega v + \sin k\omega u \sin k\omega v,

    so that each term takes Gaussian blurs of the cosine and the sine of the map. The period 2π/ω is long enough for the
    repeated Gaussian not to be felt by differences up to 1.
    """
    import cv2

    decay = math.sqrt(2 * math.log(1 / error))
    frequency = 2 * math.pi / (1 + decay * tonal)
    terms = math.ceil(decay / (tonal * frequency))
    width = 2 * math.ceil(REACH * spatial) + 1

    known = ~np.isnan(values)
    weight = known.astype(values.dtype)
    filled = np.where(known, values, 0)
    weighted, total = np.zeros_like(values), np.zeros_like(values)
    for k in range(terms + 1):
        c = tonal * frequency / math.sqrt(2 * math.pi) * math.exp(-((k * frequency * tonal) ** 2) / 2) * (2 if k else 1)
        angle = values.dtype.type(k * frequency) * filled
        for wave in (np.cos(angle), np.sin(angle)) if k else (np.ones_like(values),):
            parts = np.dstack([weight * wave, weight * wave * filled])
            blurred = cv2.GaussianBlur(parts, (width, width), spatial, borderType=cv2.BORDER_CONSTANT)
            total += c * wave * blurred[..., 0]
            weighted += c * wave * blurred[..., 1]
    smooth = np.clip(np.divide(weighted, total, out=filled.copy(), where=total > 0), 0, 1)
    smooth[~known] = np.nan
    return smooth


@njit(cache=True, nogil=True)
def _sums(first, last, values, near, factor, smooth):
    rows, columns = values.shape
    reach = near.size - 1
    for y in range(first, last):
        for x in range(columns):
            centre = values[y, x]
            weighted = total = 0.0
            for v in range(max(0, y - reach), min(rows, y + reach + 1)):
                for u in range(max(0, x - reach), min(columns, x + reach + 1)):
                    value = values[v, u]
                    if value == value:  # not NaN
                        weight = near[abs(v - y)] * near[abs(u - x)] * np.exp(factor * (value - centre) ** 2)
                        weighted += weight * value
                        total += weight
            smooth[y, x] = weighted / total if centre == centre else np.nan
