"""Pixels of a picture that may show its airlight, each found by another sign; or a colour that is given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.srgb import linear_from_srgb

FAR_ABOVE = 16
"""How many times as bright as its image an airlight is only by mistake."""


def given(colour: tuple[float, float, float], image: FloatArray) -> FloatArray:
    """A colour that a person gives, (3,) of the dtype of the image, in which 1 is white.

    Raises
    ------
    ValueError
        If it is negative, not finite, or so bright that it must be in levels of 0 to 255.
    """
    airlight = np.array(colour, image.dtype)
    if airlight.shape != (3,) or not np.isfinite(airlight).all() or airlight.min() < 0:
        raise ValueError(f"the airlight (given) must be three finite numbers of 0 or more, not {airlight}.")
    if airlight.max() > FAR_ABOVE and airlight.max() > FAR_ABOVE * image.max():
        levels = ", ".join(f"{linear:.3g}" for linear in linear_from_srgb(np.clip(airlight / 255, 0, 1)))
        raise ValueError(
            f"colour is more than {FAR_ABOVE} times as bright as white, which is 1, and as anything in the image. As"
            f" levels of 0 to 255 it would be ({levels}) in linear light."
        )
    return airlight


def at_horizon(
    image: FloatArray, luminance: FloatArray, sky: np.ndarray, horizon: float, brighter: float, darkest: float
) -> FloatArray:
    """Pixels (count, 3) of the brighter share of the lowest share of the sky, an (H, W) mask.

    Those darker than the share ``darkest`` of what the brightest tenth of the mask exceeds are not sky.
    """
    pixels = np.flatnonzero(sky)  # in raster order: the last are the lowest
    if darkest > 0:
        levels = luminance.reshape(-1)[pixels]
        dark = levels < darkest * levels[largest(levels, 0.1)].min()
        pixels = pixels[~dark]  # NaN stays, and is told
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
