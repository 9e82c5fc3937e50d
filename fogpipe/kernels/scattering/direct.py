"""Blur with a kernel of its own for every pixel, summed over all pairs of pixels: what the fast solvers converge to."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.scattering.convolution import Form

KernelAt = Callable[[int, int], tuple[FloatArray, float]]
"""Gives for a pixel (row, column) what :func:`~fogpipe.kernels.scattering.pixels.weights` gives."""


def direct(planes: FloatArray, kernel_at: KernelAt, form: Form) -> FloatArray:
    """Blur (C, H, W) planes, mirrored at their borders, in float64.

    Cost: (H W)² multiplications for each channel, and as many weights; for pictures of some ten thousand pixels.
    """
    planes = planes.astype(np.float64)
    _, height, width = planes.shape
    blurred = np.zeros_like(planes)
    own = np.empty((height, width))
    for y in range(height):
        for x in range(width):
            quadrant, beyond = kernel_at(y, x)
            in_bands(_kernel_around, height, width, y, x, quadrant, beyond / (height * width), own)
            if form == "scatter":
                blurred += planes[:, y, x, None, None] * own
            else:
                blurred[:, y, x] = np.tensordot(planes, own)
    return blurred


@njit(cache=True, nogil=True)
def _kernel_around(first, last, y, x, quadrant, even, own):  # pragma: no cover - compiled
    """Weights of all pixels seen from one, each with its mirror images."""
    height, width = own.shape
    for row in range(first, last):
        up, mirrored_up = abs(row - y), row + y + 1
        mirrored_up = min(mirrored_up, 2 * height - mirrored_up)
        for column in range(width):
            across, mirrored = abs(column - x), column + x + 1
            mirrored = min(mirrored, 2 * width - mirrored)
            near = quadrant[up, across] + quadrant[mirrored_up, across]
            own[row, column] = near + quadrant[up, mirrored] + quadrant[mirrored_up, mirrored] + even
