"""Diffusion on one level as a polynomial of the operator, in tiles that stay in the cache.

The equation ∂F/∂t = −A F is linear, so its solution at time 1 is e^{−A} F. On the spectrum [0, λ] of A, the Chebyshev
series of e^{−a} converges faster than any power once its degree passes √λ: what is left out is about
erfc(degree / √λ). A degree of m costs m steps of four neighbours; Euler would take λ/2 steps for a first-order result.

A tile is computed with a margin of as many cells as there are steps, in which the values age, so that all steps run in
the cache and no tile depends on another. A polynomial of high degree is the product of several, each of which is one
pass over the tiles. A tile in which no light moves is copied.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numba
import numpy as np
from numpy.polynomial import chebyshev
from scipy import special

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.grid import Level

TILE = (48, 96)
"""Rows and columns: with a margin of eight, what a step touches fits the second cache."""
LARGEST_MARGIN = 12
"""Above this degree the margins cost more than another pass over the layer."""


def degree_for(spectrum: float, share: float) -> int:
    """Least degree that leaves out at most ``share`` of any pattern, for the largest eigenvalue ``spectrum``."""
    if spectrum <= 0:
        return 0
    degree = max(1, int(math.sqrt(spectrum) * float(special.erfcinv(min(share, 1.0)))))
    while special.erfc((degree + 0.5) / math.sqrt(spectrum)) > share:
        degree += 1
    return degree


def coefficients(spectrum: float, degree: int) -> np.ndarray:
    """Chebyshev series of e^{−a} on [0, λ], scaled to be 1 at a = 0, so that the mean is conserved."""
    series = 2 * special.ive(np.arange(degree + 1), spectrum / 2)
    series[0] /= 2
    return series / series.sum()


@lru_cache(64)
def passes(spectrum: float, degree: int) -> tuple[np.ndarray, ...]:
    """Chebyshev series, 1 at a = 0, whose product is that of :func:`coefficients`, each of a degree for one pass.

    The roots are dealt out so that no factor grows much anywhere, which keeps rounding errors small, and
    the order is the best of some in what the errors of one pass become in those that follow. Up to 0.1 s, once.
    """
    series = coefficients(spectrum, degree)
    count = -(-degree // LARGEST_MARGIN)
    if count <= 1:
        return (series,)
    roots = chebyshev.chebroots(series)
    roots = roots[roots.imag > -1e-9]
    units = [np.array([root, root.conjugate()] if root.imag > 1e-9 else [root.real]) for root in roots]
    factors = []
    for own in _dealt(sorted(units, key=lambda unit: unit[0].real), count):
        nodes = np.cos(np.pi * (np.arange(len(own) + 1) + 0.5) / (len(own) + 1))
        factors.append(chebyshev.chebfit(nodes, np.prod((nodes[:, None] - own) / (1 - own), axis=1).real, len(own)))
    return tuple(factors[k] for k in _steadiest(factors))


def diffused(
    layer: FloatArray, level: Level, series: tuple[np.ndarray, ...], spectrum: float, added: FloatArray | None = None
) -> FloatArray:
    """Diffuse a layer (H, W, 4) on a level, after what a coarser level adds to its mobile cells.

    Parameters
    ----------
    series : as from :func:`passes`.
    spectrum : λ of these series.
    added : (H/2, W/2, 4).
    """
    rows, columns, _ = layer.shape
    real = layer.dtype.type
    nothing = np.zeros((1, 1, 4), layer.dtype)
    added = nothing if added is None else added
    rate = real(4 / spectrum if spectrum else 0)
    results = [np.empty_like(layer) for _ in series[:2]]
    height = TILE[0]
    for number, factor in enumerate(series):
        after = results[number % 2]
        arguments = (*TILE, _flat(layer), level.mass, level.east, level.south, real(level.clip), rate, level.mobile)
        bands = -(-rows // height), height * columns
        in_bands(_tiles, *bands, *arguments, added, _in_precision(factor, layer.dtype), _flat(after))
        layer, added = after, nothing
    return layer


def _flat(layer: FloatArray) -> FloatArray:
    """Rows of four numbers for each pixel."""
    return layer.reshape(len(layer), -1)


def _dealt(units: list[np.ndarray], count: int) -> list[np.ndarray]:
    """Roots in groups, every n-th in one, and then swapped as long as that lowers what a factor grows to."""
    points = np.cos(np.linspace(0, np.pi, 129))
    logs = np.array([np.log(np.abs(np.prod((points[:, None] - u) / (1 - u), axis=1)) + 1e-30) for u in units])
    group = np.arange(len(units)) % count
    sums = np.array([logs[group == k].sum(axis=0) for k in range(count)])
    rng = np.random.default_rng(0)
    for i, j in rng.integers(len(units), size=(1500, 2)):
        a, b = group[i], group[j]
        one, other = sums[a] + logs[j] - logs[i], sums[b] + logs[i] - logs[j]
        if a != b and max(one.max(), other.max()) < max(sums[a].max(), sums[b].max()):
            sums[a], sums[b] = one, other
            group[i], group[j] = b, a
    return [np.concatenate([unit for unit, k in zip(units, group, strict=True) if k == own]) for own in range(count)]


def _in_precision(series: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Rounded so that the sum still is 1."""
    rounded = series.astype(dtype)
    rounded[0] += dtype.type(1 - rounded.sum(dtype=np.float64))
    return rounded


