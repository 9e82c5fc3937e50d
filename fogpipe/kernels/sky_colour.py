"""How much of each pixel at the edge of the sky is scene, told by its colour."""

from __future__ import annotations

import cv2
import numpy as np

from fogpipe.kernels.arrays import FloatArray, require_finite, require_maps

INDISTINCT = 1e-3
"""Squared contrast of scene and sky below which colours say nothing: 3 %."""


def share_of_scene(
    image: np.ndarray, margin: np.ndarray, scene: np.ndarray, sky: np.ndarray, distance: np.ndarray, width: float
) -> FloatArray:
    """The share α of the scene in each pixel of the margin, (count,) float32, in raster order.

    A pixel is taken for a mixture α F + (1 − α) B of the mean colour F of the scene around it and B of the sky around
    it. Where the two hardly differ, α falls from the scene to the end of the margin.

    Parameters
    ----------
    image : (H, W, 3), linear light.
    margin : (H, W) bool, the pixels that are asked for.
    scene, sky : (H, W) bool, pixels that are certain to be either. Neither is empty.
    distance : (H, W) float, to the nearest pixel of the scene, px.
    width : of the margin, px.
    """
    require_maps(image=(image, 3), margin=(margin, 1), scene=(scene, 1), sky=(sky, 1), distance=(distance, 1))
    require_finite(image=image)
    light = image.astype(np.float32, copy=False)
    reach = max(1, round(width))
    front = _mean_around(light, scene, margin, [reach])
    back = _mean_around(light, sky, margin, [8 * reach, 2 * reach])
    contrast = front - back
    indistinct = INDISTINCT * ((front**2).sum(axis=1) + (back**2).sum(axis=1)) + np.float32(1e-12)
    by_distance = 1 - distance[margin] / np.float32(width + 1)
    share = ((light[margin] - back) * contrast).sum(axis=1) + indistinct * by_distance
    return np.clip(share / ((contrast**2).sum(axis=1) + indistinct), 0, 1)


def _mean_around(light: FloatArray, mask: np.ndarray, wanted: np.ndarray, reaches: list[int]) -> FloatArray:
    """Mean colour, (count, 3), of the masked pixels around each that is wanted: of near ones, or else of farther ones.

    Where the mask covers a hundredth of a window, its mean counts as much as that of the wider window before it.
    """
    masked = np.dstack([light, np.ones(light.shape[:2], np.float32)])
    masked[~mask] = 0
    total = cv2.sumElems(masked)
    mean = np.array(total[:3], np.float32) / np.float32(total[3])
    for reach in reaches:
        around = cv2.blur(masked, (2 * reach + 1, 2 * reach + 1), borderType=cv2.BORDER_CONSTANT)[wanted]
        mean = (around[:, :3] + np.float32(0.01) * mean) / (around[:, 3:] + np.float32(0.01))
    return mean
