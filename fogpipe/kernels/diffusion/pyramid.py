"""Diffusion on a pyramid of grids, each level of which needs only a few steps.

The equation is linear, so a layer may be taken apart: what a coarse grid can hold is diffused there, at a quarter of
the cost, and only the rest, which is fine detail, is diffused on the fine grid. Fine detail is gone
after a blur of a few pixels, so its rate may be clipped there, and a few steps do.
"""

from __future__ import annotations

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.diffusion.grid import Grid, coarser, fine_grid, project, transfer
from fogpipe.kernels.diffusion.polynomial import diffused


def pyramid(layer: FloatArray, scale: FloatArray, finest: float, levels: int, clip: float, share: float) -> FloatArray:
    """Diffuse a layer (H, W, 4) with ``levels`` coarser grids; none is the plain polynomial.

    Cost: about 4/3 of the steps of the finest grid. Memory: the new layer and 1.6 more; without
    coarser grids 5.3.
    """
    after = _level(layer.transpose(0, 2, 1), fine_grid(scale, finest), levels, clip, share)
    return np.ascontiguousarray(after.transpose(0, 2, 1))


def _level(layer: FloatArray, grid: Grid, levels: int, clip: float, share: float) -> FloatArray:
    across, along = transfer(grid.widths), transfer(grid.heights)
    if levels == 0 or max(layer.shape[0], layer.shape[2]) < 4:
        nothing = np.zeros((len(along.widths), layer.shape[1], len(across.widths)), layer.dtype)
        return diffused(layer, grid, np.inf, share, (nothing, nothing))
    coarse = project(layer, across, along)
    # The last grid holds what varies slowly, which is most of a picture, and its steps cost next to nothing.
    added = _level(coarse, coarser(grid, across, along), levels - 1, clip, share / 10 if levels == 1 else share)
    added -= coarse
    return diffused(layer, grid, clip, share, (coarse, added))
