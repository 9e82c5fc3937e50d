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
Kernels = Sequence[FloatArray]
"""(H, W) factors of each kernel in the cosine basis, see :func:`~fogpipe.kernels.scattering.pixels.responses`."""


def blend(
    planes: FloatArray,
    position: FloatArray,
    coefficients: np.ndarray,
    kernels: Kernels,
    form: Form,
) -> FloatArray:
    """Convolve planes with a sum of kernels, weighted from pixel to pixel.

    Parameters
    ----------
    planes : (C, H, W) float.
    position : (H, W) float, place of each pixel on the axis of ``coefficients``, 0 … columns − 1.
    coefficients : (kernels, columns), a_k at whole positions; linear in between.
    kernels : One for each row of the coefficients.
    form : Which pixel's weight counts: that which the light comes from, or that which it goes to.

    Returns
    -------
    (C, H, W), in the precision of the planes.

    Notes
    -----
    For each channel one cosine transform, and one for each kernel.
    """
    way = {"scatter": _scatter, "gather": _gather}[form]
    blurred = np.empty_like(planes)
    for plane, result in zip(planes, blurred, strict=True):
        result[...] = way(plane, position, coefficients.astype(planes.dtype), kernels)
    return blurred


def _scatter(plane: FloatArray, position: FloatArray, coefficients: FloatArray, kernels: Kernels) -> FloatArray:
    spectrum = np.zeros_like(plane)
    for row, kernel in zip(coefficients, kernels, strict=True):
        weighted = np.zeros_like(plane)
        in_bands(_add_weighted, *plane.shape, plane, position, row, weighted)
        spectrum += kernel * np.asarray(fft.dctn(weighted, workers=threads(), overwrite_x=True))
    return np.asarray(fft.idctn(spectrum, workers=threads(), overwrite_x=True))


def _gather(plane: FloatArray, position: FloatArray, coefficients: FloatArray, kernels: Kernels) -> FloatArray:
    spectrum = np.asarray(fft.dctn(plane, workers=threads()))
    blurred = np.zeros_like(plane)
    for row, kernel in zip(coefficients, kernels, strict=True):
        part = fft.idctn(spectrum * kernel, workers=threads(), overwrite_x=True)
        in_bands(_add_weighted, *plane.shape, part, position, row, blurred)
    return blurred


@njit(cache=True, nogil=True)
def _add_weighted(first, last, plane, position, row, result):  # pragma: no cover - compiled
    """Add the plane to the result, each pixel with the coefficient at its position."""
    most = len(row) - 1
    for y in range(first, last):
        for x in range(plane.shape[1]):
            index = min(int(position[y, x]), max(most - 1, 0))
            share = position[y, x] - index
            weight = row[index] + share * (row[min(index + 1, most)] - row[index])
            result[y, x] += weight * plane[y, x]
