"""How strong the noise of an image is."""

from __future__ import annotations

import numpy as np

LEAST_SIDE = 8
"""Pixels; in a smaller image noise cannot be told from what it shows."""
REGION = 64
"""Side of the regions, pixels."""
SMOOTHEST = 10
"""Per cent of the regions that are taken to hold noise alone."""


def deviation(image: np.ndarray) -> float:
    """Standard deviation of the noise of an (H, W, 3) image by scikit-image's median of wavelet details.

    Texture counts as noise in part: 1 of 255 in an outdoor scene without noise. 0 for an image of less than 8 pixels in
    a direction, and for one with rounding errors only.
    """
    if min(image.shape[:2]) < LEAST_SIDE:
        return 0.0
    from skimage.restoration import estimate_sigma

    varying = image.max(axis=(0, 1)) > image.min(axis=(0, 1))
    if not varying.all():  # scikit-image warns of a channel without any detail
        return 0.0
    sigma = float(estimate_sigma(image, channel_axis=2, average_sigmas=True))
    return sigma if sigma > 1e-5 * float(np.abs(image).max()) else 0.0


def deviation_of_smooth_parts(image: np.ndarray) -> float:
    """Standard deviation of the noise of an (H, W, 3) image: of the diagonal wavelet details in its smooth regions.

    Leaves and bricks, which :func:`deviation` takes for noise in part, would be smoothed away by it. Here each region
    has its own deviation, and the tenth percentile counts. What has no detail at all, black or white, is passed
    over. 0 for an image of less than 8 pixels in a direction, and for one with rounding errors only.
    """
    if min(image.shape[:2]) < LEAST_SIDE:
        return 0.0
    import pywt

    _, (_, _, details) = pywt.dwt2(np.asarray(image, np.float32), "db2", axes=(0, 1))
    squares = np.square(details[1:-1, 1:-1]).mean(axis=2)  # without those that saw beyond the border
    seen = squares > 1e-10 * float(np.abs(image).max()) ** 2
    edges = [np.arange(0, max(1, side - REGION // 4), REGION // 2) for side in squares.shape]
    sums, count, size = (
        np.add.reduceat(np.add.reduceat(values, edges[0], axis=0), edges[1], axis=1)
        for values in (np.where(seen, squares, 0), seen.astype(np.float32), np.ones_like(squares))
    )
    noisy = count > size / 4
    return float(np.sqrt(np.percentile(sums[noisy] / count[noisy], SMOOTHEST))) if noisy.any() else 0.0
