"""How strong the noise of an image is."""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray

LEAST_SIDE = 8
"""Pixels; in a smaller image noise cannot be told from what it shows."""
REGION = 64
"""Side of the regions, pixels."""
SMOOTHEST = 10
"""Per cent of the regions that are taken to hold the least texture."""
TEXTURE = 6.0
"""Power of the details of texture over that of details half as large, 1 in noise. 6 to 11 in the smoothest regions of
eight photographs; of a ninth it was 3.5."""
EVEN, UNEVEN = 1.2, 1.5
"""Power of details that three tenths of the regions stay below, over that which one tenth does: up to here as in noise,
from there on as in texture, which haze makes weaker with distance. 1.2 and 1.4 in two photographs with grain, 1.7 to
400 in 31 pictures without."""
COLOURED = 0.2
"""Least share of the power of details that differs between channels if they are grain: 0.4 there, 0.04 in bricks."""
GROWS = 2.0, 4.0
"""From here on and fully: growth of noise that is no longer white."""
FEWEST_REGIONS = 20
"""In fewer, texture may be as strong in one as in the next."""


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
    from texture, v₁ = n + s, and details twice as large have the power v₂ = n + 6 s. Grain, which a camera or JPEG has
    made larger than a pixel, grows as texture does, but it is as strong in one region as in the next, and not the same
    in all channels: then v₂ counts. What has no detail at all, black or white, is passed over. 0 for an image of less
    than 8 pixels in a direction, and for one with rounding errors only.
    """
    if min(image.shape[:2]) < LEAST_SIDE:
        return 0.0
    seen, *powers = _powers(image)
    count, size, *sums = (_over_regions(values) for values in (seen, np.ones_like(seen), *(seen * p for p in powers)))
    noisy = count > size / 4
    if not noisy.any():
        return 0.0
    small, large, coloured = (total[noisy] / count[noisy] for total in sums)
    least = np.percentile(small, SMOOTHEST)
    smooth = small <= least
    growth = large[smooth].sum() / small[smooth].sum()
    white = least * np.clip((TEXTURE - growth) / (TEXTURE - 1), 0, 1)
    grain = np.clip((growth - GROWS[0]) / (GROWS[1] - GROWS[0]), 0, 1) * _grain(large, coloured)
    return float(np.sqrt(max(white, grain)))


def _powers(image: np.ndarray) -> tuple[FloatArray, ...]:
    """For squares of 4 × 4 pixels: 1 where there are details and 0 where not, their power, that of details twice as
    large, and half of that of the differences of these between the channels.
    """
    import pywt

    planes = np.ascontiguousarray(np.moveaxis(image, 2, 0), np.float32)
    rest, (_, _, details) = pywt.dwt2(planes, "db2")
    _, (_, _, larger) = pywt.dwt2(rest, "db2")
    rows, columns = ((side // 2 - 1) for side in details.shape[1:])
    # Without those that saw beyond the border.
    every = np.square(details[:, 1 : 2 * rows + 1, 1 : 2 * columns + 1]).mean(axis=0)
    fine = (every[::2, ::2] + every[::2, 1::2] + every[1::2, ::2] + every[1::2, 1::2]) / 4
    larger = larger[:, 1 : rows + 1, 1 : columns + 1]
    differences = larger - np.roll(larger, 1, axis=0)
    seen = fine > 1e-10 * float(np.abs(image).max()) ** 2
    return seen.astype(np.float32), fine, np.square(larger).mean(axis=0), np.square(differences).mean(axis=0) / 2


def _over_regions(values: FloatArray) -> FloatArray:
    """Sums over regions of squares of 4 × 4 pixels."""
    rows, columns = (np.arange(0, max(1, side - REGION // 8), REGION // 4) for side in values.shape)
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)


def _grain(power: FloatArray, coloured: FloatArray) -> float:
    """Least power of regions, as far as it is even and differs between the channels; 0 where too few could tell."""
    least, more = np.percentile(power, [SMOOTHEST, 3 * SMOOTHEST])
    if power.size < FEWEST_REGIONS or least <= 0:
        return 0.0
    share = coloured[power <= least].sum() / power[power <= least].sum()
    return least * np.clip((UNEVEN - more / least) / (UNEVEN - EVEN), 0, 1) * np.clip(share / COLOURED, 0, 1)
