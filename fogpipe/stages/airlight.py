"""Airlight: the colour that the medium itself has, seen against infinity.

:func:`estimate` finds one to put haze on a clear picture, whose sky it may use. The others find that of a hazy picture;
each says how uncertain it is, and each can be fooled in its own way, which docs/explanation/dehazing-experiment.md
measures.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, floats, require_finite, require_maps
from fogpipe.kernels.dehazing import airlight_pixels
from fogpipe.kernels.dehazing.fading import colour_faded_into
from fogpipe.ports import Airlight, Image, Mask, Unit
from fogpipe.stage import stage

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear red, green and blue in luminance (ITU-R BT.709)."""
Share = Annotated[float, Gt(0), Le(1)]
Fraction = Annotated[float, Ge(0), Le(1)]
Side = Annotated[int, Ge(1), Unit("px")]


class AirlightEstimate(NamedTuple):
    """An airlight, and the standard deviation in each channel of the colours it was taken from."""

    airlight: Airlight
    uncertainty: Airlight


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


@stage("airlight.brightest")
def brightest(image: Image, *, share: Share = 0.001) -> AirlightEstimate:
    """Airlight as the colour of the brightest pixels.

    Parameters
    ----------
    image : (H, W, 3) float, hazy.
    share : Brightest share of the pixels that is taken; at least one is.

    Returns
    -------
    airlight, uncertainty : (3,) float32, or float64 for a float64 image: their median colour and its spread.

    Raises
    ------
    ValueError
        If a value is NaN or infinite.

    Notes
    -----
    Right where the haze is the brightest thing; a lamp or a white wall takes its place. About 15 ns per pixel.

    References
    ----------
    Tan 2008, *Visibility in bad weather from a single image*, section 4.
    """
    image = _hazy(image)
    pixels = image.reshape(-1, 3)
    return _of(pixels[airlight_pixels.largest(pixels @ np.array(LUMINANCE, image.dtype), share)])


@stage("airlight.dark_channel")
def dark_channel(
    image: Image, *, patch: Side = 15, share: Share = 0.001, take: Literal["median", "brightest"] = "median"
) -> AirlightEstimate:
    """Airlight as the colour of the pixels whose surroundings have the brightest dark channel.

    Parameters
    ----------
    image : (H, W, 3) float, hazy.
    patch : Side of the patches. What does not fill one (a lamp, a headlight) does not count.
    share : Share of the pixels, those of brightest dark channel, that is looked at; at least one is.
    take : Their median colour, or the colour of the brightest of them.

    Returns
    -------
    airlight, uncertainty : (3,) float32, or float64 for a float64 image, and the spread of the pixels looked at.

    Raises
    ------
    ValueError
        If a value is NaN or infinite.

    Notes
    -----
    A wall larger than a patch and whiter than the haze takes its place. About 50 ns per pixel.

    Deviates from the paper: the median by default, since the brightest of many noisy pixels is too bright; ``take:
    brightest`` is as published.

    References
    ----------
    He, Sun and Tang 2009, *Single image haze removal using dark channel prior*, section 4.4.
    """
    import cv2

    image = _hazy(image)
    darkest = cv2.erode(image.min(axis=2), np.ones((patch, patch), np.uint8))
    candidates = image.reshape(-1, 3)[airlight_pixels.largest(np.ravel(darkest), share)]
    found = _of(candidates)
    if take == "brightest":
        found = found._replace(airlight=np.maximum(candidates[candidates.sum(axis=1).argmax()], 0))
    return found


@stage("airlight.quad_tree")
def quad_tree(image: Image, *, smallest: Side = 32) -> AirlightEstimate:
    """Airlight of the quarter that is bright and even, and of its quarters in turn.

    Parameters
    ----------
    image : (H, W, 3) float, hazy.
    smallest : Side of a region that is not divided further.

    Returns
    -------
    airlight, uncertainty : (3,) float32, or float64 for a float64 image: the median colour of the region, and its
        spread.

    Raises
    ------
    ValueError
        If a value is NaN or infinite.

    Notes
    -----
    A region scores the mean of its values less their standard deviation, summed over the channels. A wall counts only
    if the quarters that hold it are bright as a whole, and haze only where it fills a quarter. About 80 ns per pixel.

    Deviates from the paper: the median of the last region, not its pixel nearest to white, which is noise.

    References
    ----------
    Kim, Jang, Sim and Kim 2013, *Optimized contrast enhancement for real-time image and video dehazing*, section 3.1.
    """
    return _of(airlight_pixels.brightest_quarter(_hazy(image), smallest))


@stage("airlight.scribble")
def scribble(
    image: Image,
    scribble: Mask | None = None,
    *,
    points: tuple[tuple[Fraction, Fraction], ...] = ((0.5, 0.0),),
    radius: Annotated[float, Ge(0), Unit("px")] = 5.0,
) -> AirlightEstimate:
    """Airlight as the colour where a user has marked haze, by a brush or by points.

    Parameters
    ----------
    image : (H, W, 3) float, hazy.
    scribble : (H, W) bool, optional. The marked pixels.
    points : Used where nothing is scribbled: (across, down) as shares of width and height, from (0, 0) at the upper
        left to (1, 1). By default the middle of the upper border, where outdoor pictures have their sky.
    radius : Of a point.

    Returns
    -------
    airlight, uncertainty : (3,) float32, or float64 for a float64 image: the median colour of the marked pixels,
        which a stray stroke does not move, and their spread.

    Raises
    ------
    ValueError
        If nothing is marked, the sizes differ, or a value is NaN or infinite.
    """
    require_maps(image=(image, 3), **({} if scribble is None else {"scribble": (scribble, 1)}))
    image = _hazy(image)
    marked = scribble
    if marked is None or not marked.any():
        marked = airlight_pixels.discs(image.shape[:2], points, radius)
    if not marked.any():
        raise ValueError("nothing is marked as haze: give a scribble or points.")
    return _of(image[marked])


def _hazy(image: Image) -> FloatArray:
    require_maps(image=(image, 3))
    require_finite(image=image)
    return floats(image)[0]


def _of(pixels: FloatArray) -> AirlightEstimate:
    """The median colour of pixels (count, 3), and their standard deviation, seen by a median, too."""
    middle = np.median(pixels, axis=0)
    spread = 1.4826 * np.median(np.abs(pixels - middle), axis=0)  # of a normal distribution the standard deviation
    return AirlightEstimate(np.maximum(middle, 0), spread.astype(pixels.dtype))


@stage("airlight.fading")
def fading(image: Image, *, share: Share = 0.005) -> AirlightEstimate:
    """Airlight as the brightest even colour that other things in the picture fade into.

    Parameters
    ----------
    image : (H, W, 3) float, hazy.
    share : Of the picture, that on its way to a colour (5 to 12 % away from it) is evidence enough.

    Returns
    -------
    airlight, uncertainty : (3,) float32, or float64 for a float64 image: the median of the colour's pixels, and their
        spread.

    Raises
    ------
    ValueError
        If a value is NaN or infinite.

    Notes
    -----
    Things at all distances behind haze have all colours between their own and that of the airlight. Nothing fades into
    a lamp or a white wall, however large. A candidate scores the value of its darkest channel, times the power 0.2 of
    the share of the picture that has its colour, times the evidence. Searches a copy reduced to 160 px: about 90 ns
    per pixel of the original.
    """
    image = _hazy(image)
    return _of(colour_faded_into(image, share).astype(image.dtype))
