"""Structure without texture, by relative total variation (Xu et al. 2012)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.dehazing.weighted_least_squares import smooth

INNER = 1e-3
"""ε of the windowed variation, which keeps flat parts from dividing by 0."""


def structure(
    image: np.ndarray, smoothness: float, scale: float, sharpness: float, iterations: int, tolerance: float
) -> FloatArray:
    """(H, W, 3) float32 structure of an (H, W, 3) image.

    Parameters
    ----------
    image : I.
    smoothness : λ.
    scale : σ, pixels.
    sharpness : εs.
    iterations : of reweighting.
    tolerance : root-mean-square residual of each linear system.
    """
    planes = np.ascontiguousarray(image.transpose(2, 0, 1), dtype=np.float32)
    current = planes
    for iteration in range(iterations):
        east, south = _weights(current, max(scale / 2**iteration, 0.5), sharpness)
        current = smooth(planes, current, smoothness * east, smoothness * south, tolerance)
    return np.ascontiguousarray(current.transpose(1, 2, 0))


def _weights(planes: FloatArray, scale: float, sharpness: float) -> tuple[FloatArray, FloatArray]:
    """Weights of the squared difference over each edge, 1 / (windowed inherent variation × variation)."""
    _, height, width = planes.shape
    differences = np.zeros((2, height, width), np.float32)
    variations = np.zeros((2, height, width), np.float32)
    in_bands(_differences, height, width, planes, differences, variations)
    inherent = [np.abs(_gaussian(difference, scale)) for difference in differences]
    weights = [
        _gaussian(1 / (local + np.float32(INNER)), scale) / np.maximum(variation, np.float32(sharpness))
        for local, variation in zip(inherent, variations, strict=True)
    ]
    weights[0][:, -1] = 0
    weights[1][-1, :] = 0
    return weights[0], weights[1]


def _gaussian(plane: FloatArray, scale: float) -> FloatArray:
    import cv2

    reach = 2 * math.ceil(2 * scale) + 1
    blurred = cv2.GaussianBlur(plane, (reach, reach), scale, borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred, plane.dtype).reshape(plane.shape)


@njit(nogil=True, cache=True)
def _differences(first, last, planes, differences, variations):
    """To the next column and row: the mean over channels, and the mean of its absolute value."""
    channels, height, width = planes.shape
    share = planes.dtype.type(1 / channels)
    for y in range(first, last):
        for c in range(channels):
            for x in range(width - 1):
                d = planes[c, y, x + 1] - planes[c, y, x]
                differences[0, y, x] += d * share
                variations[0, y, x] += abs(d) * share
            if y + 1 < height:
                for x in range(width):
                    d = planes[c, y + 1, x] - planes[c, y, x]
                    differences[1, y, x] += d * share
                    variations[1, y, x] += abs(d) * share
