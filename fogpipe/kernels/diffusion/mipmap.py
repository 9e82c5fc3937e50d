"""Blur by an interpolated pyramid of ever wider Gaussians, each of what is as far or farther (Elek et al. 2013)."""

from __future__ import annotations

import math

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.diffusion.published import prepared

MASK_WIDTH = 0.25
"""Octaves of σ within which a pixel fades out of the mask of a level."""


def mipmap(layer: np.ndarray, scale: np.ndarray, finest: float) -> FloatArray:
    """Each pixel between the two levels whose widths enclose its own: the cost does not depend on σ.

    Level n has added the variance 4ⁿ⁻¹ px² and is kept at the size at which that is at least one cell. Its means leave
    out what is to be blurred less than half as much as the level is wide, so that a sharp foreground does not leak
    into what lies behind. The mean of the image is not conserved.
    """
    import cv2

    layer, scale = prepared(layer, scale, finest)
    rows, columns = scale.shape
    added = np.sqrt(scale * scale - scale.dtype.type(finest**2))  # standard deviation to add, px
    octave = np.log2(np.maximum(added, scale.dtype.type(1e-3)))
    result = layer.copy()
    widest = float(added.max())
    previous, previous_width = layer, 0.0
    level = 0
    while previous_width < widest:
        width = 2.0 ** (level - 1)
        shrink = max(1, int(width))
        mask = np.clip((octave - (math.log2(width) - 1 - MASK_WIDTH)) / MASK_WIDTH, 0, 1).astype(layer.dtype)[..., None]
        size = (max(1, -(-columns // shrink)), max(1, -(-rows // shrink)))
        # Means over cells, and lines between their centres, have a width of their own.
        rest = math.sqrt(max(width**2 - (shrink**2 - 1) / 6, 0.01))
        sigma = (rest * size[0] / columns, rest * size[1] / rows)

        def smooth(part: np.ndarray, size=size, sigma=sigma) -> np.ndarray:
            small = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
            small = cv2.GaussianBlur(small, (0, 0), sigmaX=sigma[0], sigmaY=sigma[1], borderType=cv2.BORDER_REFLECT)
            return cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR).reshape(part.shape)

        weight = smooth(mask)
        wide = np.where(weight > 1e-3, smooth(layer * mask) / np.maximum(weight, 1e-3), previous)
        # Linear in variance between two Gaussians.
        share = (added**2 - previous_width**2) / (width**2 - previous_width**2)
        inside = (added > previous_width)[..., None]
        result = np.where(inside, previous + np.clip(share, 0, 1)[..., None] * (wide - previous), result)
        previous, previous_width = wide, width
        level += 1
    return result.astype(layer.dtype)
