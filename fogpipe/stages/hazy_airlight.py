"""Airlight of a hazy picture, found by different signs.

Each estimate says how uncertain it is, and each can be fooled in its own way, which
docs/explanation/dehazing-experiment.md measures.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from fogpipe.kernels.arrays import FloatArray, floats, over_channels, require_finite, require_maps
from fogpipe.kernels.dehazing import airlight_pixels
from fogpipe.kernels.dehazing.fading import colour_faded_into
from fogpipe.kernels.dehazing.uneven import light
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
    A wall larger than a patch and whiter than the haze takes its place. About 6 ns per pixel.

    Deviates from the paper: the median by default, since the brightest of many noisy pixels is too bright; ``take:
    brightest`` is as published.

    References
    ----------
    He, Sun and Tang 2009, *Single image haze removal using dark channel prior*, section 4.4.
    """
    import cv2

    image = _hazy(image)
    darkest = cv2.erode(over_channels(np.minimum, image), np.ones((patch, patch), np.uint8))
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
    the share of the picture that has its colour, times the evidence. Searches a copy reduced to 160 px: about 40 ns
    per pixel of the original.
    """
    image = _hazy(image)
    return _of(colour_faded_into(image, share).astype(image.dtype))


@stage("airlight.greyer")
def greyer(airlight: Airlight, other: Airlight, *, agreement: Annotated[float, Ge(0)] = 0.1) -> Airlight:
    r"""Airlight drawn to a second estimate that nearly agrees, as far as that one is greyer.

    .. math:: B' = B + (1 - s_2 / s)\,(B_2 - B), \qquad s = 1 - \min_c B_c / \max_c B_c

    Where no sky is seen, an estimate has some of the colour of the walls and trees that fade into it, and air is
    nearly grey. Only nearly: an estimate that no greyer one is near to stays as it is, blue haze and dust too.

    Parameters
    ----------
    airlight, other : (3,) float, B and B₂.
    agreement : Distance of the two, as a share of the first, from which on they do not agree.

    Returns
    -------
    (3,) float32, or float64 if the first is.

    Raises
    ------
    ValueError
        If one is a map or not finite.

    Notes
    -----
    ``airlight.fading``, drawn to ``airlight.dark_channel``, errs by 0.005 more on average over the scenes that settings
    are tuned on, most where a white cloud is near a blue haze (0.04); in return brick walls keep their colours.
    """
    first, second = floats(_colour(airlight=airlight), _colour(other=other))
    tint, other_tint = (1 - colour.min() / max(colour.max(), 1e-12) for colour in (first, second))
    if tint <= other_tint or np.linalg.norm(second - first) > agreement * np.linalg.norm(first):
        return first
    return first + first.dtype.type(1 - other_tint / tint) * (second - first)


@stage("airlight.uneven")
def uneven(image: Image, airlight: Airlight) -> Airlight:
    """Airlight that is not as bright everywhere, read off the sky: light fades away from the sun, and in a lens.

    Parameters
    ----------
    image : (H, W, 3) float, hazy.
    airlight : (3,) float, its colour.

    Returns
    -------
    (H, W, 3) float32, or float64 for a float64 image: the same colour, brighter or darker. (3,), ``airlight`` itself,
    where the picture shows no sky of it.

    Raises
    ------
    ValueError
        If ``airlight`` is a map, or a value is NaN or infinite.

    Notes
    -----
    Sky is what is even, of that hue, and joined to some of its brightness: 2 % of the picture at least. Elsewhere near
    sky counts most. Far hills in dense haze that merge with the sky count as sky in part, and keep some haze.

    Searches a copy reduced to 160 px: about 30 ns per pixel of the original.
    """
    image, airlight = floats(_hazy(image), _colour(airlight=airlight))
    brightness = light(image, airlight)
    return airlight if brightness is None else brightness[..., None].astype(image.dtype) * airlight


def _colour(**airlights: Airlight) -> FloatArray:
    """A single one, (3,) and finite."""
    ((name, airlight),) = airlights.items()
    if airlight.shape != (3,):
        raise ValueError(f"{name} must be one colour, (3,), not of shape {airlight.shape}.")
    require_finite(**airlights)
    return airlight


def _hazy(image: Image) -> FloatArray:
    require_maps(image=(image, 3))
    require_finite(image=image)
    return floats(image)[0]


def _of(pixels: FloatArray) -> AirlightEstimate:
    """The median colour of pixels (count, 3), and their standard deviation, seen by a median, too."""
    middle = np.median(pixels, axis=0)
    spread = 1.4826 * np.median(np.abs(pixels - middle), axis=0)  # of a normal distribution the standard deviation
    return AirlightEstimate(np.maximum(middle, 0), spread.astype(pixels.dtype))
