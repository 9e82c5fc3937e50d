r"""Perlin noise in two dimensions, and the density that is made of it.

Space is divided into cells. Each corner has a random gradient :math:`g`, drawn from a hash of the corner's whole
numbers, so that there is no table and no size. Between the corners :math:`c` of a cell

.. math:: n(x) = \sum_c w(x - c)\; g_c \cdot (x - c), \qquad w(d) = \prod_i \left(1 - f(|d_i|)\right), \qquad
          f(u) = 6 u^5 - 15 u^4 + 10 u^3,

which has two continuous derivatives (Perlin 2002). Value noise takes a random number in place of
:math:`g_c \cdot (x - c)`. Octaves are noises of half the period each; their lattices are shifted at random, because
gradient noise is 0 at the corners of its cells, and the coarse corners would otherwise be corners in all octaves.

The components of a gradient are uniform in [−1, 1], with the variance 1/3. So the variance over a cell is known,
:math:`D A^{D-1} B / 3` in D dimensions for gradient noise and :math:`A^D / 3` for value noise, with

.. math:: A = 2 \int_0^1 (1 - f)^2\, du = \tfrac{181}{231}, \qquad
          B = 2 \int_0^1 u^2 (1 - f)^2\, du = \tfrac{535}{9009},

and every noise here is scaled to the variance 1.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

Noise = Literal["gradient", "value"]

_A, _B = 181 / 231, 535 / 9009


def field(
    height: int,
    width: int,
    key: int,
    *,
    period: float,
    octaves: int,
    persistence: float = 0.5,
    noise: Noise = "gradient",
    tileable: bool = False,
) -> FloatArray:
    """Noise of mean 0 and variance 1 (over all keys): the sum of octaves.

    Parameters
    ----------
    height, width : pixels. Without tiling, a value does not depend on them: a larger field continues a smaller one.
    key : 64 random bits.
    period : size of a cell of the first octave, pixels. Each octave halves it.
    octaves : how many; 0 gives a field of zeros.
    persistence : amplitude of an octave over that of the one before.
    noise : gradient noise, or value noise.
    tileable : whether the field continues at the opposite border. The period is then changed to the nearest that
        divides each side.

    Returns
    -------
    (H, W) float32.

    Notes
    -----
    About 1 ns per pixel and octave on two cores. One array.
    """
    total = np.zeros((height, width), np.float32)
    for octave, weight in enumerate(octave_weights(octaves, persistence)):
        cells = [max(1, round(size / period)) * 2**octave if tileable else 0 for size in (height, width)]
        rows, columns = (
            _Axis(size, period / 2**octave, count, octave_shift(key, octave, axis))
            for axis, (size, count) in enumerate(zip((height, width), cells, strict=True))
        )
        strength = np.float32(weight / math.sqrt(_A**2 / 3 if noise == "value" else cell_variance(2)))
        lattice = rows.arrays, columns.arrays, columns.starts, *cells, octave_key(key, octave)
        in_bands(_add_octave, height, width, *lattice, strength, noise == "gradient", total)
    return total


def density(noise: FloatArray, contrast: float) -> FloatArray:
    r"""Density of mean 1 from noise of mean 0 and variance 1, in place, :math:`\rho = (1 + a n)^2 / (1 + a^2)`.

    Since :math:`E(1 + a n)^2 = 1 + a^2` whatever the distribution of n, the mean is 1 without any clipping. The
    standard deviation is ``contrast`` where n is normally distributed, see :func:`amplitude`.
    """
    rows, columns = noise.shape
    in_bands(_to_density, rows, columns, np.float32(amplitude(contrast)), noise)
    return noise


def amplitude(contrast: float) -> float:
    r"""The a that gives the density a standard deviation of ``contrast``, for normally distributed noise.

    .. math:: a^2 = \sqrt{2 / (2 - c^2)} - 1 \qquad\text{from}\qquad c^2 = \frac{4 a^2 + 2 a^4}{(1 + a^2)^2}
    """
    return math.sqrt(math.sqrt(2 / (2 - contrast**2)) - 1)


def octave_weights(octaves: int, persistence: float) -> FloatArray:
    """Amplitudes of the octaves, for a sum of variance 1."""
    weights = persistence ** np.arange(octaves, dtype=np.float64)
    return weights / np.sqrt(np.sum(weights**2)) if octaves else weights


def cell_variance(dimensions: int) -> float:
    """Variance of gradient noise over a cell and all gradients."""
    return dimensions * _A ** (dimensions - 1) * _B / 3


def octave_key(key: int, octave: int) -> np.uint64:
    """The key of one octave."""
    return np.uint64(hashed(np.uint64(key), octave, 0, 0))


def octave_shift(key: int, octave: int, axis: int) -> float:
    """By how much of a cell the lattice of an octave is shifted along an axis, in [0, 1)."""
    return float(hashed(np.uint64(key), octave, 1 + axis, 0)) / 2.0**64


class _Axis:
    """Where the pixels along one axis lie in the lattice: cell, position u in the cell, and f(u)."""

    def __init__(self, size: int, period: float, cells: int, shift: float):
        position = shift + np.arange(size) * (cells / size if cells else 1 / period)
        cell = np.floor(position)
        u = position - cell
        fade = u * u * u * (u * (6 * u - 15) + 10)
        self.arrays = cell.astype(np.int64), u.astype(np.float32), fade.astype(np.float32)
        self.starts = np.append(np.flatnonzero(np.diff(cell, prepend=-1.0)), size)
        """First pixel of each run of pixels in one cell, and the end."""


@njit(nogil=True, cache=True)
def hashed(key, i, j, k):
    """64 bits that depend on a key and three whole numbers and look random."""
    mixed = (key + np.uint64(i)) * np.uint64(0x9E3779B97F4A7C15)
    mixed = ((mixed ^ (mixed >> np.uint64(32))) + np.uint64(j)) * np.uint64(0xD6E8FEB86659FD93)
    mixed = ((mixed ^ (mixed >> np.uint64(32))) + np.uint64(k)) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(32))


@njit(nogil=True, cache=True)
def signed_share(bits, shift):
    """A number in [−1, 1) from the 21 bits that begin at ``shift``."""
    return np.float32(np.int64((bits >> np.uint64(shift)) & np.uint64(0x1FFFFF)) - 1048576) * np.float32(1 / 1048576)


@njit(nogil=True, cache=True)
def _add_octave(first, last, rows, columns, starts, high, wide, key, strength, is_gradient, total):
    """Add one octave. Within a run the corners are the same, so only u and f(u) vary from pixel to pixel."""
    row_cell, row_u, row_fade = rows
    column_cell, column_u, column_fade = columns
    runs = starts.size - 1
    across = np.empty((runs, 4), np.float32)  # for each corner of a run: random part along x,
    along = np.empty((runs, 4), np.float32)  # and along y, or the value
    row_of_corners = row_cell[first] - 2  # no row of cells, nor the one before the first
    for y in range(first, last):
        if row_cell[y] != row_of_corners:
            follows = row_cell[y] == row_of_corners + 1
            row_of_corners = row_cell[y]
            for run in range(runs):
                cell = column_cell[starts[run]]
                shared = run > 0 and cell == column_cell[starts[run - 1]] + 1
                for corner in range(4):
                    if follows and corner < 2:  # also a lower corner of the cell above
                        across[run, corner] = across[run, corner + 2]
                        along[run, corner] = along[run, corner + 2]
                        continue
                    if shared and corner % 2 == 0:  # also the right corner of the cell before
                        across[run, corner] = across[run - 1, corner + 1]
                        along[run, corner] = along[run - 1, corner + 1]
                        continue
                    i, j = cell + corner % 2, row_of_corners + corner // 2
                    bits = hashed(key, i % wide if wide else i, j % high if high else j, 0)
                    across[run, corner] = signed_share(bits, 0) * strength if is_gradient else np.float32(0)
                    along[run, corner] = signed_share(bits, 32) * strength
        v, down = row_u[y], row_fade[y]
        up = np.float32(1) - down
        above, below = (v, v - np.float32(1)) if is_gradient else (np.float32(1), np.float32(1))
        for run in range(runs):
            left_slope = up * across[run, 0] + down * across[run, 2]
            left_value = up * along[run, 0] * above + down * along[run, 2] * below
            slope = up * across[run, 1] + down * across[run, 3]
            value = up * along[run, 1] * above + down * along[run, 3] * below
            slope_change, value_change = slope - left_slope, value - slope - left_value
            for x in range(starts[run], starts[run + 1]):
                u = column_u[x]
                total[y, x] += left_value + left_slope * u + column_fade[x] * (value_change + slope_change * u)


@njit(nogil=True, cache=True)
def _to_density(first, last, a, noise):
    scale = np.float32(1) / (np.float32(1) + a * a)
    for y in range(first, last):
        for x in range(noise.shape[1]):
            root = np.float32(1) + a * noise[y, x]
            noise[y, x] = root * root * scale
