r"""Density of a medium whose noise is fixed in space, averaged along the ray of each pixel.

The noise is that of :mod:`fogpipe.kernels.perlin` in three dimensions, at points of the world. A ray is cut into steps
at the same distances for all pixels. They grow in proportion to the distance, and an octave fades out between
steps of half its period and steps of its period. What is left out of the noise keeps its share of the mean: with
the resolved part :math:`n_r` and the variance :math:`v` that it keeps,

.. math:: \rho = \frac{E (1 + a n)^2}{1 + a^2} = \frac{(1 + a n_r)^2 + a^2 (1 - v)}{1 + a^2},

so that nothing aliases, and the density leads over into its mean where even the first octave is unresolved.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.perlin import (
    amplitude,
    cell_variance,
    hashed,
    octave_key,
    octave_shift,
    octave_weights,
    signed_share,
)


def mean_density(
    range_map: FloatArray,
    rays: FloatArray,
    origin: FloatArray,
    key: int,
    *,
    period: float,
    octaves: int,
    persistence: float,
    contrast: float,
    growth: float,
) -> FloatArray:
    """Mean density between a point and what each pixel shows.

    Parameters
    ----------
    range_map : (H, W) float, metres; NaN gives 1.
    rays : (3, 3), the matrix that takes (column, row, 1) to a direction in the frame of the noise, of any length.
    origin : (3,), where the rays begin, metres, in the frame of the noise.
    key, period, octaves, persistence : as in :func:`fogpipe.kernels.perlin.field`, the period in metres.
    contrast : standard deviation of the density.
    growth : length of a step over its distance; steps are no shorter than half the period of the last octave.

    Returns
    -------
    (H, W) float32.
    """
    result = np.ones(range_map.shape, np.float32)
    if octaves == 0 or contrast == 0:
        return result
    periods = period / 2.0 ** np.arange(octaves)
    edges = step_edges(period, float(periods[-1]), growth)
    resolved = np.clip(2 - 2 * np.diff(edges)[:, None] / periods, 0, 1)
    resolved *= resolved * (3 - 2 * resolved) * octave_weights(octaves, persistence)
    shifts = np.array([[octave_shift(key, octave, axis) for axis in range(3)] for octave in range(octaves)])
    keys = np.array([octave_key(key, octave) for octave in range(octaves)])
    rows, columns = range_map.shape
    in_bands(_average, rows, columns, range_map, rays, origin, edges, resolved / math.sqrt(cell_variance(3)),
             1 - np.sum(resolved**2, axis=1), 1 / periods, shifts, keys, amplitude(contrast), result)  # fmt: skip
    return result


def step_edges(longest: float, shortest: float, growth: float) -> FloatArray:
    """Distances at which steps begin and end, from 0 to where a step is as long as the longest period."""
    edges, step = [0.0], shortest / 2
    while step < longest:
        edges.append(edges[-1] + step)
        step = max(shortest / 2, growth * edges[-1])
    return np.array(edges)


@njit(nogil=True, cache=True, error_model="numpy")
def _average(first, last, range_map, rays, origin, edges, weights, unresolved, frequencies, shifts, keys, a, result):
    """All columns take a step before the next one, because neighbours lie in the same cell more often than not."""
    columns = range_map.shape[1]
    mean_square = 1 + a * a
    direction = np.empty((columns, 3))
    noise = np.empty(columns)
    excess = np.empty(columns)  # ∫ (ρ − 1) ds
    for row in range(first, last):
        farthest = 0.0
        for column in range(columns):
            for axis in range(3):
                direction[column, axis] = rays[axis, 0] * column + rays[axis, 1] * row + rays[axis, 2]
            x, y, z = direction[column]
            direction[column] /= math.sqrt(x * x + y * y + z * z)
            excess[column] = 0
            if range_map[row, column] > farthest:
                farthest = range_map[row, column]
        for step in range(edges.size - 1):
            near, far = edges[step], edges[step + 1]
            if near >= farthest:
                break
            noise[:] = 0
            for octave in range(keys.size):
                if weights[step, octave] == 0:
                    break  # finer ones are not resolved either
                start = origin * frequencies[octave] + shifts[octave]
                distance = 0.5 * (near + far) * frequencies[octave]
                _add_octave(
                    range_map[row], near, start, distance, direction, keys[octave], weights[step, octave], noise
                )
            for column in range(columns):
                reach = range_map[row, column]
                if reach > near:
                    root = 1 + a * noise[column]
                    density = (root * root + a * a * unresolved[step]) / mean_square
                    excess[column] += (density - 1) * (min(far, reach) - near)
        for column in range(columns):
            if range_map[row, column] > 0:
                result[row, column] = 1 + excess[column] / range_map[row, column]


@njit(nogil=True, cache=True)
def _add_octave(reach, near, start, distance, direction, key, weight, noise):
    """Add gradient noise at one distance, in cells, to the columns that reach so far."""
    gradients = np.empty((2, 2, 2, 3))
    cell_x, cell_y, cell_z = np.int64(0), np.int64(0), np.int64(0)
    known = False
    for column in range(reach.size):
        if not reach[column] > near:
            continue
        x = start[0] + distance * direction[column, 0]
        y = start[1] + distance * direction[column, 1]
        z = start[2] + distance * direction[column, 2]
        floor_x, floor_y, floor_z = math.floor(x), math.floor(y), math.floor(z)
        i, j, k = np.int64(floor_x), np.int64(floor_y), np.int64(floor_z)
        if not (known and i == cell_x and j == cell_y and k == cell_z):
            _draw_gradients(key, i, j, k, gradients)
            cell_x, cell_y, cell_z, known = i, j, k, True
        noise[column] += weight * _blend(gradients, x - floor_x, y - floor_y, z - floor_z)


@njit(nogil=True, cache=True)
def _draw_gradients(key, i, j, k, gradients):
    for c in range(2):
        for b in range(2):
            for a in range(2):
                bits = hashed(key, i + a, j + b, k + c)
                for axis in range(3):
                    gradients[c, b, a, axis] = signed_share(bits, 21 * axis)


@njit(nogil=True, cache=True)
def _blend(gradients, u, v, w):
    """Noise at a point of a cell."""
    fade_u, fade_v, fade_w = _fade(u), _fade(v), _fade(w)
    back = front = 0.0
    for b in range(2):
        share = fade_v if b else 1 - fade_v
        back += share * _line(gradients[0, b], u, v - b, w, fade_u)
        front += share * _line(gradients[1, b], u, v - b, w - 1, fade_u)
    return back + fade_w * (front - back)


@njit(nogil=True, cache=True)
def _line(gradients, u, v, w, fade):
    left = gradients[0, 0] * u + gradients[0, 1] * v + gradients[0, 2] * w
    right = gradients[1, 0] * (u - 1) + gradients[1, 1] * v + gradients[1, 2] * w
    return left + fade * (right - left)


@njit(nogil=True, cache=True)
def _fade(u):
    return u * u * u * (u * (6 * u - 15) + 10)
