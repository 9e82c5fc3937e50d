"""Noise for procedural textures: a hash of two whole numbers, and smooth noise made of it."""

from __future__ import annotations

import math

from numba import njit


@njit(nogil=True, cache=True)
def hash01(i, j):
    """A number in [0, 1) that depends on two whole numbers and looks random."""
    mixed = (i * 374761393 + j * 668265263) & 0xFFFFFFFF
    mixed = ((mixed ^ (mixed >> 13)) * 1274126177) & 0xFFFFFFFF
    mixed = ((mixed ^ (mixed >> 15)) * 2246822519) & 0xFFFFFFFF
    return ((mixed ^ (mixed >> 16)) & 0xFFFFFF) / 16777216.0


@njit(nogil=True, cache=True)
def value_noise(x, y):
    """Smooth noise in [0, 1): random values at whole numbers, blended by ``3u² − 2u³`` in between."""
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    i, j = int(i), int(j)
    u, v = u * u * (3 - 2 * u), v * v * (3 - 2 * v)
    above = hash01(i, j) * (1 - u) + hash01(i + 1, j) * u
    below = hash01(i, j + 1) * (1 - u) + hash01(i + 1, j + 1) * u
    return above * (1 - v) + below * v


@njit(nogil=True, cache=True)
def fractal_noise(x, y, octaves):
    """Sum of value noise over octaves, each twice as fine and half as strong, in [0, 1) with mean 1/2."""
    total, weight = 0.0, 0.5
    for octave in range(octaves):
        total += weight * value_noise(x + 17.3 * octave, y - 9.1 * octave)
        x, y, weight = 2.03 * x, 2.03 * y, 0.5 * weight
    return total / (1 - 2 * weight)
