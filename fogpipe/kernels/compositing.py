"""Premultiplied RGBA: one pass at the speed of memory for each step of a composite."""

from __future__ import annotations

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray, floats, require_maps
from fogpipe.kernels.bands import in_bands


def attenuate(image: np.ndarray, transmission: np.ndarray) -> FloatArray:
    """Premultiplied layer t·(r, g, b, 1), shape (H, W, 4), of an (H, W, 3) image and an (H, W) transmission."""
    require_maps(image=(image, 3), transmission=(transmission, 1))
    image, transmission = floats(image, transmission)
    layer = np.empty((*transmission.shape, 4), image.dtype)
    in_bands(_attenuate, *transmission.shape, image, transmission, layer)
    return layer


def over(layer: np.ndarray, airlight: np.ndarray) -> FloatArray:
    """Image F + (1 − a)·B, shape (H, W, 3), of an (H, W, 4) layer and an airlight B, (3,) or (H, W, 3)."""
    require_maps(layer=(layer, 4))
    layer, field = floats(layer, _field(layer, airlight))
    image = np.empty((*layer.shape[:2], 3), layer.dtype)
    in_bands(_over, *layer.shape[:2], layer, field, image)
    return image


def blend(image: np.ndarray, transmission: np.ndarray, airlight: np.ndarray) -> FloatArray:
    """Image t·E + (1 − t)·B, shape (H, W, 3), of an image E, a transmission and an airlight B."""
    require_maps(image=(image, 3), transmission=(transmission, 1))
    image, transmission, field = floats(image, transmission, _field(image, airlight))
    blended = np.empty_like(image)
    in_bands(_blend, *transmission.shape, image, transmission, field, blended)
    return blended


def _field(pixels: np.ndarray, airlight: np.ndarray) -> np.ndarray:
    """The airlight as (H, W, 3), or as (1, 1, 3) when it is the same everywhere."""
    if airlight.shape == (3,):
        return airlight.reshape(1, 1, 3)
    require_maps(image=(pixels, pixels.shape[2]), airlight=(airlight, 3))
    return airlight


@numba.njit(nogil=True, cache=True)
def _attenuate(first, last, image, transmission, layer):
    for y in range(first, last):
        for x in range(image.shape[1]):
            t = transmission[y, x]
            for c in range(3):
                layer[y, x, c] = t * image[y, x, c]
            layer[y, x, 3] = t


@numba.njit(nogil=True, cache=True)
def _over(first, last, layer, field, image):
    varies = field.size > 3
    one = layer.dtype.type(1)
    for y in range(first, last):
        for x in range(layer.shape[1]):
            opacity = layer[y, x, 3]
            for c in range(3):
                airlight = field[y, x, c] if varies else field[0, 0, c]
                image[y, x, c] = layer[y, x, c] + (one - opacity) * airlight


@numba.njit(nogil=True, cache=True)
def _blend(first, last, image, transmission, field, blended):
    varies = field.size > 3
    one = image.dtype.type(1)
    for y in range(first, last):
        for x in range(image.shape[1]):
            t = transmission[y, x]
            for c in range(3):
                airlight = field[y, x, c] if varies else field[0, 0, c]
                blended[y, x, c] = t * image[y, x, c] + (one - t) * airlight
