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

MARGINED = (96, 256)
"""Rows and columns of a tile with its margins: what a step touches nearly fits the second cache."""
LARGEST_MARGIN = 16
"""Above this degree the margins cost more than another pass over the layer."""


def degree_for(spectrum: float, share: float) -> int:
    """Least degree that leaves out at most ``share`` of any pattern, for the largest eigenvalue ``spectrum``."""
    if spectrum <= 0:
        return 0
    degree = max(1, int(math.sqrt(spectrum) * float(special.erfcinv(min(share, 1.0)))))
    while special.erfc((degree + 0.5) / math.sqrt(spectrum)) > share:
        degree += 1
    if spectrum <= 64:  # few steps, of which each counts
        while _left_out(spectrum, degree) > share:
            degree += 1
    return degree


@lru_cache(256)
def _left_out(spectrum: float, degree: int) -> float:
    points = np.linspace(0, 1, 2001) ** 2  # share of the spectrum, dense near 0
    missed = chebyshev.chebval(1 - 2 * points, coefficients(spectrum, degree)) - np.exp(-spectrum * points)
    return float(np.abs(missed).max())


def coefficients(spectrum: float, degree: int) -> np.ndarray:
    """Chebyshev coefficients of the polynomial nearest to e^{−a} on [0, λ] that is 1 at a = 0: so the mean is kept.

    Nearest for a layer whose variance is spread over patterns like that of a photograph, evenly over the logarithm of
    a, and a tenth of it over all of [0, λ]. It leaves out half as much as the series of the same degree does once
    that is scaled to be 1 at 0.
    """
    if spectrum <= 0:
        return np.ones(1)
    count = 4 * degree + 64
    angle = (np.arange(count) + 0.5) / count * np.pi
    share = (1 - np.cos(angle)) / 2
    density = np.sin(angle) / np.maximum(share, 1e-4)
    weight = np.sqrt(density / density.sum() + 0.1 / count)[:, None]
    patterns = chebyshev.chebvander(1 - 2 * share, degree)[:, 1:] - 1
    wanted = np.expm1(-spectrum * share)[:, None]
    basis, triangle = np.linalg.qr(weight * patterns)
    series = np.linalg.solve(triangle, basis.T @ (weight * wanted))[:, 0]
    return np.r_[1 - series.sum(), series]


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
    for number, factor in enumerate(series):
        after = results[number % 2]
        height, width = (size - 2 * (len(factor) - 1) for size in MARGINED)
        arguments = (height, width, _flat(layer), level.mass, level.east, level.south, real(level.clip), rate)
        bands = -(-rows // height), height * columns
        in_bands(_tiles, *bands, *arguments, level.mobile, added, _in_precision(factor, layer.dtype), _flat(after))
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


# Tiles have one fixed width of 288 cells, the four channels of a row one after the other, and indices that cannot be
# negative: only then does the compiler see that the arrays of a step are apart, and works on 16 cells at once, whose
# weights it loads once for the four channels. Rows begin 16 cells in, so that vectors lie on their boundaries.
_ONE, _FOUR = np.uintp(1), np.uintp(4)
_CHANNEL = np.uintp(MARGINED[1] + 32)
_ROW = np.uintp(4 * _CHANNEL)
_WIDTH = int(_CHANNEL)


@numba.njit(nogil=True, cache=True)
def _tiles(first, last, height, width, layer, mass, east, south, clip, rate, mobile, added, series, after):
    rows, columns = mass.shape
    margin = len(series) - 1
    zero = layer.dtype.type(0)
    # One row more on each side, of conductance 0, so that every cell of a tile has four neighbours.
    tall = min(height + 2 * margin, rows) + 2
    size = tall * _WIDTH
    now, before, total = _zeros(4 * size, layer), _zeros(4 * size, layer), _zeros(4 * size, layer)
    inverse, beside, below = _zeros(size, layer), _zeros(size, layer), _zeros(size, layer)
    values, sums = before.reshape(tall, 4, _WIDTH), total.reshape(tall, 4, _WIDTH)
    grid = inverse.reshape(tall, _WIDTH), beside.reshape(tall, _WIDTH), below.reshape(tall, _WIDTH)
    for tile in range(first, last):
        for left in range(0, columns, width):
            top = tile * height
            bottom, right = min(top + height, rows), min(left + width, columns)
            y0, y1 = max(top - margin, 0), min(bottom + margin, rows)
            x0, x1 = max(left - margin, 0), min(right + margin, columns)
            if not _load_level(y0, y1, x0, x1, mass, east, south, clip, rate, *grid):
                for y in range(top, bottom):
                    _copy(layer[y, 4 * left : 4 * right], after[y, 4 * left : 4 * right])
                continue
            _load_layer(y0, y1, x0, x1, layer, mobile, added, values)
            whole = _range(1, y1 - y0 + 1, 0, x1 - x0)
            # Two terms are added to the sum at once, in the last step and every second one before it.
            share = series[1] if margin % 2 else zero
            _first_step(*whole, before, beside, below, inverse, series[0], share, now, total)
            older, newer = before, now
            for degree in range(2, margin + 1):
                # Values one step from a cut are one step less good: only what the tile still needs is computed.
                needed = margin - degree
                part = _range(
                    max(top - needed, y0) - y0 + 1,
                    min(bottom + needed, y1) - y0 + 1,
                    max(left - needed, x0) - x0,
                    min(right + needed, x1) - x0,
                )
                if (margin - degree) % 2:
                    _step(*part, newer, beside, below, inverse, older)
                else:
                    shares = series[degree - 1], series[degree]
                    _step_and_sum(*part, newer, beside, below, inverse, *shares, older, total)
                older, newer = newer, older
            _store(top, bottom, left, right, y0, x0, sums, after)


@numba.njit(nogil=True, cache=True)
def _zeros(size, layer):
    """On a boundary of the first cache's lines."""
    block = np.zeros(size + 64, layer.dtype)
    start = (-block.ctypes.data % 64) // block.itemsize
    return block[start : start + size]


@numba.njit(nogil=True, cache=True)
def _range(j0, j1, i0, i1):
    """Rows, first column and columns of a part of a tile, whole vectors of it."""
    start = i0 // 16 * 16
    return np.uintp(j0), np.uintp(j1), np.uintp(start + 16), np.uintp((i1 - start + 15) // 16 * 16)


@numba.njit(nogil=True, cache=True)
def _load_level(y0, y1, x0, x1, mass, east, south, clip, rate, inverse, beside, below):
    """1/m and the conductances, 0 beyond the part; whether any is above 0."""
    zero, one = mass.dtype.type(0), mass.dtype.type(1)
    largest = zero
    size = x1 - x0
    last = mass.shape[0] - 1
    for y in range(y0, y1):
        here, under = mass[y, x0:], mass[min(y + 1, last), x0:]
        to_east, to_south = east[y, x0:], south[y, x0:]
        j = y - y0 + 1
        across, down, parts = beside[j, 16:], below[j, 16:], inverse[j, 16:]
        for i in range(size):
            down[i] = rate * min(to_south[i], clip * min(here[i], under[i]))
            largest = max(largest, down[i])
        for i in range(size - 1):
            across[i] = rate * min(to_east[i], clip * min(here[i], here[i + 1]))
            largest = max(largest, across[i])
        for i in range(size):
            parts[i] = one / here[i] if here[i] > zero else zero
        across[size - 1 :] = zero
        down[size:] = zero
    below[y1 - y0, :] = zero
    return largest > zero


@numba.njit(nogil=True, cache=True)
def _load_layer(y0, y1, x0, x1, layer, mobile, added, values):
    zero, one = layer.dtype.type(0), layer.dtype.type(1)
    for y in range(y0, y1):
        pixels, row = layer[y, 4 * x0 : 4 * x1], values[y - y0 + 1]
        a, b, c, d = row[0, 16:], row[1, 16:], row[2, 16:], row[3, 16:]
        for i in range(x1 - x0):
            a[i], b[i], c[i], d[i] = pixels[4 * i], pixels[4 * i + 1], pixels[4 * i + 2], pixels[4 * i + 3]
        if added.size > 4:
            more = added[y // 2]
            for x in range(x0, x1):
                share = one if mobile[y, x] > zero else zero
                for k in range(4):
                    row[k, 16 + x - x0] += share * more[x // 2, k]
        row[:, 16 + x1 - x0 :] = zero


@numba.njit(nogil=True, cache=True)
def _store(top, bottom, left, right, y0, x0, sums, after):
    for y in range(top, bottom):
        row, start = sums[y - y0 + 1], 16 + left - x0
        a, b, c, d = row[0, start:], row[1, start:], row[2, start:], row[3, start:]
        pixels = after[y, 4 * left : 4 * right]
        for i in range(right - left):
            pixels[4 * i], pixels[4 * i + 1], pixels[4 * i + 2], pixels[4 * i + 3] = a[i], b[i], c[i], d[i]


@numba.njit(nogil=True, cache=True)
def _copy(source, target):
    for i in range(len(source)):
        target[i] = source[i]


@numba.njit(nogil=True, inline="always")
def _flow(now, a, to_west, to_east, to_north, to_south):
    """What flows into a cell."""
    here = now[a]
    return (
        to_west * (now[a - _ONE] - here)
        + to_east * (now[a + _ONE] - here)
        + to_north * (now[a - _ROW] - here)
        + to_south * (now[a + _ROW] - here)
    )


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _first_step(j0, j1, start, size, now, beside, below, inverse, constant, share, after, total):
    """T(1) = X T(0)."""
    half = inverse.dtype.type(0.5)
    for j in range(j0, j1):
        for i in range(size):
            b = j * _CHANNEL + start + i
            west, east, north, south = beside[b - _ONE], beside[b], below[b - _CHANNEL], below[b]
            for k in range(_FOUR):
                a = j * _ROW + k * _CHANNEL + start + i
                after[a] = now[a] + half * inverse[b] * _flow(now, a, west, east, north, south)
                total[a] = constant * now[a] + share * after[a]


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step(j0, j1, start, size, now, beside, below, inverse, older):
    """The recurrence T(k+1) = 2 X T(k) − T(k−1) with X = 1 − 2A/λ; ``older`` holds T(k−1), then T(k+1)."""
    for j in range(j0, j1):
        for i in range(size):
            b = j * _CHANNEL + start + i
            west, east, north, south = beside[b - _ONE], beside[b], below[b - _CHANNEL], below[b]
            for k in range(_FOUR):
                a = j * _ROW + k * _CHANNEL + start + i
                older[a] = (now[a] - older[a]) + now[a] + inverse[b] * _flow(now, a, west, east, north, south)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step_and_sum(j0, j1, start, size, now, beside, below, inverse, share, next_share, older, total):
    """A step, and what T(k) and T(k+1) add to the polynomial."""
    for j in range(j0, j1):
        for i in range(size):
            b = j * _CHANNEL + start + i
            west, east, north, south = beside[b - _ONE], beside[b], below[b - _CHANNEL], below[b]
            for k in range(_FOUR):
                a = j * _ROW + k * _CHANNEL + start + i
                after = (now[a] - older[a]) + now[a] + inverse[b] * _flow(now, a, west, east, north, south)
                older[a] = after
                total[a] += share * now[a] + next_share * after
