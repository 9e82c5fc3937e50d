"""How much of each pixel at the edge of the sky is scene, told by its colour."""

from __future__ import annotations

import cv2
import numpy as np

from fogpipe.kernels.arrays import FloatArray, require_finite, require_maps

INDISTINCT = 1e-3
"""Squared contrast of scene and sky below which colours say nothing: 3 %."""
SOME = 0.005
"""Share of a window that is sky, or scene, from which on its mean is trusted fully."""


def share_of_scene(
    image: np.ndarray, margin: np.ndarray, scene: np.ndarray, sky: np.ndarray, distance: np.ndarray, width: float
) -> FloatArray:
    """The share α of the scene in each pixel of the margin, (count,) float32, in raster order.

    A pixel is taken for a mixture α F + (1 − α) B of the mean colour F of the scene around it and B of the sky around
    it. Where the two differ by less than the sky itself varies, α falls from the scene to the end of the margin, or
    is 1 in a gap. Where no sky is within sixteen widths, α is 1.

    Parameters
    ----------
    image : (H, W, 3), linear light.
    margin : (H, W) bool, the pixels that are asked for.
    scene, sky : (H, W) bool, pixels that are certain to be either; there are some of both.
    distance : (H, W) float, to the nearest pixel of the scene, px.
    width : of the margin, px.
    """
    require_maps(image=(image, 3), margin=(margin, 1), scene=(scene, 1), sky=(sky, 1), distance=(distance, 1))
    require_finite(image=image)
    reach = max(1, round(width))
    rows = np.flatnonzero(margin.any(axis=1))
    near = slice(max(0, rows[0] - 16 * reach), rows[-1] + 16 * reach + 1)
    image, margin, scene, sky, distance = (array[near] for array in (image, margin, scene, sky, distance))
    light = np.minimum(image, 2 * max(_middle(image, scene), _middle(image, sky)), dtype=np.float32)
    front, _, _ = _around(light, scene, margin, [reach])
    back, spread, (near_sky, beside_sky) = _around(light, sky, margin, [16 * reach, 2 * reach])
    contrast = front - back
    doubt = spread + INDISTINCT * ((front**2).sum(axis=1) + (back**2).sum(axis=1)) + np.float32(1e-12)
    by_distance = 1 - beside_sky * distance[margin] / np.float32(width + 1)
    share = ((light[margin] - back) * contrast).sum(axis=1) + doubt * by_distance
    share = np.clip(share / ((contrast**2).sum(axis=1) + doubt), 0, 1)
    return 1 - near_sky * (1 - share)


def _middle(image: np.ndarray, mask: np.ndarray) -> np.float32:
    """The median of the masked pixels in the brightest channel, of some where there are many; no lamp is part of it."""
    some = image[::3, ::3][mask[::3, ::3]]
    pixels = some if len(some) > 100 else image[mask]
    return np.float32(np.median(pixels, axis=0).max() if len(pixels) else 0)


def _around(
    light: FloatArray, mask: np.ndarray, wanted: np.ndarray, reaches: list[int]
) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
    """Of the masked pixels around each that is wanted: mean colour, (count, 3), its variance, and how many.

    From a wide window to a narrow one; where a narrow one holds few of them, the wider one counts.
    """
    masked = np.dstack([light, np.ones(light.shape[:2], np.float32)])
    masked[~mask] = 0
    squares = np.einsum("hwc,hwc->hw", masked[..., :3], masked[..., :3])
    count = np.count_nonzero(wanted)
    mean, square, trust = np.zeros((count, 3), np.float32), np.zeros(count, np.float32), []
    for reach in reaches:
        size = (2 * reach + 1, 2 * reach + 1)
        around = cv2.blur(masked, size, borderType=cv2.BORDER_CONSTANT)[wanted]
        share = np.maximum(around[:, 3], np.float32(1e-9))
        weight = np.minimum(1, around[:, 3] / np.float32(SOME))
        mean += weight[:, None] * (around[:, :3] / share[:, None] - mean)
        square += weight * (cv2.blur(squares, size, borderType=cv2.BORDER_CONSTANT)[wanted] / share - square)
        trust.append(weight)
    return mean, np.maximum(square - (mean**2).sum(axis=1), 0), trust
