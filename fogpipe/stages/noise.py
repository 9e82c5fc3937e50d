"""Noise and rounding: what a camera and a file format take from a picture."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge

from fogpipe.kernels.arrays import floats, require_finite, require_maps
from fogpipe.ports import Image
from fogpipe.stage import stage


def _no_noise(sigma: float) -> str | None:
    """skipped when σ = 0"""
    return "σ = 0 is no noise" if sigma == 0 else None


@stage("noise.gaussian", identity_when=_no_noise)
def gaussian(image: Image, *, rng: np.random.Generator, sigma: Annotated[float, Ge(0)] = 10 / 255) -> Image:
    """White Gaussian noise of one strength, the noise of most papers on dehazing.

    Parameters
    ----------
    image : (H, W, 3) float, in any space.
    rng : Draws the noise.
    sigma : Standard deviation, on values in [0, 1]. Papers that say "10" mean 10/255 of display values.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image; not clipped, so it may be below 0.

    Raises
    ------
    ValueError
        If a value is NaN or infinite.

    Notes
    -----
    Pixels and channels are independent. A camera's noise grows with the light; the plugin pack fogpipe-sensor has
    that. About 30 ns per pixel.
    """
    require_maps(image=(image, 3))
    require_finite(image=image)
    (image,) = floats(image)
    return image + image.dtype.type(sigma) * rng.standard_normal(image.shape, image.dtype.type)


@stage("noise.quantise")
def quantise(image: Image, *, bits: Literal[8, 10, 12, 16] = 8) -> Image:
    """Round a picture to the levels of an integer format, clipped to [0, 1].

    Parameters
    ----------
    image : (H, W, 3) float. Formats of few bits hold display values: use it in a pipeline of ``color: srgb``.
    bits : Of each value; the largest integer stands for 1.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image, in [0, 1]. The error is at most half a level, and of a
    standard deviation of 1/√12 level.

    Raises
    ------
    ValueError
        If a value is NaN or infinite.
    """
    require_maps(image=(image, 3))
    require_finite(image=image)
    (image,) = floats(image)
    top = image.dtype.type(2**bits - 1)
    return np.rint(np.clip(image, 0, 1) * top) / top
