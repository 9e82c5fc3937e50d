"""Airlight: the colour that the medium itself has, seen against infinity.

:func:`estimate` finds one to put haze on a clear picture, whose sky it may use; the others find that of a hazy picture.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt

from fogpipe.kernels.arrays import floats, require_maps
from fogpipe.kernels.dehazing import airlight_pixels
from fogpipe.ports import Airlight, Image, Mask
from fogpipe.stage import stage
from fogpipe.stages.hazy_airlight import (
    LUMINANCE,
    AirlightEstimate,
    Fraction,
    Share,
    Side,
    brightest,
    dark_channel,
    fading,
    greyer,
    quad_tree,
    scribble,
    uneven,
)

__all__ = [
    "LUMINANCE",
    "AirlightEstimate",
    "brightest",
    "dark_channel",
    "estimate",
    "fading",
    "greyer",
    "quad_tree",
    "scribble",
    "uneven",
]


def _colour_is_used(source: str, colour: tuple[float, float, float] | None) -> None:
    if source == "given" and colour is None:
        raise ValueError('source "given" needs a colour: set colour to (red, green, blue).')
    if source in ("sky", "brightest") and colour is not None:
        raise ValueError(
            f'source "{source}" finds the colour in the image: leave colour out, or set source to "given".'
        )


@stage("airlight.estimate", requires=_colour_is_used)
def estimate(
    image: Image,
    sky: Mask | None = None,
    *,
    source: Literal["auto", "given", "sky", "brightest"] = "auto",
    colour: tuple[Annotated[float, Ge(0)], Annotated[float, Ge(0)], Annotated[float, Ge(0)]] | None = None,
    saturation: Fraction = 1.0,
    horizon: Share = 0.25,
    brighter: Share = 1.0,
    darkest: Fraction = 0.25,
    share: Share = 0.001,
    patch: Side = 15,
    ceiling: Annotated[float, Gt(0)] = 0.7,
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
    brighter : Share of these pixels that is used, from the brightest down: in a sky that was guessed, dark ones are
        mountains and walls.
    darkest : Pixels of the sky darker than this share of its brightest tenth do not count: trees and walls above the
        reach of a lidar. 0 lets all count, as in the paper.
    share : Brightest share of all patches that is used; at least one is.
    patch : Side of the square patches. A patch is as bright as its darkest pixel, so a lamp or highlight that does
        not fill a patch does not count, however bright it is. A larger one does.
    ceiling : Largest luminance of an estimated colour where nothing in the image is brighter than 1. An overexposed
        sky was brighter than white by an amount that is lost, and a camera exposes fog to a light grey: without a
        ceiling its fog would be pure white. 1 takes white as it is.

    Returns
    -------
    (3,) float32, or float64 for a float64 image; 0 or more, never NaN.

    Raises
    ------
    ValueError
        If the source is ``"given"`` without a colour, ``"sky"`` without any sky, or another one beside a colour; if a
        colour is negative, not finite, or so bright that it must be in levels of 0 to 255; or if the pixels to take
        the median of are not finite.

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
    _colour_is_used(source, colour)
    (image,) = floats(image)
    if colour is not None:
        return airlight_pixels.given(colour, image)
    luminance = image @ np.array(LUMINANCE, image.dtype)
    airlight = np.zeros(3, image.dtype)
    if source != "brightest" and sky is not None and sky.any():
        pixels = airlight_pixels.at_horizon(image, luminance, sky, horizon, brighter, darkest)
        airlight = np.median(pixels, axis=0)
    elif source == "sky":
        raise ValueError('source "sky" needs a sky, and this scene has none: use "auto" or "brightest".')
    if source == "auto" and airlight.max() <= 0:  # NaN is not: a sky that is not finite is told, not passed over
        source = "brightest"
    if source == "brightest":
        airlight = np.median(airlight_pixels.brightest_patches(image, luminance, share, patch), axis=0)
    if not np.isfinite(airlight).all():
        raise ValueError(f"the airlight ({source}) must be three finite numbers of 0 or more, not {airlight}.")
    level = airlight @ np.array(LUMINANCE, airlight.dtype)
    airlight = level + image.dtype.type(saturation) * (airlight - level)
    if ceiling < level and image.max() <= 1:
        airlight *= image.dtype.type(ceiling / level)
    return np.maximum(airlight, 0)
