r"""Density of a medium whose noise is fixed in space, averaged along the ray of each pixel.

The noise is that of :mod:`fogpipe.kernels.perlin` in three dimensions, at points of the world. A ray is cut into steps
at the same distances for all pixels. They grow in proportion to the distance, and an octave fades out between
steps of half its period and steps of its period. What is left out of the noise keeps its share of the mean: with
the resolved part :math:`n_r` and the variance :math:`v` that it keeps,

.. math:: \rho = \frac{E (1 + a n)^2}{1 + a^2} = \frac{(1 + a n_r)^2 + a^2 (1 - v)}{1 + a^2},

so that nothing aliases, and the density leads over into its mean where even the first octave is unresolved. Along a
row, noise is computed at a number of nodes per cell, and is linear in between.
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

_NODES_PER_CELL = 1.6
"""Over the growth of a step. The error of the interpolation then falls with that of the steps, and stays below it."""
_WIDEST = 64
"""Columns between two nodes, at most."""


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
    rays : (3, 3), the matrix that takes (column, row, 1) to a direction in the frame of the noise, of length 1 or more.
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
    octave_terms = 1 / periods, shifts, keys, resolved / math.sqrt(cell_variance(3))
    density_terms = amplitude(contrast), 1 - np.sum(resolved**2, axis=1)
    nodes = _NODES_PER_CELL / growth
    in_bands(_average, rows, columns, range_map, rays, origin, edges, octave_terms, density_terms, nodes, result)
    return result


def step_edges(longest: float, shortest: float, growth: float) -> FloatArray:
    """Distances at which steps begin and end, from 0 to where a step is as long as the longest period."""
    edges, step = [0.0], shortest / 2
    while step < longest:
        edges.append(edges[-1] + step)
        step = max(shortest / 2, growth * edges[-1])
    return np.array(edges)


@njit(nogil=True, cache=True, error_model="numpy")
def _average(first, last, range_map, rays, origin, edges, octave_terms, density_terms, nodes, result):
    """All columns take a step before the next one, because neighbours lie in the same cell more often than not."""
    frequencies, shifts, keys, weights = octave_terms
    a, unresolved = density_terms
    columns = range_map.shape[1]
    mean_square = 1 + a * a
    angle = math.sqrt(rays[0, 0] ** 2 + rays[1, 0] ** 2 + rays[2, 0] ** 2)  # between two columns, at most
    direction = np.empty((columns + _WIDEST, 3))
    at_nodes = np.zeros(columns + 1)
    noise = np.empty(columns)
    excess = np.empty(columns)  # ∫ (ρ − 1) ds
    for row in range(first, last):
        for column in range(columns + _WIDEST):
            for axis in range(3):
                direction[column, axis] = rays[axis, 0] * column + rays[axis, 1] * row + rays[axis, 2]
            x, y, z = direction[column]
            direction[column] /= math.sqrt(x * x + y * y + z * z)
        reach = range_map[row]
        farthest = 0.0
        for column in range(columns):
            if reach[column] > farthest:
                farthest = reach[column]
        excess[:] = 0
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
                stride = min(max(1, int(1 / (distance * angle * nodes))), _WIDEST)
                _sample(reach, near, start, distance, direction, stride, keys[octave], at_nodes)
                _add_between(at_nodes, stride, weights[step, octave], noise)
            for column in range(columns):
                if reach[column] > near:
                    root = 1 + a * noise[column]
                    density = (root * root + a * a * unresolved[step]) / mean_square
                    excess[column] += (density - 1) * (min(far, reach[column]) - near)
        for column in range(columns):
            if reach[column] > 0:
                result[row, column] = 1 + excess[column] / reach[column]


@njit(nogil=True, cache=True)
def _sample(reach, near, start, distance, direction, stride, key, at_nodes):
    """Gradient noise at one distance, in cells, at the nodes."""
    gradients = np.empty((2, 2, 2, 3))
    cell_x, cell_y, cell_z = np.int64(0), np.int64(0), np.int64(0)
    known = False
    for node in range((reach.size - 1) // stride + 2):
        column = node * stride
        if stride == 1 and not (reach[max(node - 1, 0)] > near or reach[min(node, reach.size - 1)] > near):
            continue  # far away, where every column is a node, many columns end before
        x = start[0] + distance * direction[column, 0]
        y = start[1] + distance * direction[column, 1]
        z = start[2] + distance * direction[column, 2]
        floor_x, floor_y, floor_z = math.floor(x), math.floor(y), math.floor(z)
        i, j, k = np.int64(floor_x), np.int64(floor_y), np.int64(floor_z)
        if not (known and i == cell_x and j == cell_y and k == cell_z):
            _draw_gradients(key, i, j, k, gradients)
            cell_x, cell_y, cell_z, known = i, j, k, True
        at_nodes[node] = _blend(gradients, x - floor_x, y - floor_y, z - floor_z)


@njit(nogil=True, cache=True, error_model="numpy")
def _add_between(at_nodes, stride, weight, noise):
    """Add what is linear between the nodes."""
    for node in range((noise.size - 1) // stride + 1):
        value = weight * at_nodes[node]
        slope = (weight * at_nodes[node + 1] - value) / stride
        first = node * stride
        for column in range(first, min(first + stride, noise.size)):
            noise[column] += value + slope * (column - first)


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
    total = 0.0
    for c in range(2):
        for b in range(2):
            rest = gradients[c, b, 0, 1] * (v - b) + gradients[c, b, 0, 2] * (w - c)
            left = gradients[c, b, 0, 0] * u + rest
            rest = gradients[c, b, 1, 1] * (v - b) + gradients[c, b, 1, 2] * (w - c)
            right = gradients[c, b, 1, 0] * (u - 1) + rest
            share = (fade_v if b else 1 - fade_v) * (fade_w if c else 1 - fade_w)
            total += share * (left + fade_u * (right - left))
    return total


@njit(nogil=True, cache=True)
def _fade(u):
    return u * u * u * (u * (6 * u - 15) + 10)
