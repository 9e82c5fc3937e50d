"""Smoothing with a weight on each edge between pixels: (1 + A) u = f, by conjugate gradients and multigrid.

.. math:: \\min_u \\sum_x (u - f)^2 + \\sum_{x \\sim y} w_{xy} (u(x) - u(y))^2

One cycle of multigrid preconditions the conjugate gradients. A cell of the next grid is 2 × 2 cells of this one; the
weights between cells add like conductances, in series along the way between two centres and side by side across it.

Every array inside has a ring of one cell around it, to which no edge leads, so that no loop asks where the border is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands

DAMPINGS = (0.56, 1.39)
"""Of the two Jacobi sweeps before the coarser grid, and in reverse after it: the inverse roots of the Chebyshev
polynomial over [1/2, 2], where the errors lie that a coarser grid does not see."""
SWEEPS_ON_THE_COARSEST = 4
"""How often both dampings take turns there."""
COARSEST = 8
"""Cells along the shorter side below which a grid is not halved again."""


class Grid(NamedTuple):
    """The operator on one grid, and room for a cycle to work in.

    Attributes
    ----------
    area, east, south : (H + 2, W + 2) area of the cells, weights to the next column and row (0 at the last).
    inverse : (H + 2, W + 2) inverse of the diagonal.
    right : (C, H + 2, W + 2) right side of the system that a cycle solves.
    u, other : (C, H + 2, W + 2) its solution, and what a sweep writes to.
    """

    area: FloatArray
    east: FloatArray
    south: FloatArray
    inverse: FloatArray
    right: FloatArray
    u: FloatArray
    other: FloatArray

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns without the ring."""
        return self.area.shape[0] - 2, self.area.shape[1] - 2


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
    grids = _grids(_ringed(east), _ringed(south), _ringed(planes))
    grid, (height, width) = grids[0], grids[0].size
    operator, residual = grid[:3], grid.right
    u, image, sums = _ringed(start), np.zeros_like(residual), np.zeros((len(planes), height))
    in_bands(_apply, height, width, *operator, u, image, sums)
    residual -= image
    squares = np.einsum("chw,chw->c", residual, residual)
    direction, old = np.zeros_like(u), np.zeros(len(u))
    for _ in range(most):
        if squares.max() <= tolerance**2 * height * width:
            break
        preconditioned = _cycle(grids)
        in_bands(_product, height, width, residual, preconditioned, sums)
        new = sums.sum(axis=1)
        in_bands(_turn, height, width, _ratio(new, old, u.dtype), preconditioned, direction)
        in_bands(_apply, height, width, *operator, direction, image, sums)
        step = _ratio(new, sums.sum(axis=1), u.dtype)
        in_bands(_step, height, width, step, direction, image, u, residual, sums)
        squares, old = sums.sum(axis=1), new
    return np.ascontiguousarray(u[:, 1:-1, 1:-1])


def _ringed(array: FloatArray) -> FloatArray:
    """With a ring of zeros around the last two axes."""
    ringed = np.zeros((*array.shape[:-2], array.shape[-2] + 2, array.shape[-1] + 2), array.dtype)
    ringed[..., 1:-1, 1:-1] = array
    return ringed


def _ratio(numerator: np.ndarray, denominator: np.ndarray, dtype: np.dtype) -> FloatArray:
    """A factor for each plane; 0 for a plane that is solved already."""
    return np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 0).astype(dtype)


