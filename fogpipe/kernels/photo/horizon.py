"""The horizon that sky ends at, and the depth of a plain ground below it and of what stands on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fogpipe.kernels.arrays import FloatArray

WIDE = (0.5, 0.75)
"""Share of the upper edge that is sky at which its lower end counts as no horizon, and at which as one for certain."""
REACH = 80
"""Percentile of the lower ends of the sky in all columns that is the horizon: objects hide it in the others."""
ASIDE = np.float32(3)
"""Rows that a step to the next column costs on the way along an object: masts and towers widen by less."""


class Horizon(NamedTuple):
    """The row of the horizon as a share of the height, and how much to trust it, 0 to 1."""

    y: float
    confidence: float


def horizon_of(sky: FloatArray) -> Horizon:
    """Where sky ends, if it spans the photo: a pane or a gap between houses says nothing about the horizon.

    Parameters
    ----------
    sky : (H, W) likelihood of sky.
    """
    import cv2

    solid = cv2.morphologyEx((sky > 0.5).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0
    columns, upper = solid.any(axis=0), sky[:3].max(axis=0) > 0.5
    if not columns.any():
        return Horizon(0.0, 0.0)
    ends = len(sky) - solid[::-1, columns].argmax(axis=0)
    none, certain = WIDE
    confidence = np.clip((upper.mean() - none) / (certain - none), 0, 1)
    return Horizon(float(min(np.percentile(ends, REACH) / len(sky), 0.98)), float(confidence))


def ground_nearness(
    hidden: FloatArray, horizon: Horizon, prominence: FloatArray, weight: float, height: float
) -> FloatArray:
    """Inverse depth of a plane ground below the horizon, and of what stands on it; 1 is the lower edge of the image.

    The inverse depth of the ground at the row y is proportional to y − y₀, nothing at the horizon y₀, whatever is
    seen there; where the horizon is low, even the lower edge is far. What stands out from the ground is nearer by a
    factor, 1 + ``weight`` × ``prominence``. What hides the sky is an object that stands on the ground. Of
    objects of one true height, the one that looks taller is nearer, in proportion.

    Parameters
    ----------
    hidden, prominence : (H, W) share of each pixel that hides the sky, and likelihood of standing out.
    height : to which objects reach above the camera, in camera heights.
    """
    rows = len(hidden)
    y = (np.arange(rows, dtype=np.float32)[:, None] + np.float32(0.5)) / rows
    below = np.float32(max(1 - horizon.y, 0.5))
    ground = np.maximum(y - np.float32(horizon.y), 0) / below
    ground = ground * (1 + np.float32(weight) * prominence)
    above = max(1, round(horizon.y * rows))
    standing = _spread(upright_length(hidden[:above]), hidden[:above]) / (rows * below * np.float32(height))
    standing = np.concatenate([standing, np.repeat(standing[-1:], rows - above, axis=0)])
    return np.minimum(np.maximum(ground, standing), 1)


def upright_length(hidden: FloatArray) -> FloatArray:
    """Length of the longest upright path through each pixel that never leaves what hides the sky, in pixels.

    All of a mast is on one path, from its top to either leg, and has one length: it stands at one range. A step aside
    costs :data:`ASIDE`, so what stands beside it keeps a length of its own.

    Parameters
    ----------
    hidden : (H, W) share of each pixel that hides the sky; it does where that is above a half.
    """
    solid = (hidden > 0.5).astype(np.float32)
    from_top, from_foot = _longest_from_top(solid), _longest_from_top(solid[::-1])[::-1]
    return np.maximum(from_top + from_foot - solid, 0)


def _longest_from_top(solid: FloatArray) -> FloatArray:
    """Length of the longest path that ends at each pixel from above. Steps aside are free to go on in a row."""
    lengths = np.zeros_like(solid)
    length = np.zeros(solid.shape[1], np.float32)
    for row, here in enumerate(solid):
        length = (length + 1) * here
        leaving = np.float32(len(solid)) * np.cumsum(1 - here)  # more than any path is long
        way = ASIDE * np.arange(here.size, dtype=np.float32)
        from_left = np.maximum.accumulate(length + way + leaving) - way - leaving
        from_right = np.maximum.accumulate((length - way - leaving)[::-1])[::-1] + way + leaving
        length = np.maximum(from_left, from_right) * here
        lengths[row] = length
    return lengths


def _spread(length: FloatArray, hidden: FloatArray) -> FloatArray:
    """The lengths, smooth, and carried over the edges of the objects, which are found anew at the size of the photo."""
    import cv2

    solid = (hidden > 0.5).astype(np.float32)
    width = max(1.0, 0.01 * hidden.shape[1])
    weight = cv2.GaussianBlur(solid, (0, 0), width)
    return cv2.GaussianBlur(length * solid, (0, 0), width) / np.maximum(weight, np.float32(1e-3))
