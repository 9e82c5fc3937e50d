"""Pixels of a picture that may show its airlight, each found by another sign."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fogpipe.kernels.arrays import FloatArray


def at_horizon(
    image: FloatArray, luminance: FloatArray, sky: np.ndarray, horizon: float, brighter: float
) -> FloatArray:
    """Pixels (count, 3) of the brighter share of the lowest share of the sky, an (H, W) mask."""
    pixels = np.flatnonzero(sky)  # in raster order: the last are the lowest
    lowest = pixels[-max(1, round(horizon * pixels.size)) :]
    return image.reshape(-1, 3)[lowest[largest(luminance.reshape(-1)[lowest], brighter)]]


def brightest_patches(image: FloatArray, luminance: FloatArray, share: float, patch: int) -> FloatArray:
    """All pixels, (count, 3), of the share of square patches whose darkest pixel is brightest."""
    height, width, _ = image.shape
    rows, columns = np.arange(0, height, patch), np.arange(0, width, patch)
    darkest = np.minimum.reduceat(np.minimum.reduceat(luminance, rows, axis=0), columns, axis=1)
    brightest = largest(darkest.reshape(-1), share)
    pieces = [
        image[y : y + patch, x : x + patch].reshape(-1, 3)
        for y, x in zip(rows[brightest // columns.size], columns[brightest % columns.size], strict=True)
    ]
    return np.concatenate(pieces)


def brightest_quarter(image: FloatArray, smallest: int) -> FloatArray:
    """Pixels (count, 3) of the quarter with the largest mean less deviation, and of its quarters in turn."""
    while min(image.shape[:2]) >= 2 and max(image.shape[:2]) > smallest:
        y, x = image.shape[0] // 2, image.shape[1] // 2
        quarters = [image[:y, :x], image[:y, x:], image[y:, :x], image[y:, x:]]
        image = max(quarters, key=lambda quarter: (quarter.mean(axis=(0, 1)) - quarter.std(axis=(0, 1))).sum())
    return image.reshape(-1, 3)


def largest(values: np.ndarray, share: float) -> np.ndarray:
    """Places of the largest share of the values, at least of one."""
    count = max(1, round(share * values.size))
    return np.argpartition(values, -count)[-count:]


def discs(shape: tuple[int, ...], points: Sequence[tuple[float, float]], radius: float) -> np.ndarray:
    """(H, W) bool, true within the radius of a point, given as shares of width and height."""
    height, width = shape
    marked = np.zeros(shape, bool)
    rows, columns = np.ogrid[:height, :width]
    for across, down in points:
        column, row = round(across * (width - 1)), round(down * (height - 1))
        marked |= (columns - column) ** 2 + (rows - row) ** 2 <= radius**2
    return marked
