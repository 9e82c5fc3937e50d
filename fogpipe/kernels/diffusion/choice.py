"""Picks the number of levels and of steps that meet a tolerance at the least cost.

Two errors add up in quadrature. What the polynomial leaves out is bounded by its share of the variation of the layer.
What the pyramid gets wrong sits where the rate jumps within a few cells of a coarse grid, and where the blur is not
wide against its cells; :func:`missed_by_cells` measures both on the map of scales alone.
"""

from __future__ import annotations

import math

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.diffusion.published import prepared
from fogpipe.kernels.diffusion.pyramid import pyramid

MOST_LEVELS = 4
PER_JUMP = 2.0
"""Error of the pyramid over the jump and the variation of the layer: measured 0.5 to 1.5 on two scenes."""
PER_HALF = 0.05
"""Share of the variation missed where detail of a cell half stays and half goes: measured 0.05 at most at one scale."""
OF_A_SHARE = 0.7
"""Error of a pyramid's polynomials over their share and the variation: 0.2 on photographs, up to 0.6 on a point."""
SAFEST = 1e-5
"""Least share that float32 can tell from rounding."""


def auto(layer: np.ndarray, scale: np.ndarray, finest: float, tolerance: float) -> FloatArray:
    """Diffuse so that the root-mean-square error is at most ``tolerance`` (float32: 1e-5 of the variation or more)."""
    layer, scale = prepared(layer, scale, finest)
    return pyramid(layer, scale, finest, *choose(layer, scale, finest, tolerance))


def reference(layer: np.ndarray, scale: np.ndarray, finest: float) -> FloatArray:
    """The equation itself, in float64: at most 1e-9 of any pattern is left out. About 300 steps for 25 px."""
    layer, scale = prepared(layer.astype(np.float64), scale, finest)
    return pyramid(layer, scale, finest, 0, math.inf, 1e-9)


def choose(layer: FloatArray, scale: FloatArray, finest: float, tolerance: float) -> tuple[int, float, float]:
    """Levels, largest rate of the finer ones, and share that the polynomial may leave out."""
    variation = _variation(layer)
    if variation == 0:
        return 0, math.inf, 0.5
    allowed = tolerance / variation
    possible = max(0, min(MOST_LEVELS, int(math.log2(max(1.0, float(scale.max()) / 3)))))
    for levels in range(possible, 0, -1):
        missed = missed_by_cells(scale, finest, levels)
        if missed < 0.7 * allowed:
            # Detail of the finest level is gone at a rate of 4 to within 1e-4 of it.
            return levels, 2.5 if allowed > 0.03 else 4.0, _bounded(math.sqrt(allowed**2 - missed**2) / OF_A_SHARE)
    return 0, math.inf, _bounded(allowed)


def missed_by_cells(scale: FloatArray, finest: float, levels: int) -> float:
    """Error that a pyramid is expected to make, as a share of the variation of the layer, from the scales alone.

    The mobility m = ϱ/(ϱ + 1/5), with ϱ in cells of 2^levels pixels, tells detail of a cell that stays from detail that
    goes. Cells are wrong where m jumps between neighbouring faces, for the width of a cell, and less so where it
    is neither 0 nor 1, by 4 m (1 − m) with 1/8 for 1/5. Root mean squares over every fourth line and column.
    """
    jumps, halves, count = 0.0, 0.0, 0
    for lines in (scale[::4], scale[:, ::4].T):
        rate = (lines**2 - finest**2) / (2 * 4**levels)
        face = (rate[:, 1:] + rate[:, :-1]) / 2
        change = np.diff(face / (face + 0.2), axis=1)
        jumps += float(np.vdot(change, change))
        half = face / (face + 0.125) ** 2 * 0.5
        halves += float(np.vdot(half, half))
        count += face.size
    count = max(count, 1)
    return math.hypot(PER_JUMP * math.sqrt(jumps * 2**levels / count), PER_HALF * math.sqrt(halves / count))


def _variation(layer: FloatArray) -> float:
    """Standard deviation of a channel, root mean square of the channels; of a large layer, every 8th row."""
    rows = layer[:: 8 if layer.shape[0] >= 256 else 1].astype(np.float64)
    return math.sqrt(float(rows.var(axis=(0, 1)).mean()))


def _bounded(share: float) -> float:
    return min(max(share, SAFEST), 0.5)
