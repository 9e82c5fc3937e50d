"""What a person says about depth, as arrays: polygons, receding planes, shading, and soft masks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fogpipe.kernels.arrays import FloatArray

Point = tuple[float, float]
"""(x, y) in shares of the picture: (0, 0) is the upper left corner of its first pixel, (1, 1) the lower right corner of
its last."""

_ALIKE = 0.1
"""Standard deviation, in values of [0, 1], within which two pixels look alike."""

_REACH = 1.5
"""Radius of the filter over its standard deviation."""


def polygon(shape: tuple[int, ...], corners: Sequence[Point]) -> np.ndarray:
    """Mask (H, W) of the pixels whose centre is in a polygon; where it crosses itself, those that are in it an odd
    number of times."""
    from skimage.draw import polygon2mask

    height, width = shape
    return polygon2mask(shape, [(y * height - 0.5, x * width - 0.5) for x, y in corners])


def along_line(shape: tuple[int, ...], start: Point, end: Point) -> FloatArray:
    """0 at one point of the picture, 1 at another, linear in between and the same across; (H, W) float32 in [0, 1].

    Raises
    ------
    ValueError
        If both are the same point.
    """
    height, width = shape
    (x0, y0), (x1, y1) = ((x * width - 0.5, y * height - 0.5) for x, y in (start, end))
    length_squared = (x1 - x0) ** 2 + (y1 - y0) ** 2
    if not length_squared > 0:
        raise ValueError(f"a plane needs two points, but both are at {start}.")
    rows = (np.arange(height) - y0) * ((y1 - y0) / length_squared)
    columns = (np.arange(width) - x0) * ((x1 - x0) / length_squared)
    return np.clip(rows[:, None] + columns, 0, 1).astype(np.float32)


def brightness(luminance: FloatArray, region: np.ndarray, span: tuple[float, float], smooth: float) -> FloatArray:
    """Logarithm of the luminance, 0 and 1 at two quantiles of a region, smoothed but for edges; (H, W) float32."""
    import cv2

    light = luminance.astype(np.float32)
    positive = light[region & (light > 0)]
    if positive.size == 0:
        return np.zeros(region.shape, np.float32)
    stops = np.log2(np.maximum(light, positive.max() * np.float32(2.0**-16)))
    low, high = np.quantile(stops[region], span)
    if not high > low:
        return np.full(region.shape, 0.5, np.float32)
    level = np.clip((stops - low) / (high - low), 0, 1).astype(np.float32)
    if smooth > 0:
        level = cv2.bilateralFilter(level, -1, _ALIKE, smooth)
    return np.asarray(level, np.float32)


def soft(mask: np.ndarray, image: FloatArray, radius: float) -> FloatArray:
    """A mask as shares from 0 to 1 that follow the edges of an image, (H, W) float32.

    Each pixel takes the mean of the mask over pixels near by that look like it, drawn towards 0 or 1.

    References
    ----------
    Petschnigg et al. 2004, *Digital photography with flash and no-flash image pairs* (joint bilateral filter).
    """
    import cv2

    shares = np.zeros(mask.shape, np.float32)
    if not mask.any():
        return shares
    reach = math.ceil(_REACH * radius)
    around = _bounds(mask, margin=2 * reach)
    middle = float(np.mean(image))
    guide = np.maximum(image[around], 0).astype(np.float32)
    guide = guide / (guide + np.float32(middle if middle > 0 else 1))  # HDR into [0, 1)
    share = cv2.ximgproc.jointBilateralFilter(guide, mask[around].astype(np.float32), 2 * reach + 1, _ALIKE, radius)
    share = np.clip(share, 0, 1)
    shares[around] = share * share * (3 - 2 * share)
    return shares


def _bounds(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    """The smallest rectangle with all of a mask, and a margin around it within the picture."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return tuple(slice(max(0, at[0] - margin), at[-1] + 1 + margin) for at in (rows, columns))  # type: ignore[return-value]
