"""Grids of a pyramid: cells, the rates between them, and the way up and down.

A level of the pyramid holds a layer as (H, 4, W), each channel of a row together, and the rates ϱ across the faces
between cells. A coarse cell joins two by two cells. Where a side is odd the last cell joins fewer, and is narrower;
``widths`` and ``heights`` say so. Going up is linear interpolation P between centres, going down its transpose,
weighted by the size of the cells, so the mean is the same on every level.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from scipy import sparse

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands


class Grid(NamedTuple):
    """Rates across the faces to the next column (``east``) and row (``south``), in px² of this grid per unit of time.

    The last column of ``east`` and the last row of ``south`` are 0: no light crosses the border.
    """

    east: FloatArray
    south: FloatArray
    widths: FloatArray
    heights: FloatArray


def fine_grid(scale: FloatArray, finest: float) -> Grid:
    """The pixels themselves: ϱ = (σ² − σ0²)/2 at the centres, and its mean of both sides at a face."""
    rows, columns = scale.shape
    east, south = np.empty_like(scale), np.empty_like(scale)
    in_bands(_faces, rows, columns, scale, scale.dtype.type(finest), east, south)
    return Grid(east, south, np.ones(columns, scale.dtype), np.ones(rows, scale.dtype))


class Transfer(NamedTuple):
    """Between two levels, along one axis of n fine and N coarse cells.

    Coarse cell X takes ``taps[X]`` of the fine cells 2X − 1 … 2X + 2. ``gram`` holds the diagonals
    of the matrix of both, one after the other (below, on and above the diagonal).
    """

    taps: FloatArray
    gram: FloatArray
    widths: FloatArray


def transfer(widths: FloatArray) -> Transfer:
    """How an axis of cells of these widths is halved."""
    n = len(widths)
    size = (n + 1) // 2
    x = np.arange(n)
    other = np.clip(x // 2 + np.where(x % 2, 1, -1), 0, size - 1)
    near = np.where(other == x // 2, 1.0, 0.75)
    up = sparse.csr_array(
        (np.r_[near, 1 - near], (np.r_[x, x], np.r_[x // 2, other])),
        shape=(n, size),
    )
    volume = up.T @ widths.astype(np.float64)
    down = (sparse.diags_array(1 / volume) @ up.T @ sparse.diags_array(widths.astype(np.float64))).tocsr()
    gram = down @ up
    bands = np.zeros((3, size))
    bands[0, 1:], bands[1], bands[2, :-1] = gram.diagonal(-1), gram.diagonal(), gram.diagonal(1)
    coarse = np.repeat(np.arange(size), 4)
    fine = 2 * coarse + np.tile([-1, 0, 1, 2], size)
    inside = (fine >= 0) & (fine < n)
    taps = np.zeros(4 * size)
    taps[inside] = np.asarray(down.todense())[coarse[inside], fine[inside]]
    dtype = widths.dtype
    return Transfer(
        taps.reshape(size, 4).astype(dtype),
        bands.astype(dtype),
        (volume / 2).astype(dtype),
    )


def coarser(grid: Grid, across: Transfer, along: Transfer) -> Grid:
    """The grid of half the size: resistances 1/ϱ add along the way between two centres, rates add side by side."""
    rows, columns = len(along.widths), len(across.widths)
    east = np.empty((rows, columns), grid.east.dtype)
    south = np.empty((columns, rows), grid.east.dtype)
    in_bands(_coarse_east, rows, columns, grid.east, east)
    in_bands(_coarse_east, columns, rows, grid.south.T, south)
    return Grid(east, np.ascontiguousarray(south.T), across.widths, along.widths)


def project(layer: FloatArray, across: Transfer, along: Transfer) -> FloatArray:
    """The coarse layer whose interpolation is nearest to the layer in the sense of least squares."""
    rows, columns = len(along.widths), len(across.widths)
    coarse = np.empty((rows, layer.shape[1], columns), layer.dtype)
    in_bands(_restrict, rows, 4 * columns, layer, across.taps, along.taps, coarse)
    in_bands(_solve_rows, rows, columns, coarse, across.gram)
    _solve_columns(coarse.reshape(rows, -1), along.gram)
    return coarse


@numba.njit(nogil=True, cache=True)
def _faces(first, last, scale, finest, east, south):
    rows, columns = scale.shape
    quarter = scale.dtype.type(0.25)
    twice = finest * finest + finest * finest
    for y in range(first, last):
        below = min(y + 1, rows - 1)
        for x in range(columns - 1):
            east[y, x] = quarter * (scale[y, x] * scale[y, x] + scale[y, x + 1] * scale[y, x + 1] - twice)
        east[y, columns - 1] = 0
        for x in range(columns):
            south[y, x] = quarter * (scale[y, x] * scale[y, x] + scale[below, x] * scale[below, x] - twice)
        if y == rows - 1:
            south[y, :] = 0


@numba.njit(nogil=True, cache=True)
def _coarse_east(first, last, fine, coarse):
    rows, columns = fine.shape
    size = coarse.shape[1]
    eighth, half = fine.dtype.type(0.125), fine.dtype.type(0.5)
    for y in range(first, last):
        for x in range(size - 1):
            rate = fine.dtype.type(0)
            for j in (2 * y, min(2 * y + 1, rows - 1)):
                middle = fine[j, 2 * x + 1]
                before = fine[j, 2 * x]
                after = fine[j, 2 * x + 2] if 2 * x + 3 < columns else middle
                product = before * middle * after
                if product > 0:
                    rate += product / (half * (half * middle * (before + after) + before * after))
            coarse[y, x] = eighth * rate
        coarse[y, size - 1] = 0


@numba.njit(nogil=True, cache=True)
def _restrict(first, last, fine, across, along, coarse):
    rows, channels, columns = fine.shape
    line = np.empty((channels, columns), fine.dtype)
    size = coarse.shape[2]
    for y in range(first, last):
        a, b, c, d = max(2 * y - 1, 0), 2 * y, min(2 * y + 1, rows - 1), min(2 * y + 2, rows - 1)
        for x in range(columns):
            for k in range(channels):
                line[k, x] = (
                    along[y, 0] * fine[a, k, x]
                    + along[y, 1] * fine[b, k, x]
                    + along[y, 2] * fine[c, k, x]
                    + along[y, 3] * fine[d, k, x]
                )
        for k in range(channels):
            for x in range(size):
                coarse[y, k, x] = (
                    across[x, 0] * line[k, max(2 * x - 1, 0)]
                    + across[x, 1] * line[k, 2 * x]
                    + across[x, 2] * line[k, min(2 * x + 1, columns - 1)]
                    + across[x, 3] * line[k, min(2 * x + 2, columns - 1)]
                )


@numba.njit(nogil=True, cache=True)
def _solve_rows(first, last, values, gram):
    size = values.shape[2]
    above = np.empty(size, values.dtype)
    inverse = np.empty(size, values.dtype)
    for x in range(size):
        inverse[x] = 1 / (gram[1, x] - (gram[0, x] * above[x - 1] if x else 0))
        above[x] = gram[2, x] * inverse[x]
    for y in range(first, last):
        for k in range(values.shape[1]):
            line = values[y, k]
            line[0] *= inverse[0]
            for x in range(1, size):
                line[x] = (line[x] - gram[0, x] * line[x - 1]) * inverse[x]
            for x in range(size - 2, -1, -1):
                line[x] -= above[x] * line[x + 1]


@numba.njit(nogil=True, cache=True)
def _solve_columns(values, gram):
    rows, columns = values.shape
    above = np.empty(rows, values.dtype)
    before = values.dtype.type(0)
    for y in range(rows):
        inverse = 1 / (gram[1, y] - gram[0, y] * before)
        below = gram[0, y]
        if y:
            for x in range(columns):
                values[y, x] = (values[y, x] - below * values[y - 1, x]) * inverse
        else:
            for x in range(columns):
                values[y, x] *= inverse
        before = above[y] = gram[2, y] * inverse
    for y in range(rows - 2, -1, -1):
        for x in range(columns):
            values[y, x] -= above[y] * values[y + 1, x]
