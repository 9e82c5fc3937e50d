"""A hierarchy of cells that fit the scales: large where the blur is wide, never on both sides of a wall.

Light moves between neighbouring cells of mass m by conductances G across their common face, dF/dt = Σ G ΔF / m. Pixels
have the mass 1 and the conductance ϱ, the mean of both sides. Of two by two cells, those which strong faces connect are
joined to one cell of the next level. The others stay as they are, however much is blurred beside them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.coarsening import coarsen
from fogpipe.kernels.diffusion.joining import join
from fogpipe.kernels.diffusion.rows import largest_of, rate_of

LEAST_SHARE = 0.25
"""Part of its square that a cell must fill to be joined again: the tip of something else would only drag it along."""

BLUR = 0.5
"""What means over two cells and interpolation between such means blur, as ϱ, in squares of the smaller cells."""
LEAST_LEFT = 0.4
"""Of a conductance, when that is taken off it."""
FEW_CELLS = 8192
"""Of a level, which are not joined if no link between whole ones would be capped: fewer would take no less time."""


class Level(NamedTuple):
    """Cells (H, W) of 2^k pixels across.

    Attributes
    ----------
    scale, finest : σ of pixels, and σ0. A pixel has the mass 1, and the conductance to another is the mean of both
        their ϱ. Empty for larger cells.
    mass : pixels in a cell, 0 for none. Empty for pixels, as are the conductances.
    east, south : conductances to the next column and row, in px² per unit of time; 0 in the last one.
    joined : (H/2, W/2) uint8, which of two by two cells are joined to one of the next level: 1, 2, 4, 8 by rows.
    alone : the same of those that are not.
    """

    scale: FloatArray
    finest: np.floating
    mass: FloatArray
    east: FloatArray
    south: FloatArray
    joined: np.ndarray
    alone: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        rows, columns = (self.mass if self.mass.size else self.scale).shape
        return rows, columns


def rates(scale: FloatArray, finest: float) -> FloatArray:
    """ϱ = (σ² − σ0²)/2 of each pixel, in px² per unit of time; 0 where the scale is unknown or below σ0."""
    rate = np.empty_like(scale)
    in_bands(_rates, *scale.shape, scale, scale.dtype.type(finest), rate)
    return rate


def hierarchy(scale: FloatArray, finest: float, clip: float, cap: float) -> Iterator[Level]:
    """Levels of cells, beginning with the pixels, until nothing is left to join; ``cap`` as for the partition."""
    real, nothing = scale.dtype.type, np.empty((0, 0), scale.dtype)
    mass = east = south = nothing
    cells = scale, real(finest), mass, east, south
    rows, columns = scale.shape
    square = 1
    while True:
        few = rows * columns <= FEW_CELLS and square > 1 and max(east.max(), south.max()) <= cap * square
        strong = real(np.inf if few or min(rows, columns) <= 2 else clip)
        joined, alone = (np.empty(((rows + 1) // 2, (columns + 1) // 2), np.uint8) for _ in range(2))
        mass, east, south = (np.empty(joined.shape, scale.dtype) for _ in range(3))
        in_bands(join, *joined.shape, *cells, strong, real(LEAST_SHARE * square), joined, alone, mass)
        yield Level(*cells, joined, alone)
        if largest_of(joined.reshape(-1)) == 0:
            return
        full, blur, least = real(4 * square), real(BLUR * square), real(max(1 - BLUR / clip, LEAST_LEFT))
        in_bands(coarsen, *joined.shape, *cells, joined, mass, full, blur, least, east, south)
        cells = nothing, real(finest), mass, east, south
        rows, columns = joined.shape
        square *= 4


@numba.njit(nogil=True, cache=True)
def _rates(first, last, scale, finest, rate):
    for y in range(first, last):
        for x in range(np.uintp(scale.shape[1])):
            rate[y, x] = rate_of(scale[y, x], finest)
