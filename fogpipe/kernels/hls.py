r"""Colour as hue, lightness and saturation, without an upper end.

With the largest and the smallest of red, green and blue,

.. math:: L = \frac{\max + \min}{2}, \qquad S = \frac{\max - \min}{\max + \min},

the lower half of the double cone of HLS, continued. Light that is n times as strong has n times the lightness and the
same hue and saturation, so nothing has to be clipped. A colour is its lightness and what it differs from grey,
:math:`I - L`; adding such differences blends the hues on the circle, as mixing lights does, and after an addition only
their middle must be brought back to 0. No angle is computed, so none can jump.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

_STOPS = 24
"""F-stops below the lightest pixel that the histogram covers."""


def lightness(image: FloatArray) -> FloatArray:
    """L of an (H, W, 3) image, (H, W) in its dtype."""
    rows, columns = image.shape[:2]
    result = np.empty((rows, columns), image.dtype)
    in_bands(_lightness, rows, columns, image, result)
    return result


def pure_hue(degrees: float) -> FloatArray:
    """The colour (3,) of a hue with L = 1/2 and S = 1: red at 0°, green at 120°, blue at 240°."""
    away = np.abs((degrees / 60 + np.array([0.0, -2.0, 2.0]) + 3) % 6 - 3)  # sixths of the circle from each primary
    return np.clip(2 - away, 0, 1)


def highlight_threshold(lightness: FloatArray, brighter_than: float = 0.5) -> float:
    """Lightness at which highlights begin: where the histogram falls most steeply. Infinite where there are none.

    Parameters
    ----------
    lightness : (H, W) float of 0 or more.
    brighter_than : share of the pixels below which the fall is not looked for.
    """
    from scipy.ndimage import gaussian_filter1d

    largest = float(lightness.max())
    if largest == 0:
        return np.inf
    stops = np.log2(np.maximum(lightness, largest * 2.0**-_STOPS) / largest)  # −24 to 0
    half_stops = np.minimum(2 * (stops + _STOPS), 2 * _STOPS - 1).astype(np.int64)
    counts = np.bincount(half_stops.ravel(), minlength=2 * _STOPS)
    slope = np.diff(gaussian_filter1d(counts.astype(np.float64), 1.5, mode="constant"))
    ordinary = int(np.searchsorted(np.cumsum(counts), brighter_than * lightness.size))
    slope[:ordinary] = 0
    steepest = int(np.argmin(slope))
    return largest * 2.0 ** ((steepest + 1) / 2 - _STOPS) if slope[steepest] < 0 else np.inf


def brighten_highlights_less(image: FloatArray, threshold: float, compression: float) -> FloatArray:
    """L above a threshold T becomes T (1 + ln(1 + c (L/T − 1)) / c); hue and saturation stay."""
    result = np.empty_like(image)
    rows, columns = image.shape[:2]
    in_bands(_compress, rows, columns, image, threshold, compression, result)
    return result


def lift_and_grey(
    image: FloatArray,
    depth: FloatArray,
    shadow: float,
    lift: float,
    abrupt: bool,
    extinction: float,
    scattering: float,
    hue: FloatArray,
) -> FloatArray:
    """Lift what is darker than ``shadow``, take saturation away and blend the hue with another, by shares that grow
    with the depth and are at most 1: ``lift``, ``extinction`` and ``scattering`` times it."""
    result = np.empty_like(image)
    rows, columns = image.shape[:2]
    medium = lift, abrupt, extinction, scattering, hue
    in_bands(_lift_and_grey, rows, columns, image, depth, shadow, *medium, result)
    return result


def attenuate_and_add(
    image: FloatArray, thickness: FloatArray, strength: FloatArray, airlight: FloatArray
) -> FloatArray:
    """Light times e^(−thickness), plus the airlight times its strength; lightnesses add exactly."""
    result = np.empty_like(image)
    rows, columns = image.shape[:2]
    in_bands(_attenuate_and_add, rows, columns, image, thickness, strength, airlight, result)
    return result


@njit(nogil=True, cache=True)
def _lightness(first, last, image, result):
    for y in range(first, last):
        for x in range(image.shape[1]):
            r, g, b = image[y, x]
            result[y, x] = (max(r, g, b) + min(r, g, b)) / 2


@njit(nogil=True, cache=True)
def _compress(first, last, image, threshold, compression, result):
    for y in range(first, last):
        for x in range(image.shape[1]):
            r, g, b = image[y, x]
            above = (max(r, g, b) + min(r, g, b)) / 2 / threshold - 1
            scale = 1.0
            if above > 0:
                scale = (1 + math.log1p(compression * above) / compression) / (1 + above)
            for channel in range(3):
                result[y, x, channel] = scale * image[y, x, channel]


@njit(nogil=True, cache=True)
def _lift_and_grey(first, last, image, depth, shadow, lift, abrupt, extinction, scattering, hue, result):
    for y in range(first, last):
        for x in range(image.shape[1]):
            far = depth[y, x]
            saturation, share = max(0.0, 1 - extinction * far), min(1.0, scattering * far)
            r, g, b = image[y, x]
            largest, smallest = max(r, g, b), min(r, g, b)
            before = (largest + smallest) / 2
            after = before
            if before < shadow:
                after += lift * far * (shadow if abrupt else shadow - before)
            scale = saturation * after / before if before > 0 else 0.0
            of_hue = scale * share * (largest - smallest)
            own = scale * (1 - share)
            _set(result, y, x, after, own * r + of_hue * hue[0], own * g + of_hue * hue[1], own * b + of_hue * hue[2])


@njit(nogil=True, cache=True)
def _attenuate_and_add(first, last, image, thickness, strength, airlight, result):
    airlight_lightness = (airlight.max() + airlight.min()) / 2
    for y in range(first, last):
        for x in range(image.shape[1]):
            t, a = math.exp(-thickness[y, x]), strength[y, x]
            r, g, b = image[y, x]
            after = t * (max(r, g, b) + min(r, g, b)) / 2 + a * airlight_lightness
            _set(result, y, x, after, t * r + a * airlight[0], t * g + a * airlight[1], t * b + a * airlight[2])


@njit(nogil=True, cache=True)
def _set(result, y, x, lightness, r, g, b):
    """Write a colour of that lightness with the differences between r, g and b."""
    shift = lightness - (max(r, g, b) + min(r, g, b)) / 2
    result[y, x, 0] = max(r + shift, 0)  # rounding may lead below
    result[y, x, 1] = max(g + shift, 0)
    result[y, x, 2] = max(b + shift, 0)
