"""How strong the noise of an image is."""

from __future__ import annotations

import numpy as np

LEAST_SIDE = 8
"""Pixels; in a smaller image noise cannot be told from what it shows."""


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
