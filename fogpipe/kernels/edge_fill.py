"""Unknown pixels filled from known ones along the edges of an image."""

from __future__ import annotations

import cv2
import numpy as np

from fogpipe.kernels.arrays import FloatArray, require_finite, require_maps
from fogpipe.kernels.matting import direct, likeness

MOST_UNKNOWNS = 40_000
"""Pixels that are solved for at once; more are solved for in blocks, and told apart by their colours afterwards."""


def fill(values: np.ndarray, unknown: np.ndarray, image: np.ndarray) -> FloatArray:
    """Laplace's equation in the unknown pixels, with less flow between unlike colours; all others are held.

    Parameters
    ----------
    values : (H, W) float, with a first guess in the unknown pixels, which is kept where no known one is connected. NaN
        or infinite pixels are left alone.
    unknown : (H, W) bool.
    image : (H, W, 3) float, linear light.

    Returns
    -------
    (H, W) array of the dtype of ``values``. 1 to 3 µs per unknown pixel, more where they are few.
    """
    require_maps(values=(values, 1), unknown=(unknown, 1), image=(image, 3))
    require_finite(image=image)
    guide = np.sqrt(np.maximum(image, 0)).astype(np.float32)
    block = int(np.ceil(np.sqrt(np.count_nonzero(unknown) / MOST_UNKNOWNS)))
    if block <= 1:
        return direct(values, unknown, guide)
    return _from_blocks(values, unknown, guide, block)


def _from_blocks(values: np.ndarray, unknown: np.ndarray, guide: FloatArray, block: int) -> FloatArray:
    """Solve for blocks of pixels; each unknown pixel takes the mean of those around it, the likest above all."""
    height, width = (-(-side // block) for side in values.shape)
    finite = np.isfinite(values)
    known = finite & ~unknown
    coarse, counted = (_block_means(np.where(known, of, 0), height, width) for of in (values, np.ones_like(values)))
    guess = _block_means(np.where(finite, values, 0), height, width)
    guess /= np.maximum(_block_means(finite.astype(values.dtype), height, width), 1e-6)
    free = counted == 0
    colours = _block_means(guide, height, width)
    solved = direct(np.where(free, guess, coarse / np.maximum(counted, 1e-6)), free, colours)

    y, x = np.nonzero(unknown)
    here = np.flatnonzero(unknown)
    total, weights = np.zeros(len(y)), np.zeros(len(y))
    both = np.concatenate([guide.reshape(-1, 3), colours.reshape(-1, 3)])[None]
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            row, column = np.clip(y // block + dy, 0, height - 1), np.clip(x // block + dx, 0, width - 1)
            apart = np.hypot(y - (row + 0.5) * block, x - (column + 0.5) * block) / block
            weight = np.exp(-(apart**2)) * likeness(both, here, guide.shape[0] * guide.shape[1] + row * width + column)
            total += weight * solved[row, column]
            weights += weight
    filled = values.copy()
    filled[unknown] = total / weights
    return filled


def _block_means(array: np.ndarray, height: int, width: int) -> FloatArray:
    return np.asarray(cv2.resize(array, (width, height), interpolation=cv2.INTER_AREA), array.dtype)