def _steadiest(factors: list[np.ndarray]) -> tuple[int, ...]:
    points = np.cos(np.linspace(0, np.pi, 257))
    values = np.abs([chebyshev.chebval(points, factor) for factor in factors])
    rng = np.random.default_rng(1)
    orders = [np.arange(len(factors)), *(rng.permutation(len(factors)) for _ in range(100))]

    def growth(order: np.ndarray) -> float:
        before = np.cumprod(values[order], axis=0).max()
        return max(before, np.cumprod(values[order[::-1]], axis=0).max())

    return tuple(int(k) for k in min(orders, key=growth))


@numba.njit(nogil=True, cache=True)
def _tiles(first, last, height, width, layer, mass, east, south, clip, rate, mobile, added, series, after):
    rows, columns = mass.shape
    margin = len(series) - 1
    # One cell more on each side, of conductance 0, so that every cell of a tile has four neighbours.
    tall, wide = min(height + 2 * margin, rows) + 2, 4 * (min(width + 2 * margin, columns) + 2)
    now, before = np.zeros((tall, wide), layer.dtype), np.zeros((tall, wide), layer.dtype)
    total, inverse = np.zeros((tall, wide), layer.dtype), np.zeros((tall, wide), layer.dtype)
    beside, below = np.zeros((tall, wide), layer.dtype), np.zeros((tall, wide), layer.dtype)
    line = np.zeros(wide, layer.dtype)
    for tile in range(first, last):
        for left in range(0, columns, width):
            top = tile * height
            bottom, right = min(top + height, rows), min(left + width, columns)
            y0, y1 = max(top - margin, 0), min(bottom + margin, rows)
            x0, x1 = max(left - margin, 0), min(right + margin, columns)
            if not _load_level(y0, y1, x0, x1, mass, east, south, clip, rate, line, inverse, beside, below):
                for y in range(top, bottom):
                    _copy(layer[y, 4 * left : 4 * right], after[y, 4 * left : 4 * right])
                continue
            for y in range(y0, y1):
                row = before[y - y0 + 1, 4:]
                _copy(layer[y, 4 * x0 : 4 * x1], row)
                if added.size > 4:
                    _add(mobile[y], added[y // 2], x0, x1, row)
            i0, i1 = 4, 4 * (x1 - x0 + 1)
            for j in range(1, y1 - y0 + 1):
                _flow(j, i0, i1, before, beside, below, line)
                _first_step(line, before[j, i0:i1], inverse[j, i0:], series, now[j, i0:], total[j, i0:])
            for degree in range(2, margin + 1):
                # Values one step from a cut are one step less good: only what the tile still needs is computed.
                needed = margin - degree
                i0, i1 = 4 * (max(left - needed, x0) - x0 + 1), 4 * (min(right + needed, x1) - x0 + 1)
                for j in range(max(top - needed, y0) - y0 + 1, min(bottom + needed, y1) - y0 + 1):
                    _flow(j, i0, i1, now, beside, below, line)
                    _step(line, now[j, i0:i1], inverse[j, i0:], series[degree], before[j, i0:], total[j, i0:])
                now, before = before, now
            for y in range(top, bottom):
                start = 4 * (left - x0 + 1)
                _copy(total[y - y0 + 1, start : start + 4 * (right - left)], after[y, 4 * left :])


@numba.njit(nogil=True, cache=True)
def _load_level(y0, y1, x0, x1, mass, east, south, clip, rate, line, inverse, beside, below):
    """1/m and the conductances, once for each channel, 0 beyond the part; whether any is above 0."""
    zero, one = mass.dtype.type(0), mass.dtype.type(1)
    largest = zero
    size = x1 - x0
    last = mass.shape[0] - 1
    for y in range(y0, y1):
        here, under = mass[y, x0:], mass[min(y + 1, last), x0:]
        to_east, to_south = east[y, x0:], south[y, x0:]
        for i in range(size):
            line[i] = rate * min(to_south[i], clip * min(here[i], under[i]))
            largest = max(largest, line[i])
        _for_channels(line[:size], below[y - y0 + 1, 4:])
        for i in range(size - 1):
            line[i] = rate * min(to_east[i], clip * min(here[i], here[i + 1]))
            largest = max(largest, line[i])
        line[size - 1] = zero
        _for_channels(line[:size], beside[y - y0 + 1, 4:])
        for i in range(size):
            line[i] = one / here[i] if here[i] > zero else zero
        _for_channels(line[:size], inverse[y - y0 + 1, 4:])
    below[y1 - y0, :] = zero
    return largest > zero


@numba.njit(nogil=True, cache=True)
def _for_channels(values, row):
    for i in range(len(values)):
        value = values[i]
        row[4 * i] = value
        row[4 * i + 1] = value
        row[4 * i + 2] = value
        row[4 * i + 3] = value


@numba.njit(nogil=True, cache=True)
def _copy(source, target):
    for i in range(len(source)):
        target[i] = source[i]


@numba.njit(nogil=True, cache=True)
def _add(mobile, added, x0, x1, row):
    zero, one = row.dtype.type(0), row.dtype.type(1)
    for x in range(x0, x1):
        share = one if mobile[x] > zero else zero
        for k in range(4):
            row[4 * (x - x0) + k] += share * added[x // 2, k]


# The compiler works on many cells at once only in loops that read and write few arrays, from 0 on: hence the line.


@numba.njit(nogil=True, cache=True)
def _flow(j, i0, i1, now, beside, below, line):
    """What flows into the cells of a row."""
    size = i1 - i0
    here, flow = now[j, i0:i1], line[:size]
    west, east, to_west, to_east = now[j, i0 - 4 :], now[j, i0 + 4 :], beside[j, i0 - 4 :], beside[j, i0:]
    for i in range(size):
        flow[i] = to_west[i] * (west[i] - here[i]) + to_east[i] * (east[i] - here[i])
    north, south, to_north, to_south = now[j - 1, i0:], now[j + 1, i0:], below[j - 1, i0:], below[j, i0:]
    for i in range(size):
        flow[i] += to_north[i] * (north[i] - here[i]) + to_south[i] * (south[i] - here[i])


@numba.njit(nogil=True, cache=True)
def _first_step(flow, here, inverse, series, after, total):
    """T(1) = X T(0)."""
    half = flow.dtype.type(0.5)
    for i in range(len(here)):
        after[i] = here[i] + half * inverse[i] * flow[i]
        total[i] = series[0] * here[i] + series[1] * after[i]


@numba.njit(nogil=True, cache=True)
def _step(flow, here, inverse, share, older, total):
    """The recurrence T(k+1) = 2 X T(k) − T(k−1) with X = 1 − 2A/λ; ``older`` holds T(k−1), then T(k+1)."""
    for i in range(len(here)):
        after = (here[i] - older[i]) + here[i] + inverse[i] * flow[i]
        older[i] = after
        total[i] += share * after
