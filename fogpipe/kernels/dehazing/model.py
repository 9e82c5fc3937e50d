"""The haze equation I = t·L + (1 − t)·B read backwards, and what L ≥ 0 says about t."""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray, floats, require_maps
from fogpipe.kernels.bands import in_bands


def lower_bound(image: np.ndarray, airlight: np.ndarray, floor: float, lift: float = 0.0) -> FloatArray:
    """Least transmission that leaves no channel of the scene negative, max(1 − min_c (I_c + lift) / B_c, floor).

    Parameters
    ----------
    image : (H, W, 3) float.
    airlight : (3,) or (H, W, 3) float, 0 or more. A channel without airlight bounds nothing and is passed over.
    floor : in (0, 1].
    lift : added to the image first, so that the least of three noisy channels is no longer too small on average.

    Returns
    -------
    (H, W) float in [floor, 1]; ``floor`` where no channel has airlight, or one is brighter than it.
    """
    image, field = image_and_field(image, airlight)
    bound = np.empty(image.shape[:2], image.dtype)
    height, width, _ = image.shape
    in_bands(_lower_bound, height, width, image, field, image.dtype.type(floor), image.dtype.type(lift), bound)
    return bound


def first_guess(
    image: np.ndarray, airlight: np.ndarray, darkest: float, saturation: float, floor: float
) -> tuple[FloatArray, FloatArray]:
    r"""Lower bound of the transmission, and a guess from what colours scenes have.

    With :math:`q_c = 1 - I_c / B_c`, a scene of :math:`L_c / B_c = 1 - q_c / t`, whose saturation 1 − min/max is s at
    most, has :math:`t \ge (\max q - (1 - s) \min q) / s`. If its darkest channel reaches the share m of the airlight
    in the darkest places, t is 1 / (1 − m) times that. With s = 1 and m = 0 the guess is the bound.

    Parameters
    ----------
    image, airlight, floor : as for :func:`lower_bound`.
    darkest : m, in [0, 1).
    saturation : s, in (0, 1].

    Returns
    -------
    Two (H, W) maps in [floor, 1], the second at least the first.
    """
    image, field = image_and_field(image, airlight)
    bound, guess = np.empty(image.shape[:2], image.dtype), np.empty(image.shape[:2], image.dtype)
    real = image.dtype.type
    height, width, _ = image.shape
    in_bands(_first_guess, height, width, image, field, real(darkest), real(saturation), real(floor), bound, guess)
    return bound, guess


def invert(image: np.ndarray, airlight: np.ndarray, transmission: np.ndarray, floor: float) -> FloatArray:
    """Scene radiance B + (I − B) / max(t, floor), shape (H, W, 3), unclipped."""
    image, field = image_and_field(image, airlight)
    require_maps(image=(image, 3), transmission=(transmission, 1))
    _, transmission = floats(image, transmission)
    scene = np.empty_like(image)
    in_bands(_invert, *transmission.shape, image, field, transmission, image.dtype.type(floor), scene)
    return scene


def image_and_field(image: np.ndarray, airlight: np.ndarray) -> tuple[FloatArray, ...]:
    """Both in one precision, the airlight as (H, W, 3), or as (1, 1, 3) when it is the same everywhere."""
    require_maps(image=(image, 3))
    if airlight.shape == (3,):
        airlight = airlight.reshape(1, 1, 3)
    else:
        require_maps(image=(image, 3), airlight=(airlight, 3))
    return floats(image, airlight)


def relative(image: np.ndarray, airlight: np.ndarray) -> FloatArray:
    """Mean over the channels that have airlight of I_c / B_c, shape (H, W), limited to [0, 2]."""
    image, field = image_and_field(image, airlight)
    lit = field > 0
    share = lit / np.where(lit, field, 1) / np.maximum(lit.sum(axis=2, keepdims=True), 1)
    share = np.broadcast_to(share.astype(image.dtype), image.shape)
    return np.clip(np.einsum("yxc,yxc->yx", image, share), 0, 2)


@njit(nogil=True, cache=True)
def _lower_bound(first, last, image, field, floor, lift, bound):
    varies = field.size > 3
    one = image.dtype.type(1)
    for y in range(first, last):
        for x in range(image.shape[1]):
            least = one
            for c in range(3):
                airlight = field[y, x, c] if varies else field[0, 0, c]
                if airlight > 0:
                    least = min(least, (image[y, x, c] + lift) / airlight)
            bound[y, x] = min(max(one - least, floor), one)


@njit(nogil=True, cache=True)
def _first_guess(first, last, image, field, darkest, saturation, floor, bound, guess):
    varies = field.size > 3
    one = image.dtype.type(1)
    for y in range(first, last):
        for x in range(image.shape[1]):
            most, least = -np.inf, np.inf
            for c in range(3):
                airlight = field[y, x, c] if varies else field[0, 0, c]
                if airlight > 0:
                    q = one - image[y, x, c] / airlight
                    most, least = max(most, q), min(least, q)
            t = (most - (one - saturation) * least) / (saturation * (one - darkest))
            bound[y, x] = min(max(most, floor), one)
            guess[y, x] = min(max(t, bound[y, x]), one)


@njit(nogil=True, cache=True)
def _invert(first, last, image, field, transmission, floor, scene):
    varies = field.size > 3
    for y in range(first, last):
        for x in range(image.shape[1]):
            t = max(transmission[y, x], floor)
            for c in range(3):
                airlight = field[y, x, c] if varies else field[0, 0, c]
                scene[y, x, c] = airlight + (image[y, x, c] - airlight) / t
