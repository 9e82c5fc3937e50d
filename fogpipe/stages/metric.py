"""Scores: how near a restored picture, transmission or airlight comes to the true one."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, Lt

from fogpipe.kernels.arrays import FloatArray, floats, require_finite, require_maps
from fogpipe.ports import Airlight, Color, Image, Number, Transmission
from fogpipe.stage import stage

GREY = (0.299, 0.587, 0.114)
"""Weights of the display values red, green and blue in grey (ITU-R BT.601)."""
SSIM_WINDOW = 11
"""Pixels that the Gaussian window of the structural similarity takes along each axis."""


class TransmissionError(NamedTuple):
    """How far a transmission is from the true one, over the pixels where both are known."""

    root_mean_square: Number
    bias: Number


class AirlightError(NamedTuple):
    """How far one airlight is from another, in strength and in hue."""

    distance: Number
    angle: Number


class VisibleEdges(NamedTuple):
    """The descriptors e, r and Σ of Hautière 2008."""

    new: Number
    gain: Number
    saturated: Number


@stage("metric.psnr")
def psnr(image: Image, reference: Image, *, color: Color = "linear") -> Number:
    r"""Peak signal-to-noise ratio in dB, :math:`-10 \log_{10} \overline{(x - y)^2}`.

    Parameters
    ----------
    image : (H, W, 3) float, what is scored.
    reference : (H, W, 3) float, what it should be.
    color : What the numbers of both mean. Scores are of display values, as is usual, so linear light is converted.

    Returns
    -------
    One number, dB. Equal pictures give +inf.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    Both are clipped to [0, 1] first, as a screen does. Functions of NumPy arrays may also pass 8 or 16 bit integers,
    which are display values whatever ``color`` says. The mean is over all pixels and channels.
    """
    one, other = _on_display(image, reference, color)
    with np.errstate(divide="ignore"):
        return np.asarray(-10 * np.log10(np.mean(np.square(one - other))), np.float64)


@stage("metric.ssim")
def ssim(image: Image, reference: Image, *, color: Color = "linear") -> Number:
    """Structural similarity of two pictures, 1 where they are equal.

    Parameters
    ----------
    image : (H, W, 3) float, what is scored.
    reference : (H, W, 3) float, what it should be.
    color : What the numbers of both mean; the score is of display values.

    Returns
    -------
    One number of at most 1, the mean over channels; NaN (undefined) for a picture of less than 11 pixels in a
    direction.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    scikit-image's, in the form of the paper: Gaussian window of σ = 1.5 px cut at 11 px, K = (0.01, 0.03), data
    range 1. Both are clipped to [0, 1] first. About 0.4 µs per pixel.

    References
    ----------
    Wang, Bovik, Sheikh and Simoncelli 2004, *Image quality assessment: from error visibility to structural similarity*.
    """
    from skimage.metrics import structural_similarity

    one, other = _on_display(image, reference, color)
    if min(one.shape[:2]) < SSIM_WINDOW:
        return np.array(np.nan)
    score = structural_similarity(
        one, other, channel_axis=2, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    return np.asarray(score, np.float64)


@stage("metric.ciede2000")
def ciede2000(image: Image, reference: Image, *, color: Color = "linear") -> Number:
    """Mean colour difference that an eye sees, CIEDE2000; about 1 is just noticeable.

    Parameters
    ----------
    image : (H, W, 3) float, what is scored.
    reference : (H, W, 3) float, what it should be.
    color : What the numbers of both mean.

    Returns
    -------
    One number of 0 or more.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    Both are clipped to [0, 1] and go to CIE Lab (D65, 2° observer) in double precision, never through 8 bits; the
    difference is scikit-image's. About 0.5 µs per pixel.

    References
    ----------
    Sharma, Wu and Dalal 2005, *The CIEDE2000 color-difference formula: implementation notes*.
    """
    from skimage.color import deltaE_ciede2000, rgb2lab

    one, other = _on_display(image, reference, color)
    return np.asarray(np.mean(deltaE_ciede2000(rgb2lab(one), rgb2lab(other))), np.float64)


@stage("metric.transmission_error")
def transmission_error(transmission: Transmission, reference: Transmission) -> TransmissionError:
    """Root-mean-square difference of two transmissions, and the mean difference.

    Parameters
    ----------
    transmission : (H, W) float, what is scored. NaN where unknown.
    reference : (H, W) float, what it should be. NaN where unknown.

    Returns
    -------
    root_mean_square, bias : over the pixels where both are known; NaN (undefined) where there are none. A bias above 0
        is too clear a medium.

    Raises
    ------
    ValueError
        If the sizes differ.
    """
    require_maps(transmission=(transmission, 1), reference=(reference, 1))
    difference = np.asarray(transmission, np.float64) - reference
    difference = difference[~np.isnan(difference)]
    if difference.size == 0:
        return TransmissionError(np.array(np.nan), np.array(np.nan))
    return TransmissionError(np.sqrt(np.array(np.mean(difference**2))), np.array(difference.mean()))


@stage("metric.airlight_error")
def airlight_error(airlight: Airlight, reference: Airlight) -> AirlightError:
    """Distance of two airlights in RGB, and the angle between them, which is the difference of hue and saturation.

    Parameters
    ----------
    airlight : (3,) or (H, W, 3) float, what is scored.
    reference : (3,) or (H, W, 3) float, what it should be.

    Returns
    -------
    distance, angle : Euclidean distance, and degrees in [0, 90]; the mean over the pixels where one of them varies.
        The angle to a black airlight is NaN (undefined).

    Raises
    ------
    ValueError
        If both vary and their sizes differ.
    """
    one, other = np.asarray(airlight, np.float64), np.asarray(reference, np.float64)
    if one.ndim == other.ndim == 3:
        require_maps(airlight=(one, 3), reference=(other, 3))
    distance = np.linalg.norm(one - other, axis=-1)
    # Of the half-angle between unit vectors: exact for small angles, where an arc cosine loses half the digits.
    with np.errstate(invalid="ignore"):
        one, other = (colour / np.linalg.norm(colour, axis=-1, keepdims=True) for colour in (one, other))
    angle = 2 * np.arctan2(np.linalg.norm(one - other, axis=-1), np.linalg.norm(one + other, axis=-1))
    return AirlightError(np.array(distance.mean()), np.array(np.degrees(angle.mean())))


@stage("metric.visible_edges")
def visible_edges(
    image: Image,
    restored: Image,
    *,
    contrast: Annotated[float, Gt(0), Lt(1)] = 0.05,
    color: Color = "linear",
) -> VisibleEdges:
    r"""Blind descriptors of a restored picture: edges gained, gain of their gradients, pixels lost to saturation.

    An edge is visible where a pixel and its neighbour, grey a < b, have an edge of more than the contrast

    .. math:: 2 \max_s \min\left(\frac{s - a}{s}, \frac{b - s}{b}\right) = 2 \left(1 - \sqrt{a / b}\right).

    Parameters
    ----------
    image : (H, W, 3) float, as it was.
    restored : (H, W, 3) float, as it has become.
    contrast : Least visible contrast; 5 % is the threshold of the CIE.
    color : What the numbers of both mean; the score is of the grey of display values.

    Returns
    -------
    new, gain, saturated : :math:`e = (n_r - n_o) / n_o` of the numbers n of pixels with a visible edge (NaN,
        undefined, where there were none); :math:`r = \exp(\overline{\log r_i})` over the visible edges of the restored
        picture, of the ratio of its gradient to that of the image (NaN without any); and the share Σ of the pixels
        that have become black or white in 8 bit without having been so.

    Raises
    ------
    ValueError
        If a value is NaN or infinite, or the sizes differ.

    Notes
    -----
    These are no measure of truth: noise is made of edges, too, and raises e and r.

    Deviates from the paper: the grey s that separates the two sides of an edge is the best for each pair of pixels,
    for which there is a formula, not the best of each window (Köhler); greys below 1/255 count as 1/255, and so do
    gradients. About 0.1 µs per pixel.

    References
    ----------
    Hautière, Tarel, Aubert and Dumont 2008, *Blind contrast enhancement assessment by gradient ratioing at visible
    edges*.
    """
    before, after = (picture @ np.array(GREY) for picture in _on_display(image, restored, color))
    visible_before, visible_after = (_has_edge(grey, contrast) for grey in (before, after))
    count = np.count_nonzero(visible_before)
    new = (np.count_nonzero(visible_after) - count) / count if count else np.nan
    ratio = np.log(_gradient(after) / _gradient(before))[visible_after]
    gain = np.exp(ratio.mean()) if ratio.size else np.nan
    saturated = np.mean(_is_saturated(after) & ~_is_saturated(before))
    return VisibleEdges(*(np.asarray(value, np.float64) for value in (new, gain, saturated)))


def _on_display(image: Image, reference: Image, color: Color) -> tuple[FloatArray, FloatArray]:
    """Both as display values in [0, 1] in double precision."""
    require_maps(image=(image, 3), reference=(reference, 3))
    return _display(image, color, "image"), _display(reference, color, "reference")


def _display(image: np.ndarray, color: Color, name: str) -> FloatArray:
    if image.dtype.kind == "u":
        return image / np.iinfo(image.dtype).max
    require_finite(**{name: image})
    (image,) = floats(image)
    if color == "linear":
        from fogpipe.kernels.srgb import srgb_from_linear

        image = srgb_from_linear(image)
    return np.clip(image, 0, 1, dtype=np.float64)


def _has_edge(grey: FloatArray, contrast: float) -> np.ndarray:
    """Pixels with a visible edge to one of their four neighbours."""
    root = np.sqrt(np.maximum(grey, 1 / 255))
    found = np.zeros(grey.shape, bool)
    for one, other in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        low, high = np.minimum(root[one], root[other]), np.maximum(root[one], root[other])
        edge = 2 * (1 - low / high) > contrast
        found[one] |= edge
        found[other] |= edge
    return found


def _gradient(grey: FloatArray) -> FloatArray:
    """Magnitude of Sobel's gradient, at least one level of 8 bit."""
    from scipy.ndimage import sobel

    return np.maximum(np.hypot(sobel(grey, 0, mode="nearest"), sobel(grey, 1, mode="nearest")) / 8, 1 / 255)


def _is_saturated(grey: FloatArray) -> np.ndarray:
    """Pixels that 8 bit store as black or white."""
    level = np.rint(grey * 255)
    return (level == 0) | (level == 255)
