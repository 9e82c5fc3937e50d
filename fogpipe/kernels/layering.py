"""What a person says about depth, as arrays: polygons, receding planes, shading, thin structure, and soft masks."""

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

_LINE = 0.7
"""Standard deviation, in pixels, of the filter that joins a thin line where the grid of pixels cuts it into dashes."""

_LEVELS = 2.0
"""Standard deviation, in pixels, of the filter that smooths the steps of 8-bit medians."""

_BACKGROUND, _THING = 0.1, 0.5
"""Of the most that anything near by differs, up to which part a pixel is background, and from which it is not."""


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


def standing_out(mask: np.ndarray, image: FloatArray, width: int, contrast: float) -> FloatArray:
    """Share of each pixel of a mask that belongs to something thin before a smooth background, (H, W) float32.

    How much a pixel differs from the background, Σ|I − B| / Σ(I + B) over the channels, is taken relative to the most
    that anything near by does, or to a least contrast.

    Parameters
    ----------
    mask : (H, W) bool. Shares fade out over the last pixels before its border, half of the width.
    image : (H, W, 3) float.
    width : Of the widest thing that is thin, pixels, 1 or more.
    contrast : Least difference that counts as whole, in (0, 1].
    """
    import cv2

    shares = np.zeros(mask.shape, np.float32)
    if not mask.any():
        return shares
    around = _bounds(mask, margin=6 * width + 12)  # the reaches of all filters together
    light = np.maximum(image[around], 0).astype(np.float32)
    background = _background(image, around, width)
    both = (light + background).sum(axis=2)
    difference = np.abs(light - background).sum(axis=2)
    differs = np.divide(difference, both, out=np.zeros_like(both), where=both > 0)
    differs = cv2.GaussianBlur(differs, (0, 0), _LINE)
    near_by = np.ones((2 * width + 1, 2 * width + 1), np.uint8)
    most = cv2.GaussianBlur(cv2.dilate(differs, near_by), (0, 0), width / 2)
    low, high = _BACKGROUND, _THING
    share = np.clip((differs / np.maximum(most, np.float32(contrast)) - low) / (high - low), 0, 1)
    # Half of a square around the border is inside, and all of it from half a square on.
    inside = cv2.blur(mask[around].astype(np.float32), (width | 1, width | 1), borderType=cv2.BORDER_REPLICATE)
    shares[around] = _drawn_apart(share) * np.clip(2 * inside - 1, 0, 1)
    return shares


def _background(image: FloatArray, part: tuple[slice, slice], width: int) -> FloatArray:
    """Median of each channel over squares of twice the width, of which thin things fill less than half."""
    import cv2

    tones, middle = _tones(image, part)
    levels = cv2.medianBlur(np.rint(255 * tones).astype(np.uint8), 2 * width + 1)
    tones = cv2.GaussianBlur((levels / 255).astype(np.float32), (0, 0), _LEVELS)
    tones = np.minimum(tones, np.float32(254.5 / 255))  # the last level has no upper end
    return middle * tones / (1 - tones)


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
    guide, _ = _tones(image, around)
    share = cv2.ximgproc.jointBilateralFilter(guide, mask[around].astype(np.float32), 2 * reach + 1, _ALIKE, radius)
    shares[around] = _drawn_apart(np.clip(share, 0, 1))
    return shares


def _tones(image: FloatArray, part: tuple[slice, slice]) -> tuple[FloatArray, np.float32]:
    """Light of any strength in [0, 1), for a part of an image, and the light of which they are half: its median."""
    lit = image[image > 0]
    middle = np.float32(np.median(lit) if lit.size else 1)
    light = np.maximum(image[part], 0).astype(np.float32)
    return light / (light + middle), middle


def _drawn_apart(share: np.ndarray) -> FloatArray:
    """Shares drawn towards 0 and 1, smoothly."""
    return share * share * (3 - 2 * share)


def _bounds(mask: np.ndarray, margin: int) -> tuple[slice, slice]:
    """The smallest rectangle with all of a mask, and a margin around it within the picture."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return tuple(slice(max(0, at[0] - margin), at[-1] + 1 + margin) for at in (rows, columns))  # type: ignore[return-value]
