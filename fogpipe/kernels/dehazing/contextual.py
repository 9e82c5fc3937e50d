r"""Contextual regularisation of a map (Meng 2013, section 3.2): smooth where the image is.

.. math:: \min_t \tfrac{\lambda}{2} \|t - \tilde t\|_2^2 + \sum_j \| W_j \circ (D_j \otimes t) \|_1

by half-quadratic splitting: the differences :math:`u_j = D_j \otimes t` are shrunk one by one, then all of t is fitted
to them in the Fourier domain, with a coupling that grows from round to round.
"""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray

COUPLINGS = tuple((2 * np.sqrt(2)) ** np.arange(6))
"""β of each round, from 1 to 181, as in the paper up to 2⁸."""
MARGIN = 16
"""Pixels of mirrored map around it, so that opposite borders, which Fourier joins, are kept apart."""


def _difference_filters() -> tuple[FloatArray, ...]:
    """Kirsch's eight compass operators and the Laplacian, each of norm 1, (3, 3) float32."""
    ring = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)]
    filters = []
    for turn in range(8):
        compass = np.zeros((3, 3))
        for place, (y, x) in enumerate(ring):
            compass[y, x] = 5 if (place - turn) % 8 < 3 else -3
        filters.append(compass)
    filters.append(np.array([[-1.0, -1, -1], [-1, 8, -1], [-1, -1, -1]]))
    return tuple((f / np.linalg.norm(f)).astype(np.float32) for f in filters)


FILTERS = _difference_filters()


def smooth(values: np.ndarray, image: np.ndarray, fidelity: float, deviation: float) -> FloatArray:
    """The map, smoothed in the context of the image.

    Parameters
    ----------
    values : (H, W) float32.
    image : (H, W, 3) float32.
    fidelity : λ.
    deviation : σ of the weights :math:`W_j = e^{-\\sum_c (D_j ⊗ I_c)^2 / 2σ^2}`.

    Returns
    -------
    (H, W) float32. About 0.6 µs and 90 bytes per pixel.
    """
    from scipy import fft

    inside = np.s_[MARGIN : MARGIN + values.shape[0], MARGIN : MARGIN + values.shape[1]]
    margin = ((MARGIN, MARGIN), (MARGIN, MARGIN))
    values = np.pad(np.asarray(values, np.float32), margin, "symmetric")
    image = np.pad(np.asarray(image, np.float32), (*margin, (0, 0)), "symmetric")
    weights = [_weight(image, f, deviation) for f in FILTERS]
    data = np.asarray(fft.rfft2(values))
    power = sum(np.abs(np.asarray(fft.rfft2(_at_origin(f, values.shape)))) ** 2 for f in FILTERS)
    smoothed = values
    for coupling in COUPLINGS:
        adjoint = np.zeros_like(values)
        for f, weight in zip(FILTERS, weights, strict=True):
            difference = _correlate(smoothed, f)
            limit = weight / np.float32(coupling)
            adjoint += _correlate(difference - np.clip(difference, -limit, limit), f[::-1, ::-1])
        pull = fidelity / coupling
        smoothed = fft.irfft2((pull * data + fft.rfft2(adjoint)) / (pull + power), s=values.shape)
        smoothed = np.asarray(smoothed, np.float32)
    return smoothed[inside]


def _weight(image: FloatArray, small: FloatArray, deviation: float) -> FloatArray:
    """Small where the filter finds an edge in any channel."""
    square = np.sum([_correlate(image[..., channel], small) ** 2 for channel in range(3)], axis=0)
    return np.exp(square / np.float32(-2 * deviation**2))


def _correlate(values: FloatArray, small: FloatArray) -> FloatArray:
    """Correlation with a (3, 3) filter over periodic borders."""
    import cv2

    wrapped = np.pad(values, 1, "wrap")
    return np.asarray(cv2.filter2D(wrapped, -1, np.ascontiguousarray(small))[1:-1, 1:-1], values.dtype)


def _at_origin(small: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """The (3, 3) filter on a periodic grid, its centre on the first pixel."""
    grid = np.zeros(shape, np.float32)
    grid[:3, :3] = small
    return np.roll(grid, (-1, -1), (0, 1))
