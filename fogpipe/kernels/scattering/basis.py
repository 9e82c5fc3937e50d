r"""Few kernels that stand for a whole range of them.

The profiles of all optical thicknesses between the least and the largest of an image lie near a space of few
dimensions. The one with the least root-mean-square error on a given picture comes from a singular value
decomposition of what the profiles do to its frequencies, weighted by the power that the picture has there and by the
light at each thickness. The mean profile is always in it and the others have no energy of their own, so that light is
conserved exactly, however few there are.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import fft
from scipy.special import itj0y0

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import threads
from fogpipe.kernels.scattering.profiles import ANGLES

FREQUENCIES = 48
"""Radial bands into which the spectrum of a picture is sorted."""
SAMPLE = 2**15
"""Pixels of a picture that its spectrum is taken from, about. What is left out aliases, to the safe side."""
PER_SQUARE = 0.1
"""Error of a blur over its variation and the square of the step in ln T between nodes: measured 0.03."""


class Basis(NamedTuple):
    """Profiles that are summed, (kernels, angles), and their coefficients, (kernels, nodes)."""

    profiles: FloatArray
    coefficients: FloatArray


def reduced(
    family: FloatArray,
    shares: FloatArray,
    frequencies: FloatArray,
    power: FloatArray,
    focal: float,
    tolerance: float,
) -> Basis:
    """The smallest basis that is expected to keep the tolerance.

    Parameters
    ----------
    family : (nodes, angles) profiles.
    shares : (nodes,) share of the light that is spread by each of them.
    frequencies, power : (n,) radians per pixel, and mean square of the picture around each of them, without its mean.
    focal : Focal length, pixels.
    tolerance : Root-mean-square error allowed.
    """
    mean = shares @ family / shares.sum()
    weights_nodes = np.sqrt(shares / shares.sum() + 1e-6)
    factors = response(family - mean, frequencies, focal)
    left, strengths, _ = np.linalg.svd(weights_nodes[:, None] * factors * np.sqrt(power), full_matrices=False)
    # What the basis leaves out is the root of the sum of squares of the other singular values.
    left_out = np.sqrt(np.append(np.cumsum(strengths[::-1] ** 2)[::-1], 0))
    rank = min(int(np.argmax(left_out <= tolerance)), len(family) - 1)
    used = left[:, :rank]
    profiles = (used.T * weights_nodes) @ (family - mean)
    return Basis(np.vstack([mean, profiles]), np.vstack([np.ones(len(family)), (used / weights_nodes[:, None]).T]))


def response(profiles: FloatArray, frequencies: FloatArray, focal: float) -> FloatArray:
    """Factors by which kernels of pixels multiply waves of these frequencies, (profiles, frequencies).

    A pixel averages a kernel over its area, which multiplies each frequency by sinc(ω/2π), and all frequencies that
    differ by 2π look the same on pixels; the factors are for waves along an axis.
    """
    finer = np.geomspace(frequencies[0], 5 * np.pi, FREQUENCIES)
    continuous = hankel(profiles, finer, focal)
    total = np.zeros((len(profiles), len(frequencies)))
    for order in range(-2, 3):
        alias = frequencies + 2 * np.pi * order
        factors = np.array([np.interp(np.log(np.abs(alias)), np.log(finer), row) for row in continuous])
        total += factors * np.sinc(alias / (2 * np.pi))
    return total


def hankel(profiles: FloatArray, frequencies: FloatArray, focal: float) -> FloatArray:
    """Factors by which profiles multiply waves of these frequencies, (profiles, frequencies).

    Between two angles the energy is taken as even over the distance r = f tan θ, and ∫ J0 is exact.
    """
    steps = np.pi * (profiles[:, 1:-1] + profiles[:, :-2]) * np.diff(ANGLES[:-1])
    # Not by BLAS, whose threads wait for each other longer than this takes.
    return np.einsum("ps,sf->pf", steps, _rings(tuple(frequencies), focal))


@lru_cache(maxsize=8)
def _rings(frequencies: tuple[float, ...], focal: float) -> FloatArray:
    """Factors by which the energy between two angles multiplies waves, (angles − 2, frequencies)."""
    radius = focal * np.tan(ANGLES[:-1])
    waves = np.diff(itj0y0(np.outer(radius, frequencies))[0], axis=0) / frequencies
    return waves / np.diff(radius)[:, None]


def power_spectrum(planes: FloatArray, share: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Frequencies in radians per pixel, and the mean square of the planes around each, which add to their variance.

    With a ``share`` in [0, 1], the planes are also weighted with half waves of it: where light spreads
    by parts, the borders between parts are detail, too.
    """
    _, height, width = planes.shape
    step = max(1, round(math.sqrt(height * width / SAMPLE)))
    small = planes[:, ::step, ::step]
    rows = np.pi / height * np.arange(small.shape[1])[:, None]
    radial = np.hypot(rows, np.pi / width * np.arange(small.shape[2]))
    least, most = np.pi / max(height, width) / 2, 1.5 * np.pi
    radial[0, 0] = least  # of the mean, which counts as nothing
    band = (FREQUENCIES / math.log(most / least) * np.log(radial / least)).astype(np.intp)
    power = np.zeros(FREQUENCIES)
    for wave in range(1 if share is None else 3):
        part = small if share is None else small * np.cos(np.pi * wave * share[::step, ::step])
        spectrum = np.asarray(fft.dctn(part, axes=(1, 2), norm="ortho", workers=threads()))
        squares = np.square(spectrum, dtype=np.float64).mean(axis=0) / radial.size
        squares[0, 0] = 0
        power += np.bincount(band.ravel(), squares.ravel(), FREQUENCIES)
    return least * (most / least) ** ((np.arange(FREQUENCIES) + 0.5) / FREQUENCIES), power


def nodes(values: FloatArray, variation: float, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Nodes from the least to the largest of the values, and the place of each value between them.

    Between nodes coefficients are interpolated linearly, so that their distance follows from the tolerance.
    """
    low, high = float(values.min()), float(values.max())
    if high <= low:
        return np.array([low]), np.zeros_like(values)
    step = min(max(math.sqrt(tolerance / (PER_SQUARE * variation + 1e-30)), 0.02), 0.5)
    count = 1 + math.ceil((high - low) / step)
    return np.linspace(low, high, count), (values - low) * ((count - 1) / (high - low))


def shares_of_nodes(position: FloatArray, count: int, light: FloatArray | None) -> FloatArray:
    """Share of the pixels that is nearest to each node, or of the light, if it is given."""
    weights = None if light is None else light.astype(np.float64).ravel()
    shares = np.bincount(np.rint(position).astype(np.intp).ravel(), weights, count)
    total = shares.sum()
    return shares / total if total > 0 else np.full(count, 1 / count)
