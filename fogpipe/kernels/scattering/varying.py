"""Blur with kernels that follow the optical thickness of each pixel, or its depth.

Each function has a fast and a direct solver: ``exact=True`` sums over all pairs of pixels, in float64.
"""

from __future__ import annotations

import math

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.scattering import basis, measured
from fogpipe.kernels.scattering.convolution import Form, blend
from fogpipe.kernels.scattering.direct import direct
from fogpipe.kernels.scattering.pixels import responses, weights

SAFETY = 0.5
"""Share of the tolerance that the basis aims at: its expectation takes frequencies and thicknesses as independent."""


def by_thickness(
    planes: FloatArray,
    thickness: FloatArray,
    q: float,
    focal: float,
    form: Form,
    tolerance: float = 0.0,
    exact: bool = False,
) -> FloatArray:
    """Blur (C, H, W) planes with the kernel of each pixel's optical thickness (H, W), at a focal length in pixels.

    Cost: for each kernel of the basis one cosine transform, and for each channel one and one for each kernel. Memory:
    the new planes, as many maps as there are kernels, and three more.
    """
    thickness = np.clip(thickness, measured.LEAST, measured.MOST)
    height, width = thickness.shape
    if exact:
        return direct(
            planes, lambda y, x: weights(measured.profiles(q, thickness[y, x])[0], focal, height, width), form
        )
    logs, aim, spreads = np.log(thickness), SAFETY * tolerance, form == "scatter"
    extent = float(np.ptp(logs)) or 1.0
    frequencies, power = basis.power_spectrum(planes, (logs - logs.min()) / extent if spreads else None)
    places, position = basis.nodes(logs, math.sqrt(power.sum()), aim)
    shares = basis.shares_of_nodes(position, len(places), np.square(planes).mean(axis=0) if spreads else None)
    few = basis.reduced(measured.profiles(q, np.exp(places)), shares, frequencies, power, focal, aim)
    kernels = [responses(profile, focal, height, width, planes.dtype.type) for profile in few.profiles]
    return blend(planes, position, few.coefficients, kernels, form)


def by_size(
    planes: FloatArray,
    position: FloatArray,
    profile: FloatArray,
    focals: tuple[float, ...],
    form: Form,
    exact: bool = False,
) -> FloatArray:
    """Blur (C, H, W) planes with one profile in several sizes, interpolated by the position (H, W) between them.

    Sizes are focal lengths in pixels, and 0 is sharp. The position is 0 … sizes − 1. Exact but for rounding.
    """
    height, width = position.shape
    if exact:
        sampled = [weights(profile, focal, height, width) if focal else _sharp(height, width) for focal in focals]
        return direct(planes, lambda y, x: _between(sampled, float(position[y, x])), form)
    sharp = np.ones_like(position)
    kernels = [responses(profile, f, height, width, planes.dtype.type) if f else sharp for f in focals]
    return blend(planes, position, np.eye(len(focals)), kernels, form)


def _sharp(height: int, width: int) -> tuple[FloatArray, float]:
    """Weights of a kernel that leaves all as it is."""
    quadrant = np.zeros((height + 1, width + 1))
    quadrant[0, 0] = 1
    return quadrant, 0.0


def _between(sampled: list[tuple[FloatArray, float]], position: float) -> tuple[FloatArray, float]:
    """Weights of an interpolated kernel."""
    index = min(int(position), len(sampled) - 2)
    share = position - index
    (quadrant, beyond), (next_quadrant, next_beyond) = sampled[index : index + 2]
    return (1 - share) * quadrant + share * next_quadrant, (1 - share) * beyond + share * next_beyond
