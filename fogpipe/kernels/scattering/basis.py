r"""Few kernels that stand for a whole range of them.

The profiles of all optical thicknesses between the least and the largest of an image lie near a space of few
dimensions. The one with the least root-mean-square error on a given picture comes from a singular value
decomposition of what the profiles do to its frequencies, weighted by the power that the picture has there and by the
light at each thickness. The mean profile is always in it and the others have no energy of their own, so that light is
conserved exactly, however few there are.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import fft
from scipy.special import j0

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import threads
from fogpipe.kernels.scattering.profiles import ANGLES

MOST_NODES = 97
"""Thicknesses at which profiles are made, at most; in between, the coefficients are interpolated linearly."""
FREQUENCIES = 96


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
    response = hankel(family - mean, frequencies, focal)
    left, strengths, _ = np.linalg.svd(weights_nodes[:, None] * response * np.sqrt(power), full_matrices=False)
    # What the basis leaves out is the root of the sum of squares of the other singular values.
    left_out = np.sqrt(np.append(np.cumsum(strengths[::-1] ** 2)[::-1], 0))
    rank = min(int(np.argmax(left_out <= tolerance)), len(family) - 1)
    used = left[:, :rank]
    profiles = (used.T * weights_nodes) @ (family - mean)
    return Basis(np.vstack([mean, profiles]), np.vstack([np.ones(len(family)), (used / weights_nodes[:, None]).T]))


def hankel(profiles: FloatArray, frequencies: FloatArray, focal: float) -> FloatArray:
    """Factors by which profiles multiply waves of these frequencies, (profiles, frequencies)."""
    radius = focal * np.tan(ANGLES[:-1])
    waves = j0(np.outer(radius, frequencies))
    widths = np.gradient(ANGLES)[:-1]
    return 2 * np.pi * (profiles[:, :-1] * widths) @ waves


def power_spectrum(planes: FloatArray, share: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Frequencies in radians per pixel, and the mean square of the planes around each, which add to their variance.

    With a ``share`` in [0, 1], the planes are also weighted with half waves of it: where light spreads
    by parts, the borders between parts are detail, too.
    """
    _, height, width = planes.shape
    step = max(1, round(math.sqrt(height * width / 2**18)))
    small = planes[:, ::step, ::step]
    rows = np.pi / height * np.arange(small.shape[1])[:, None]
    columns = np.pi / width * np.arange(small.shape[2])
    radial = np.hypot(rows, columns)
    borders = np.geomspace(np.pi / max(height, width) / 2, np.pi * 1.5, FREQUENCIES + 1)
    power = np.zeros(FREQUENCIES)
    for wave in range(1 if share is None else 3):
        part = small if share is None else small * np.cos(np.pi * wave * share[::step, ::step])
        spectrum = fft.dctn(part, axes=(1, 2), norm="ortho", workers=threads())
        squares = np.mean(np.square(spectrum, dtype=np.float64), axis=0) / radial.size
        squares[0, 0] = 0
        power += np.histogram(radial, borders, weights=squares)[0]
    return np.sqrt(borders[1:] * borders[:-1]), power


def nodes(values: np.ndarray, count: int = MOST_NODES) -> tuple[FloatArray, FloatArray]:
    """Nodes from the least to the largest of the values, and the place of each value between them."""
    low, high = float(values.min()), float(values.max())
    if high <= low:
        return np.array([low]), np.zeros_like(values)
    count = max(2, min(count, math.ceil((high - low) * count / 3)))
    return np.linspace(low, high, count), (values - low) * ((count - 1) / (high - low))


def seen(
    planes: FloatArray, position: FloatArray, count: int, spreads: bool
) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """What :func:`reduced` must know of a picture: the share of each node, and the power spectrum.

    Where pixels collect light, a node counts as many pixels as it has; where they spread it, the power of their light.
    """
    if count == 1:
        return np.ones(1), (np.ones(1), np.zeros(1))
    counted = np.square(planes, dtype=np.float64).mean(axis=0).ravel() if spreads else None
    shares = np.bincount(np.rint(position).astype(np.intp).ravel(), counted, count)
    total = shares.sum()
    shares = shares / total if total > 0 else np.full(count, 1 / count)
    return shares, power_spectrum(planes, position / (count - 1) if spreads else None)
