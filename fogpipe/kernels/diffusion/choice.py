"""Picks stretches of time, largest rate and degree that meet a tolerance at the least cost.

Two errors add up in quadrature: what a polynomial leaves out, which its share bounds, and what comes of taking the
levels one after the other, which a model foretells from where the scales jump (:func:`contrast_at_jumps`). Where the
model asks for too much, the equation is solved on the pixels, and the share of that one polynomial is a bound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.diffusion.polynomial import degree_for
from fogpipe.kernels.diffusion.published import prepared
from fogpipe.kernels.diffusion.splitting import split


class Splitting(NamedTuple):
    """A way to split, and what it misses.

    Attributes
    ----------
    stretches, clip : as in :func:`~fogpipe.kernels.diffusion.splitting.split`.
    even : share of the variation missed at one scale for the whole of a photograph: a third above the measured.
    jumps : error over the jumps times the contrast there: above the largest measured on two scenes.
    """

    stretches: int
    clip: float
    even: float
    jumps: float


SPLITTINGS = (
    Splitting(1, 2.0, 0.018, 0.30),
    Splitting(1, 4.0, 0.006, 0.33),
    Splitting(2, 2.0, 0.005, 0.18),
    Splitting(2, 4.0, 0.004, 0.24),
    Splitting(3, 2.0, 0.004, 0.18),
    Splitting(4, 4.0, 0.002, 0.26),
)
"""By growing cost."""
LEAST_CONTRAST = 0.08
"""Contrast at an edge of the scales, as a share of the variation, even where the layer shows none on the spot."""
OF_A_SHARE = 0.4
"""Error of the polynomials of all levels over their share and the variation: 0.12 to 0.3 measured on two scenes."""
LARGEST_SHARE = 0.1
"""More would leave texture where the tolerance would not notice but an eye would."""
SMALLEST_SHARE = 1e-5
"""Less is lost in the rounding of float32."""
FEWEST_PIXELS = 65_536
"""A smaller layer is quick to do on the pixels, and its levels would soon have no cells."""
ROUGHEST = 0.5
"""Step between neighbours over the variation, above which a layer is no photograph: 0.1 to 0.3 there, 1 in noise."""
ABOVE_SHARE = 1.7
"""A polynomial scaled to conserve the mean leaves out at most this many times its share."""


def auto(layer: np.ndarray, scale: np.ndarray, finest: float, tolerance: float) -> FloatArray:
    """Diffuse so that the root-mean-square error is at most ``tolerance`` (float32: 1e-5 of the variation or more)."""
    layer, scale = prepared(layer, scale, finest)
    return split(layer, scale, finest, *choose(layer, scale, finest, tolerance))


def reference(layer: np.ndarray, scale: np.ndarray, finest: float) -> FloatArray:
    """The equation itself, in float64: at most 1e-9 of any pattern is left out. About 300 steps for 25 px."""
    layer, scale = prepared(layer.astype(np.float64), scale, finest)
    return split(layer, scale, finest, 1, math.inf, 1e-9)


def choose(layer: FloatArray, scale: FloatArray, finest: float, tolerance: float) -> tuple[int, float, float]:
    """Stretches of time, largest rate of a level, and share that a polynomial may leave out."""
    variation = _variation(layer)
    largest = (float(scale.max()) ** 2 - finest**2) / 2
    if variation == 0 or largest <= 0:
        return 1, math.inf, LARGEST_SHARE
    allowed = tolerance / variation
    whole = min(max(allowed / ABOVE_SHARE, SMALLEST_SHARE), LARGEST_SHARE)
    steps_on_the_whole = degree_for(8 * largest, whole)
    if scale.size < FEWEST_PIXELS or _roughness(layer) > ROUGHEST * variation:
        return 1, math.inf, whole
    for splitting in SPLITTINGS:
        stretches, clip = splitting.stretches, splitting.clip
        if largest / stretches <= clip:
            break
        jumps = splitting.jumps * contrast_at_jumps(layer, scale, finest, variation, stretches, clip)
        missed = math.hypot(splitting.even, jumps / variation)
        if missed < 0.95 * allowed:
            share = min(math.sqrt(allowed**2 - missed**2) / OF_A_SHARE, LARGEST_SHARE)
            # In passes over the layer, four of them to set up the levels; coarse levels make a third more of each step.
            if stretches * (4 + 1.5 * degree_for(8 * clip, share)) < steps_on_the_whole:
                return stretches, clip, share
    return 1, math.inf, whole


def contrast_at_jumps(
    layer: FloatArray, scale: FloatArray, finest: float, variation: float, stretches: int, clip: float
) -> float:
    """Contrast of a layer where a splitting goes wrong, to which its error is proportional.

    Of a rate ϱ (per stretch, in cells of a level) the level moves the part φ = min(ϱ, clip)/ϱ and leaves the rest to
    the next. Where φ is the same on both sides of an edge, or one side does not move at all, the order in which the
    levels take their turn does not matter. So what is missed is the jump of φ over two cells, weighted by the lower
    rate up to the clip and by the contrast of the layer: root of the mean square over every 32nd line, summed over
    levels.
    """
    squares, cell = 0.0, 1
    while True:
        inside = slice(cell // 2, None, cell)
        every = max(1, 32 // cell)
        shape = scale[inside, inside].shape
        if min(shape) < 3:
            break
        largest = 0.0
        for sigma, values in (
            (scale[inside, inside][::every], layer[inside, inside][::every]),
            (scale[inside, inside][:, ::every].T, layer[inside, inside][:, ::every].transpose(1, 0, 2)),
        ):
            rate = (sigma**2 - finest**2) / (2 * stretches * cell**2)
            largest = max(largest, float(rate.max()))
            low, high = np.minimum(rate[:, 2:], rate[:, :-2]), np.maximum(rate[:, 2:], rate[:, :-2])
            jump = clip / np.fmax(low, clip) - clip / np.fmax(high, clip)
            contrast = np.mean((values[:, 2:] - values[:, :-2]) ** 2, axis=2) + (LEAST_CONTRAST * variation) ** 2
            squares += float(np.mean(jump**2 * np.minimum(low / clip, 1) * contrast)) / 2
        if largest <= clip:
            break
        cell *= 2
    return math.sqrt(squares)


def _variation(layer: FloatArray) -> float:
    """Standard deviation of a channel, root mean square of the channels; of a large layer, every 8th row."""
    rows = layer[:: 8 if layer.shape[0] >= 256 else 1].astype(np.float64)
    return math.sqrt(float(rows.var(axis=(0, 1)).mean()))


def _roughness(layer: FloatArray) -> float:
    """Root mean square of the steps from one pixel of a row to the next, over √2; of every 8th row."""
    return math.sqrt(float(np.mean(np.diff(layer[::8], axis=1) ** 2)) / 2)
