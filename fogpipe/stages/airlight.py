"""Airlight: the colour that the medium itself has, seen against infinity."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, floats, require_maps
from fogpipe.ports import Airlight, Image, Mask, Unit
from fogpipe.stage import stage

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear red, green and blue in luminance (ITU-R BT.709)."""


@stage("airlight.estimate")
def estimate(
    image: Image,
    sky: Mask | None = None,
    *,
    source: Literal["auto", "given", "sky", "brightest"] = "auto",
    colour: tuple[Annotated[float, Ge(0)], Annotated[float, Ge(0)], Annotated[float, Ge(0)]] | None = None,
    saturation: Annotated[float, Ge(0), Le(1)] = 1.0,
    horizon: Annotated[float, Gt(0), Le(1)] = 0.25,
    share: Annotated[float, Gt(0), Le(1)] = 0.001,
    patch: Annotated[int, Ge(1), Unit("px")] = 15,
) -> Airlight:
    """One colour for the airlight of the whole image.

    Parameters
    ----------
    image : (H, W, 3) float, linear light.
    sky : (H, W) bool, optional.
    source : ``"given"``: ``colour``. ``"sky"``: the median colour of the sky near the horizon, which a sun or dark
        branches in the mask do not move. ``"brightest"``: the median colour of the brightest patches.
        ``"auto"``: given if there is a colour, else the sky if there is any and its colour is not black (as is the
        background of a rendered picture, which is no sky that lights a haze), else the brightest patches.
    colour : (red, green, blue), linear light.
    saturation : Share of an estimated colour that is kept; the rest is grey of the same luminance. Droplets scatter all
        colours alike, so fog under a blue sky is nearly white; a given colour stays as it is.
    horizon : Share of the sky that is used, from its lowest pixel up. A far object fades into the sky at the horizon,
        which is paler than the zenith; 1 takes the whole sky.
    share : Brightest share of all patches that is used; at least one is.
    patch : Side of the square patches. A patch is as bright as its darkest pixel, so a lamp or highlight that does
        not fill a patch does not count, however bright it is. A larger one does.

    Returns
    -------
    (3,) float32, or float64 for a float64 image; 0 or more, never NaN.

    Raises
    ------
    ValueError
        If the source is ``"given"`` without a colour or ``"sky"`` without any sky, if a colour is negative or not
        finite, or if the pixels to take the median of are not finite.

    Notes
    -----
    About 3 ns per pixel for the brightest patches, and 50 ns per pixel of the sky that is used.

    Deviates from the paper, which takes the airlight from sky regions and leaves open how.

    References
    ----------
    Hansard 2019, *Fast synthesis of atmospheric image effects*, section 2.1. The darkest pixel of a patch as its
    brightness follows the dark channel of He, Sun and Tang 2009.
    """
    require_maps(image=(image, 3), **({} if sky is None else {"sky": (sky, 1)}))
    (image,) = floats(image)
    airlight = np.zeros(3, image.dtype)
    if source == "auto" and colour is not None:
        source = "given"
    if source == "given":
        if colour is None:
            raise ValueError('source "given" needs a colour: set colour to (red, green, blue).')
        airlight = np.array(colour, image.dtype)
    if source in ("auto", "sky") and sky is not None and sky.any():
        airlight = _at_horizon(image, sky, horizon)
    elif source == "sky":
        raise ValueError('source "sky" needs a sky, and this scene has none: use "auto" or "brightest".')
    if source == "auto" and airlight.max() <= 0:  # NaN is not: a sky that is not finite is told, not passed over
        source = "brightest"
    if source == "brightest":
        airlight = np.median(_brightest_patches(image, share, patch), axis=0)
    if airlight.shape != (3,) or not np.isfinite(airlight).all() or (source == "given" and airlight.min() < 0):
        raise ValueError(f"the airlight ({source}) must be three finite numbers of 0 or more, not {airlight}.")
    if source != "given":
        luminance = airlight @ np.array(LUMINANCE, airlight.dtype)
        airlight = luminance + image.dtype.type(saturation) * (airlight - luminance)
    return np.maximum(airlight, 0)


def _at_horizon(image: FloatArray, sky: Mask, horizon: float) -> FloatArray:
    """The median colour of the lowest share of the sky."""
    pixels = np.flatnonzero(sky)  # in raster order: the last are the lowest
    lowest = pixels[-max(1, round(horizon * pixels.size)) :]
    return np.median(image.reshape(-1, 3)[lowest], axis=0)


def _brightest_patches(image: FloatArray, share: float, patch: int) -> FloatArray:
    """All pixels, (count, 3), of the patches whose darkest pixel is brightest."""
    height, width, _ = image.shape
    rows, columns = np.arange(0, height, patch), np.arange(0, width, patch)
    luminance = image @ np.array(LUMINANCE, image.dtype)
    darkest = np.minimum.reduceat(np.minimum.reduceat(luminance, rows, axis=0), columns, axis=1)
    count = max(1, round(share * darkest.size))
    brightest = np.argpartition(darkest, -count, axis=None)[-count:]
    pieces = [
        image[y : y + patch, x : x + patch].reshape(-1, 3)
        for y, x in zip(rows[brightest // columns.size], columns[brightest % columns.size], strict=True)
    ]
    return np.concatenate(pieces)
