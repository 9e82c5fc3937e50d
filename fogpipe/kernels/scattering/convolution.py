r"""Convolution with kernels that change from pixel to pixel, of images continued by mirroring.

With profiles :math:`K_T = \sum_k a_k(T) B_k`, light that spreads from each pixel with the kernel of that pixel is
(*scatter*, conserves the light of the picture), and light that each pixel collects with its own kernel is (*gather*,
leaves a constant picture as it is)

.. math:: J = \sum_k B_k * (a_k(T)\, E), \qquad J = \sum_k a_k(T)\, (B_k * E).

One is the transpose of the other. Of mirrored images, convolutions are diagonal in the cosine basis, at any size of
kernel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numba import njit
from scipy import fft

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands, threads

Form = Literal["scatter", "gather"]


def blend(
    planes: FloatArray,
    position: FloatArray,
    coefficients: np.ndarray,
    kernels: Sequence[FloatArray],
    form: Form,
) -> FloatArray:
    """Convolve planes with a sum of kernels, weighted from pixel to pixel.

    Parameters
    ----------
    planes : (C, H, W) float.
    position : (H, W) float, place of each pixel on the axis of ``coefficients``, 0 … columns − 1.
    coefficients : (kernels, columns), a_k at whole positions; linear in between.
    kernels : (H, W) factors of each kernel in the cosine basis, see :func:`~.pixels.responses`.
    form : Which pixel's weight counts: that which the light comes from, or that which it goes to.

    Returns
    -------
    (C, H, W), in the precision of the planes.

    Notes
    -----
    For each channel one cosine transform, and one for each kernel.
    """
    height, width = position.shape
    blurred = np.zeros_like(planes)
    work = np.empty((height, width), planes.dtype)
    table = np.asarray(coefficients, planes.dtype)
    for plane, result in zip(planes, blurred, strict=True):
        spectrum = _cosines(plane) if form == "gather" else None
        for row, kernel in zip(table, kernels, strict=True):
            if spectrum is not None:
                part = fft.idctn(np.multiply(spectrum, kernel, out=work), workers=threads())
                in_bands(_add_weighted, height, width, part, position, row, result)
            else:
                work[...] = 0
                in_bands(_add_weighted, height, width, plane, position, row, work)
                result += kernel * _cosines(work)
        if spectrum is None:
            result[...] = fft.idctn(result, workers=threads(), overwrite_x=True)
    return blurred


def _cosines(plane: FloatArray) -> FloatArray:
    return np.asarray(fft.dctn(plane, workers=threads()))


@njit(cache=True, nogil=True)
def _add_weighted(first, last, plane, position, row, result):  # pragma: no cover - compiled
    most = len(row) - 1
    for y in range(first, last):
        for x in range(plane.shape[1]):
            index = min(int(position[y, x]), max(most - 1, 0))
            share = position[y, x] - index
            weight = row[index] + share * (row[min(index + 1, most)] - row[index])
            result[y, x] += weight * plane[y, x]
