"""Blur with a kernel for the optical thickness of each pixel: a fast solver and a direct one."""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.scattering import basis, fitted, profiles
from fogpipe.kernels.scattering.convolution import Form, blend
from fogpipe.kernels.scattering.pixels import responses, weights

SAFETY = 0.5
"""Share of the tolerance that the basis aims at, for what its expectation leaves out."""


def by_thickness(
    planes: FloatArray, thickness: FloatArray, q: float, focal: float, form: Form, tolerance: float
) -> FloatArray:
    """Blur (C, H, W) planes with the fitted kernel of each pixel's optical thickness (H, W).

    Cost: for each channel and kernel of the basis one cosine transform, and one for each of both. Memory: two sets
    of planes, and as many maps as there are kernels.
    """
    logs = np.log(np.clip(thickness, fitted.LEAST, fitted.MOST))
    places, position = basis.nodes(logs)
    family = fitted.profiles(q, np.exp(places))
    few = basis.Basis(family, np.ones((1, 1)))
    if len(places) > 1:
        light = np.mean(np.square(planes), axis=0) if form == "scatter" else np.ones_like(position)
        shares = basis.shares_of(position, light, len(places))
        spectrum = basis.power_spectrum(planes, position / (len(places) - 1) if form == "scatter" else None)
        few = basis.reduced(family, shares, *spectrum, focal, SAFETY * tolerance)
    kernels = [responses(profile, focal, *position.shape, planes.dtype.type) for profile in few.profiles]
    return blend(planes, position, few.coefficients, kernels, form)


def direct(planes: FloatArray, thickness: FloatArray, q: float, focal: float, form: Form) -> FloatArray:
    """The sum over all pairs of pixels and their mirror images, each with the kernel of its pixel, in float64.

    Cost: 4 (H W)² multiplications for each channel; for pictures of some ten thousand pixels.
    """
    planes = planes.astype(np.float64)
    height, width = thickness.shape
    blurred = np.zeros_like(planes)
    own = np.empty((len(planes), height, width))
    for y in range(height):
        row = np.clip(thickness[y].astype(np.float64), fitted.LEAST, fitted.MOST)
        for x, profile in enumerate(fitted.profiles(q, row)):
            quadrant, beyond = weights(profile, focal, height, width)
            in_bands(_kernel_around, height, width, y, x, quadrant, beyond / (height * width), own[0])
            if form == "scatter":
                blurred += planes[:, y, x, None, None] * own[0]
            else:
                blurred[:, y, x] = np.tensordot(planes, own[0])
    return blurred


@njit(cache=True, nogil=True)
def _kernel_around(first, last, y, x, quadrant, even, own):  # pragma: no cover - compiled
    """Weights of all pixels seen from one, with those of their mirror images."""
    height, width = own.shape
    for row in range(first, last):
        up, mirrored_up = abs(row - y), row + y + 1
        mirrored_up = min(mirrored_up, 2 * height - mirrored_up)
        for column in range(width):
            across, mirrored = abs(column - x), column + x + 1
            mirrored = min(mirrored, 2 * width - mirrored)
            own[row, column] = (quadrant[up, across] + quadrant[mirrored_up, across] + quadrant[up, mirrored]) + (
                quadrant[mirrored_up, mirrored] + even
            )


def published_profile(kernel: str, q: float, thickness: float) -> FloatArray:
    """Profile of a published kernel by name, ``"series"`` or ``"gaussian"``."""
    return {"series": profiles.legendre, "gaussian": profiles.generalised_gaussian}[kernel](q, thickness)


def by_size(
    planes: FloatArray, position: FloatArray, profile: FloatArray, focals: tuple[float, ...], form: Form
) -> FloatArray:
    """Blur planes with one profile in several sizes, interpolated by the position between them; exact."""
    sharp = np.ones_like(position)
    kernels = [responses(profile, focal, *position.shape, planes.dtype.type) if focal else sharp for focal in focals]
    return blend(planes, position, np.eye(len(focals)), kernels, form)
