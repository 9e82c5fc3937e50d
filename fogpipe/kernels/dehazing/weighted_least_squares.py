"""Smoothing with a weight on each edge between pixels: (1 + A) u = f, by conjugate gradients and multigrid.

.. math:: \\min_u \\sum_x (u - f)^2 + \\sum_{x \\sim y} w_{xy} (u(x) - u(y))^2

One cycle of multigrid preconditions the conjugate gradients. A cell of the next grid is 2 × 2 cells of this one; the
weights between cells add like conductances, in series along the way between two centres and side by side across it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

SWEEPS = 2
"""Damped Jacobi sweeps before and after the coarser grid."""
COARSEST = 8
"""Cells along the shorter side below which a grid is not halved again."""


class Grid(NamedTuple):
    """Area of the cells, weights to the next column and row (0 at the last), inverse of the diagonal; all (H, W)."""

    area: FloatArray
    east: FloatArray
    south: FloatArray
    inverse: FloatArray


def smooth(
    planes: FloatArray, start: FloatArray, east: FloatArray, south: FloatArray, tolerance: float, most: int = 50
) -> FloatArray:
    """Solve for each plane.

    Parameters
    ----------
    planes : (C, H, W) float, f.
    start : (C, H, W) float, a first guess.
    east, south : (H, W) float, weights of the edges to the next column and row; 0 where there is none.
    tolerance : root-mean-square residual at which to stop, in the unit of f.
    most : conjugate gradient steps at most.

    Returns
    -------
    (C, H, W) float, u.
    """
    grids = _grids(east, south)
    u = start.copy()
    residual = planes - _applied(grids[0], u)
    direction = preconditioned = _cycle(grids, residual)
    old = _dots(residual, preconditioned)
    for _ in range(most):
        if _dots(residual, residual).max() <= tolerance**2 * residual[0].size:
            break
        image = _applied(grids[0], direction)
        step = _ratio(old, _dots(direction, image))
        u += step * direction
        residual -= step * image
        preconditioned = _cycle(grids, residual)
        new = _dots(residual, preconditioned)
        direction = preconditioned + _ratio(new, old) * direction
        old = new
    return u


def _dots(first: FloatArray, other: FloatArray) -> np.ndarray:
    """Scalar product of each plane, summed in one order whatever the number of threads."""
    return np.einsum("chw,chw->ch", first, other).sum(axis=1, dtype=np.float64)


def _ratio(numerator: np.ndarray, denominator: np.ndarray) -> FloatArray:
    """A factor for each plane; 0 for a plane that is solved already."""
    quotient = np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 0)
    return quotient[:, None, None].astype(np.float32)


def _grids(east: FloatArray, south: FloatArray) -> list[Grid]:
    area = np.ones_like(east)
    grids = []
    while True:
        inverse = np.empty_like(east)
        in_bands(_diagonal, *east.shape, area, east, south, inverse)
        grids.append(Grid(area, east, south, inverse))
        if min(east.shape) < COARSEST:
            return grids
        height, width = (-(-size // 2) for size in east.shape)
        coarse = [np.zeros((height, width), east.dtype) for _ in range(3)]
        in_bands(_coarsen, height, width, area, east, south, *coarse)
        area, east, south = coarse


def _cycle(grids: list[Grid], residual: FloatArray) -> FloatArray:
    """An approximate solution by one V-cycle; linear in the residual, symmetric and positive."""
    grid, *coarser = grids
    u = np.float32(DAMPING) * grid.inverse * residual
    u = _swept(grid, residual, u, SWEEPS - 1 if coarser else 4 * SWEEPS - 1)
    if not coarser:
        return u
    height, width = coarser[0].area.shape
    left = np.zeros((residual.shape[0], height, width), residual.dtype)
    in_bands(_restrict, height, width, u, residual, grid.area, grid.east, grid.south, left)
    correction = _cycle(coarser, left)
    in_bands(_correct, grid.area.shape[0], grid.area.shape[1], correction, u)
    return _swept(grid, residual, u, SWEEPS)


DAMPING = 0.8


def _swept(grid: Grid, residual: FloatArray, u: FloatArray, sweeps: int) -> FloatArray:
    other = np.empty_like(u)
    for _ in range(sweeps):
        in_bands(_sweep, *u.shape[1:], *grid, residual, u, np.float32(DAMPING), other)
        u, other = other, u
    return u


def _applied(grid: Grid, u: FloatArray) -> FloatArray:
    image = np.empty_like(u)
    in_bands(_apply, *u.shape[1:], *grid[:3], u, image)
    return image


@njit(nogil=True, cache=True, inline="always")
def _image(area, east, south, plane, y, x):
    """The operator at one cell: area·u plus the flow out over its four edges."""
    height, width = area.shape
    u = plane[y, x]
    value = area[y, x] * u
    if x + 1 < width:
        value += east[y, x] * (u - plane[y, x + 1])
    if x > 0:
        value += east[y, x - 1] * (u - plane[y, x - 1])
    if y + 1 < height:
        value += south[y, x] * (u - plane[y + 1, x])
    if y > 0:
        value += south[y - 1, x] * (u - plane[y - 1, x])
    return value


@njit(nogil=True, cache=True)
def _apply(first, last, area, east, south, u, image):
    for c in range(u.shape[0]):
        for y in range(first, last):
            for x in range(u.shape[2]):
                image[c, y, x] = _image(area, east, south, u[c], y, x)


@njit(nogil=True, cache=True)
def _sweep(first, last, area, east, south, inverse, residual, u, damping, swept):
    for c in range(u.shape[0]):
        for y in range(first, last):
            for x in range(u.shape[2]):
                left = residual[c, y, x] - _image(area, east, south, u[c], y, x)
                swept[c, y, x] = u[c, y, x] + damping * inverse[y, x] * left


@njit(nogil=True, cache=True)
def _diagonal(first, last, area, east, south, inverse):
    for y in range(first, last):
        for x in range(area.shape[1]):
            value = area[y, x] + east[y, x] + south[y, x]
            if x > 0:
                value += east[y, x - 1]
            if y > 0:
                value += south[y - 1, x]
            inverse[y, x] = 1 / value


@njit(nogil=True, cache=True)
def _coarsen(first, last, area, east, south, coarse_area, coarse_east, coarse_south):
    height, width = area.shape
    for y in range(first, last):
        for x in range(coarse_area.shape[1]):
            for j in range(2 * y, min(2 * y + 2, height)):
                for i in range(2 * x, min(2 * x + 2, width)):
                    coarse_area[y, x] += area[j, i]
                i = 2 * x + 1
                if i + 1 < width and east[j, i] > 0:
                    coarse_east[y, x] += _in_series(east[j, i - 1], east[j, i], east[j, i + 1])
            for i in range(2 * x, min(2 * x + 2, width)):
                j = 2 * y + 1
                if j + 1 < height and south[j, i] > 0:
                    coarse_south[y, x] += _in_series(south[j - 1, i], south[j, i], south[j + 1, i])


@njit(nogil=True, cache=True, inline="always")
def _in_series(before, across, after):
    """Conductance of half an edge, an edge and half an edge; one that is not there has no resistance."""
    resistance = 1 / across
    if before > 0:
        resistance += 0.5 / before
    if after > 0:
        resistance += 0.5 / after
    return 1 / resistance


@njit(nogil=True, cache=True)
def _restrict(first, last, u, residual, area, east, south, coarse):
    height, width = area.shape
    for c in range(u.shape[0]):
        for y in range(first, last):
            for x in range(coarse.shape[2]):
                for j in range(2 * y, min(2 * y + 2, height)):
                    for i in range(2 * x, min(2 * x + 2, width)):
                        coarse[c, y, x] += residual[c, j, i] - _image(area, east, south, u[c], j, i)


@njit(nogil=True, cache=True)
def _correct(first, last, coarse, u):
    for c in range(u.shape[0]):
        for y in range(first, last):
            for x in range(u.shape[2]):
                u[c, y, x] += coarse[c, y // 2, x // 2]
