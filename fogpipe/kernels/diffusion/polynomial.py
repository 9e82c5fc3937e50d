"""Diffusion as a polynomial of the operator, in tiles that stay in the cache.

The equation ∂F/∂t = −A F is linear, so its solution at time 1 is e^{−A} F. On the spectrum [0, λ] of A, the Chebyshev
series of e^{−a} converges faster than any power once its degree passes √λ: what is left out is about
erfc(degree / √λ). A degree of m costs m steps of four neighbours; Euler would take λ/2 steps for a first-order result.

Each tile is computed with a margin of m cells in which the values age, so that all steps run in the cache, and no tile
depends on another. A tile in which no light moves is copied.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from scipy import special

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.grid import Grid

TILE = (64, 256)
"""Rows and columns: with a margin of ten, what a step touches fills the second cache."""
LARGEST_IN_TILES = 32
"""Above this degree the margins cost more than the cache saves, and the whole grid is stepped at once."""


def degree_for(spectrum: float, share: float) -> int:
    """Least degree that leaves out at most ``share`` of any pattern, for the largest eigenvalue ``spectrum``."""
    if spectrum <= 0:
        return 0
    degree = max(1, int(math.sqrt(spectrum) * float(special.erfcinv(min(share, 1.0)))))
    while _left_out(spectrum, degree) > share:
        degree += 1
    return degree


def coefficients(spectrum: float, degree: int) -> np.ndarray:
    """Chebyshev series of e^{−a} on [0, λ], scaled to be 1 at a = 0, so that the mean is conserved."""
    series = 2 * special.ive(np.arange(degree + 1), spectrum / 2)
    series[0] /= 2
    return series / series.sum()


def diffused(
    layer: FloatArray, grid: Grid, clip: float, share: float, coarse: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Diffuse what a layer adds to its coarse layer, and add the coarse layer as it has become.

    Parameters
    ----------
    layer : (H, 4, W)
    clip : largest rate across a face. Fine detail is gone at this rate already.
    share : what the polynomial may leave out of any pattern.
    coarse : the coarse layer, and what diffusion has added to it.
    """
    spectrum = _spectrum(grid, clip)
    degree = degree_for(spectrum, share)
    series = coefficients(spectrum, degree).astype(layer.dtype)
    rows, channels, columns = layer.shape
    height, width = TILE
    rate = layer.dtype.type(4 / spectrum if spectrum else 0)
    flow = (grid.east, grid.south, 1 / grid.widths, 1 / grid.heights, layer.dtype.type(clip), rate)
    base, added = coarse
    after = np.empty_like(layer)
    if degree <= LARGEST_IN_TILES:
        tile_rows = -(-rows // height)
        arguments = (*flow, series, base, added, base + added, after)
        in_bands(_tiles, tile_rows, height * columns, height, width, layer, *arguments)
        return after
    now, before, total = (np.zeros((rows + 2, channels, columns + 2), layer.dtype) for _ in range(3))
    weights = np.zeros((4, rows + 2, columns + 2), layer.dtype)
    _load_weights(0, rows, 0, columns, *flow, weights)
    moving = np.empty((rows, 2), np.int64)
    in_bands(_load, rows, columns, layer, base, weights, series, before, total, moving)
    in_bands(_first_step_of_all, rows, columns, moving, before, weights, series[1], now, total)
    for share_of_step in series[2:]:
        in_bands(_step_of_all, rows, columns, moving, now, weights, share_of_step, before, total)
        now, before = before, now
    in_bands(_store, rows, columns, total, base + added, after)
    return after


def _spectrum(grid: Grid, clip: float) -> float:
    """Upper bound of the eigenvalues (Gershgorin): twice the rates out of a cell, over its width, for each axis."""
    bound = 0.0
    for rates, widths in ((grid.east, grid.widths), (grid.south, grid.heights)):
        if len(widths) > 1:
            ways_out = np.full(len(widths), 2.0)
            ways_out[[0, -1]] = 1
            bound += 2 * min(clip, float(rates.max())) * float((ways_out / widths).max())
    return bound


def _left_out(spectrum: float, degree: int) -> float:
    return float(special.erfc((degree + 0.5) / math.sqrt(spectrum)))


@numba.njit(nogil=True, cache=True)
def _tiles(
    first, last, height, width, layer, east, south, inverse_widths, inverse_heights, clip, rate, series,
    base, added, later, after,
):  # fmt: skip
    rows, channels, columns = layer.shape
    margin = len(series) - 1
    # One cell more on each side, of weight 0, so that every cell of a tile has four neighbours.
    tall, wide = min(height + 2 * margin, rows) + 2, min(width + 2 * margin, columns) + 2
    now = np.zeros((tall, channels, wide), layer.dtype)
    before = np.zeros((tall, channels, wide), layer.dtype)
    total = np.zeros((tall, channels, wide), layer.dtype)
    weights = np.zeros((4, tall, wide), layer.dtype)
    line = np.zeros(wide + 3, layer.dtype)
    coarse_line = np.zeros(wide // 2 + 4, layer.dtype)
    for tile in range(first, last):
        for left in range(0, columns, width):
            top = tile * height
            bottom, right = min(top + height, rows), min(left + width, columns)
            y0, y1 = max(top - margin, 0), min(bottom + margin, rows)
            x0, x1 = max(left - margin, 0), min(right + margin, columns)
            if not _load_weights(y0, y1, x0, x1, east, south, inverse_widths, inverse_heights, clip, rate, weights):
                for y in range(top, bottom):
                    for k in range(channels):
                        here, out = layer[y, k, left:right], after[y, k, left:right]
                        _upsample(added, y, k, left, right, coarse_line, line)
                        for i in range(right - left):
                            out[i] = here[i] + line[i]
                continue
            for y in range(y0, y1):
                for k in range(channels):
                    _upsample(base, y, k, x0, x1, coarse_line, line)
                    here, value, share = layer[y, k, x0:x1], before[y - y0 + 1, k, 1:], total[y - y0 + 1, k, 1:]
                    for i in range(x1 - x0):
                        value[i] = here[i] - line[i]
                        share[i] = series[0] * value[i]
            _first_step(1, y1 - y0 + 1, 1, x1 - x0 + 1, before, weights, series[1], now, total)
            for degree in range(2, margin + 1):
                # Values one step from a cut are one step less good: only what the tile still needs is computed.
                needed = margin - degree
                j0, j1 = max(top - needed, y0) - y0 + 1, min(bottom + needed, y1) - y0 + 1
                i0, i1 = max(left - needed, x0) - x0 + 1, min(right + needed, x1) - x0 + 1
                _step(j0, j1, i0, i1, now, weights, series[degree], before, total)
                now, before = before, now
            for y in range(top, bottom):
                for k in range(channels):
                    share, out = total[y - y0 + 1, k, left - x0 + 1 :], after[y, k, left:right]
                    _upsample(later, y, k, left, right, coarse_line, line)
                    for i in range(right - left):
                        out[i] = share[i] + line[i]


@numba.njit(nogil=True, cache=True)
def _load(first, last, layer, base, weights, series, before, total, moving):
    """The part of each row in which light moves, and what the recurrence starts with; the rest stays as it is."""
    _, channels, columns = layer.shape
    line = np.zeros(columns + 3, layer.dtype)
    coarse_line = np.zeros(columns // 2 + 4, layer.dtype)
    for y in range(first, last):
        start, end = columns, 0
        for x in range(columns):
            if weights[:, y + 1, x + 1].any():
                start, end = min(start, x), x + 1
        moving[y] = start, end
        for k in range(channels):
            _upsample(base, y, k, 0, columns, coarse_line, line)
            for x in range(columns):
                value = layer[y, k, x] - line[x]
                before[y + 1, k, x + 1] = value
                total[y + 1, k, x + 1] = series[0] * value if start <= x < end else value


@numba.njit(nogil=True, cache=True)
def _store(first, last, total, later, after):
    _, channels, columns = after.shape
    line = np.zeros(columns + 3, after.dtype)
    coarse_line = np.zeros(columns // 2 + 4, after.dtype)
    for y in range(first, last):
        for k in range(channels):
            _upsample(later, y, k, 0, columns, coarse_line, line)
            for x in range(columns):
                after[y, k, x] = total[y + 1, k, x + 1] + line[x]


@numba.njit(nogil=True, cache=True)
def _first_step_of_all(first, last, moving, now, weights, share, after, total):
    for y in range(first, last):
        start, end = moving[y]
        _first_step(y + 1, y + 2, start + 1, end + 1, now, weights, share, after, total)


@numba.njit(nogil=True, cache=True)
def _step_of_all(first, last, moving, now, weights, share, other, total):
    for y in range(first, last):
        start, end = moving[y]
        _step(y + 1, y + 2, start + 1, end + 1, now, weights, share, other, total)


@numba.njit(nogil=True, cache=True)
def _load_weights(y0, y1, x0, x1, east, south, inverse_widths, inverse_heights, clip, rate, weights):
    """Weights of the neighbours west, east, north and south, 0 beyond the part; whether any is above 0."""
    zero = rate - rate
    largest = zero
    size = x1 - x0
    west_of, east_of, north_of, south_of = weights
    for y in range(y0, y1):
        j = y - y0 + 1
        along = rate * inverse_heights[y]
        across = inverse_widths[x0:x1]
        above, below = south[max(y - 1, 0), x0:x1], south[y, x0:x1]
        beside = east[y, x0:x1]
        for i in range(size):
            flow = rate * min(beside[i], clip)
            largest = max(largest, flow, below[i])
            east_of[j, i + 1] = flow * across[i]
            north_of[j, i + 1] = along * min(above[i], clip)
            south_of[j, i + 1] = along * min(below[i], clip)
        for i in range(1, size):
            west_of[j, i + 1] = rate * min(beside[i - 1], clip) * across[i]
        west_of[j, 1] = zero
        east_of[j, size] = zero
    north_of[1, :] = zero
    south_of[y1 - y0, :] = zero
    return largest > 0


@numba.njit(nogil=True, cache=True)
def _first_step(j0, j1, i0, i1, now, weights, share, after, total):
    """T(1) = X T(0)."""
    half = weights.dtype.type(0.5)
    size = i1 - i0
    for j in range(j0, j1):
        # Views from 0 on: an index that cannot be negative lets the compiler work on many cells at once.
        west_of, east_of = weights[0, j, i0:i1], weights[1, j, i0:i1]
        north_of, south_of = weights[2, j, i0:i1], weights[3, j, i0:i1]
        for k in range(now.shape[1]):
            here, west, east = now[j, k, i0:i1], now[j, k, i0 - 1 :], now[j, k, i0 + 1 :]
            north, south = now[j - 1, k, i0:i1], now[j + 1, k, i0:i1]
            later, sums = after[j, k, i0:i1], total[j, k, i0:i1]
            for i in range(size):
                value = here[i]
                later[i] = value + half * (
                    west_of[i] * (west[i] - value)
                    + east_of[i] * (east[i] - value)
                    + north_of[i] * (north[i] - value)
                    + south_of[i] * (south[i] - value)
                )
                sums[i] += share * later[i]


@numba.njit(nogil=True, cache=True)
def _step(j0, j1, i0, i1, now, weights, share, other, total):
    """The recurrence T(k+1) = 2 X T(k) − T(k−1) with X = 1 − 2A/λ; ``other`` holds T(k−1), then T(k+1)."""
    size = i1 - i0
    for j in range(j0, j1):
        west_of, east_of = weights[0, j, i0:i1], weights[1, j, i0:i1]
        north_of, south_of = weights[2, j, i0:i1], weights[3, j, i0:i1]
        for k in range(now.shape[1]):
            here, west, east = now[j, k, i0:i1], now[j, k, i0 - 1 :], now[j, k, i0 + 1 :]
            north, south = now[j - 1, k, i0:i1], now[j + 1, k, i0:i1]
            older, sums = other[j, k, i0:i1], total[j, k, i0:i1]
            for i in range(size):
                value = here[i]
                after = (
                    (value - older[i])
                    + value
                    + west_of[i] * (west[i] - value)
                    + east_of[i] * (east[i] - value)
                    + north_of[i] * (north[i] - value)
                    + south_of[i] * (south[i] - value)
                )
                older[i] = after
                sums[i] += share * after


@numba.njit(nogil=True, cache=True)
def _upsample(coarse, y, k, first, last, coarse_line, line):
    """Linear interpolation between the centres of coarse cells, for part of a row; constant beyond the last centre."""
    near, far = coarse.dtype.type(0.75), coarse.dtype.type(0.25)
    rows, _, columns = coarse.shape
    other = y // 2 + 1 if y % 2 else y // 2 - 1
    here, there = coarse[y // 2, k], coarse[min(max(other, 0), rows - 1), k]
    start = first // 2 - 1
    size = (last - 1) // 2 + 2 - start
    for i in range(size):
        x = min(max(start + i, 0), columns - 1)
        coarse_line[i] = near * here[x] + far * there[x]
    odd = first % 2
    for i in range(odd, last - first, 2):
        x = (i + odd) // 2 + 1
        line[i] = near * coarse_line[x] + far * coarse_line[x - 1]
    for i in range(1 - odd, last - first, 2):
        x = (i + odd) // 2 + 1
        line[i] = near * coarse_line[x] + far * coarse_line[x + 1]
