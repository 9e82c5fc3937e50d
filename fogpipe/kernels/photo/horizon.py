"""The horizon that sky ends at, and the depth of a plain ground below it and of what stands on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fogpipe.kernels.arrays import FloatArray

WIDE = (0.5, 0.75)
"""Share of the upper edge that is sky at which its lower end counts as no horizon, and at which as one for certain."""
REACH = 80
"""Percentile of the lower ends of the sky in all columns that is the horizon: objects hide it in the others."""
TALLEST = 0.6
"""Nearness of an object that hides the sky from the horizon to the upper edge."""


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


def ground_nearness(sky: FloatArray, horizon: Horizon, prominence: FloatArray, weight: float) -> FloatArray:
    """Inverse depth of a plane ground below the horizon, and of what stands on it; 1 is the lower edge of the image.

    The inverse depth of the ground at the row y is proportional to y − y₀, nothing at the horizon y₀, whatever is
    seen there; where the horizon is low, even the lower edge is far. What stands out from the ground is nearer by a
    factor, 1 + ``weight`` × ``prominence``. What hides the sky is an object, nearer the higher it reaches; it stands
    on the ground where that is as near.

    Parameters
    ----------
    sky, prominence : (H, W) likelihood of sky, and of standing out.
    """
    import cv2

    rows = len(sky)
    y = (np.arange(rows, dtype=np.float32)[:, None] + np.float32(0.5)) / rows
    ground = np.maximum(y - np.float32(horizon.y), 0) / np.float32(max(1 - horizon.y, 0.5))
    ground = ground * (1 + np.float32(weight) * prominence)
    above = max(1, round(horizon.y * rows))
    hidden = 1 - np.minimum(sky[:above] / np.float32(0.5), 1)
    height = np.float32(TALLEST) * hidden.mean(axis=0, keepdims=True)
    height = cv2.GaussianBlur(height, (0, 0), max(1.0, 0.01 * sky.shape[1]))
    return np.minimum(np.maximum(ground, height), 1)
