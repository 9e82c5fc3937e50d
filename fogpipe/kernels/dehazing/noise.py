"""How strong the noise of an image is."""

from __future__ import annotations

import numpy as np

LEAST_SIDE = 8
"""Pixels; in a smaller image noise cannot be told from what it shows."""
REGION = 64
"""Side of the regions, pixels."""
SMOOTHEST = 10
"""Per cent of the regions that are taken to hold the least texture."""
TEXTURE = 6.0
"""Power of the details of texture over that of details half as large, 1 in noise. 6 to 11 in the smoothest regions of
eight photographs; of a ninth it was 3.5."""


def deviation(image: np.ndarray) -> float:
    """Standard deviation of the noise of an (H, W, 3) image by scikit-image's median of wavelet details.

    Texture counts as noise in part: 1 of 255 in an outdoor scene without noise. 0 for an image of less than 8 pixels in
    a direction, and for one with rounding errors only.
    """
    if min(image.shape[:2]) < LEAST_SIDE:
        return 0.0
    from skimage.restoration import estimate_sigma

    planes = np.ascontiguousarray(np.moveaxis(image, 2, 0))
    if (planes.max(axis=(1, 2)) == planes.min(axis=(1, 2))).any():  # scikit-image warns of a channel without detail
        return 0.0
    sigma = float(estimate_sigma(planes, channel_axis=0, average_sigmas=True))
    return sigma if sigma > 1e-5 * float(np.abs(image).max()) else 0.0


def deviation_of_smooth_parts(image: np.ndarray) -> float:
    """Standard deviation of the noise of an (H, W, 3) image: of the diagonal wavelet details in its smooth regions.

    Leaves and bricks, which :func:`deviation` takes for noise in part, would be smoothed away by it. Here each region
    has its own power v₁ of details, and the tenth percentile counts, less what is texture there: of n from noise and s
    from texture, v₁ = n + s, and details twice as large have the power v₂ = n + 6 s. What has no detail at all, black
    or white, is passed over. 0 for an image of less than 8 pixels in a direction, and for one with rounding errors
    only.
    """
    if min(image.shape[:2]) < LEAST_SIDE:
        return 0.0
    import pywt

    planes = np.ascontiguousarray(np.moveaxis(image, 2, 0), np.float32)
    rest, (_, _, details) = pywt.dwt2(planes, "db2")
    _, (_, _, larger) = pywt.dwt2(rest, "db2")
    rows, columns = ((side // 2 - 1) for side in details.shape[1:])
    # Without those that saw beyond the border.
    every = np.square(details[:, 1 : 2 * rows + 1, 1 : 2 * columns + 1]).mean(axis=0)
    fine = (every[::2, ::2] + every[::2, 1::2] + every[1::2, ::2] + every[1::2, 1::2]) / 4
    coarse = np.square(larger[:, 1 : rows + 1, 1 : columns + 1]).mean(axis=0)
    seen = fine > 1e-10 * float(np.abs(image).max()) ** 2
    edges = [np.arange(0, max(1, side - REGION // 8), REGION // 4) for side in fine.shape]
    small, large, count, size = (
        np.add.reduceat(np.add.reduceat(values, edges[0], axis=0), edges[1], axis=1)
        for values in (np.where(seen, fine, 0), np.where(seen, coarse, 0), seen.astype(np.float32), np.ones_like(fine))
    )
    noisy = count > size / 4
    if not noisy.any():
        return 0.0
    power = small[noisy] / count[noisy]
    least = np.percentile(power, SMOOTHEST)
    smooth = power <= least
    growth = float(large[noisy][smooth].sum() / small[noisy][smooth].sum())
    return float(np.sqrt(least * np.clip((TEXTURE - growth) / (TEXTURE - 1), 0, 1)))