def _grids(east: FloatArray, south: FloatArray, right: FloatArray) -> list[Grid]:
    area = np.zeros_like(east)
    area[1:-1, 1:-1] = 1
    grids = []
    while True:
        grid = Grid(area, east, south, np.zeros_like(east), right, np.zeros_like(right), np.zeros_like(right))
        height, width = grid.size
        in_bands(_diagonal, height, width, *grid[:4])
        grids.append(grid)
        if min(height, width) < COARSEST:
            return grids
        height, width = -(-height // 2), -(-width // 2)
        coarse = [np.zeros((height + 2, width + 2), east.dtype) for _ in range(3)]
        in_bands(_coarsen, height, width, area, east, south, *coarse)
        (area, east, south), right = coarse, np.zeros((len(right), height + 2, width + 2), right.dtype)


def _cycle(grids: list[Grid]) -> FloatArray:
    """An approximate solution by one V-cycle; linear in the right side, symmetric and positive."""
    grid, *coarser = grids
    real = grid.u.dtype.type
    if not coarser:
        first, *others = DAMPINGS * SWEEPS_ON_THE_COARSEST + DAMPINGS[::-1] * SWEEPS_ON_THE_COARSEST
        in_bands(_sweep_from_zero, *grid.size, grid.inverse, grid.right, real(first), grid.u)
        return _swept(grid, grid.u, grid.other, others)
    first, *others = DAMPINGS
    in_bands(_sweep_from_zero, *grid.size, grid.inverse, grid.right, real(first), grid.u)
    u = _swept(grid, grid.u, grid.other, others)
    in_bands(_restrict, *coarser[0].size, *grid[:3], grid.right, u, coarser[0].right)
    in_bands(_correct, *grid.size, _cycle(coarser), u)
    return _swept(grid, u, grid.u if u is grid.other else grid.other, DAMPINGS[::-1])


def _swept(grid: Grid, u: FloatArray, other: FloatArray, dampings: Sequence[float]) -> FloatArray:
    """After Jacobi sweeps, which write to ``other`` and ``u`` in turn."""
    for damping in dampings:
        in_bands(_sweep, *grid.size, *grid[:5], u, u.dtype.type(damping), other)
        u, other = other, u
    return u


@njit(nogil=True, cache=True, error_model="numpy", inline="always")
def _row(area, east, south, u, y, image):
    """The operator on row y: area·u plus the flow out over four edges. Loops of few arrays are vectorised."""
    for x in range(1, image.size - 1):
        image[x] = (
            area[y, x] * u[y, x] + south[y, x] * (u[y, x] - u[y + 1, x]) + south[y - 1, x] * (u[y, x] - u[y - 1, x])
        )
    for x in range(1, image.size - 1):
        image[x] += east[y, x] * (u[y, x] - u[y, x + 1]) + east[y, x - 1] * (u[y, x] - u[y, x - 1])


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _apply(first, last, area, east, south, u, image, sums):
    """The operator on u, and u times that in each row."""
    for y in range(first + 1, last + 1):
        for c in range(u.shape[0]):
            _row(area, east, south, u[c], y, image[c, y])
            total = u.dtype.type(0)
            for x in range(1, u.shape[2] - 1):
                total += u[c, y, x] * image[c, y, x]
            sums[c, y - 1] = total


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
def _sweep(first, last, area, east, south, inverse, residual, u, damping, swept):
    image = np.empty(area.shape[1], u.dtype)
    for y in range(first + 1, last + 1):
        for c in range(u.shape[0]):
            _row(area, east, south, u[c], y, image)
            for x in range(1, image.size - 1):
                swept[c, y, x] = u[c, y, x] + damping * inverse[y, x] * (residual[c, y, x] - image[x])


@njit(nogil=True, cache=True, error_model="numpy")
def _sweep_from_zero(first, last, inverse, residual, damping, swept):
    for y in range(first + 1, last + 1):
        for c in range(swept.shape[0]):
            for x in range(1, swept.shape[2] - 1):
                swept[c, y, x] = damping * inverse[y, x] * residual[c, y, x]


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _product(first, last, one, other, sums):
    """Scalar product of each row."""
    for y in range(first + 1, last + 1):
        for c in range(one.shape[0]):
            total = one.dtype.type(0)
            for x in range(1, one.shape[2] - 1):
                total += one[c, y, x] * other[c, y, x]
            sums[c, y - 1] = total


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
def _turn(first, last, ratio, preconditioned, direction):
    for y in range(first + 1, last + 1):
        for c in range(direction.shape[0]):
            for x in range(1, direction.shape[2] - 1):
                direction[c, y, x] = preconditioned[c, y, x] + ratio[c] * direction[c, y, x]


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _step(first, last, step, direction, image, u, residual, sums):
    """Along the direction; and the squares of what is left, in each row."""
    for y in range(first + 1, last + 1):
        for c in range(u.shape[0]):
            total = u.dtype.type(0)
            for x in range(1, u.shape[2] - 1):
                u[c, y, x] += step[c] * direction[c, y, x]
                left = residual[c, y, x] - step[c] * image[c, y, x]
                residual[c, y, x] = left
                total += left * left
            sums[c, y - 1] = total


@njit(nogil=True, cache=True, error_model="numpy")
def _diagonal(first, last, area, east, south, inverse):
    for y in range(first + 1, last + 1):
        for x in range(1, area.shape[1] - 1):
            inverse[y, x] = 1 / (area[y, x] + east[y, x] + east[y, x - 1] + south[y, x] + south[y - 1, x])


@njit(nogil=True, cache=True, error_model="numpy")
def _coarsen(first, last, area, east, south, coarse_area, coarse_east, coarse_south):
    """Cells j and j + 1, i and i + 1 of this grid are cell (y, x) of the next; the ring stands in for a missing one."""
    bottom, right = area.shape[0] - 1, area.shape[1] - 1
    for y in range(first + 1, last + 1):
        for x in range(1, coarse_area.shape[1] - 1):
            j, i = 2 * y - 1, 2 * x - 1
            under, after = min(j + 2, bottom), min(i + 2, right)
            for k in range(2):
                coarse_east[y, x] += _in_series(east[j + k, i], east[j + k, i + 1], east[j + k, after])
                coarse_south[y, x] += _in_series(south[j, i + k], south[j + 1, i + k], south[under, i + k])
                coarse_area[y, x] += area[j + k, i] + area[j + k, i + 1]


@njit(nogil=True, cache=True, inline="always")
def _in_series(before, across, after):
    """Conductance of half an edge, an edge and half an edge; one that is not there has no resistance."""
    if across <= 0:
        return across
    resistance = 1 / across
    if before > 0:
        resistance += 0.5 / before
    if after > 0:
        resistance += 0.5 / after
    return 1 / resistance


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
def _restrict(first, last, area, east, south, residual, u, coarse):
    """What is left of the residual, added up over the cells of the next grid."""
    image, left = np.empty(area.shape[1], u.dtype), np.zeros(2 * coarse.shape[2], u.dtype)
    for y in range(first + 1, last + 1):
        for c in range(u.shape[0]):
            left[:] = 0
            for j in range(2 * y - 1, min(2 * y + 1, area.shape[0] - 1)):
                _row(area, east, south, u[c], j, image)
                for x in range(1, image.size - 1):
                    left[x] += residual[c, j, x] - image[x]
            for x in range(1, coarse.shape[2] - 1):
                coarse[c, y, x] = left[2 * x - 1] + left[2 * x]


@njit(nogil=True, cache=True, error_model="numpy")
def _correct(first, last, coarse, u):
    for y in range(first + 1, last + 1):
        for c in range(u.shape[0]):
            for x in range(1, u.shape[2] - 1):
                u[c, y, x] += coarse[c, (y + 1) // 2, (x + 1) // 2]
