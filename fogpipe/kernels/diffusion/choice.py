"""Picks stretches of time, largest rate and degree that meet a tolerance at the least cost.

Two errors add up in quadrature: what a polynomial leaves out, which its share bounds, and what comes of taking the
levels one after the other, which a model foretells from where the scales jump (:func:`contrast_at_jumps`). Where the
model asks for too much, the equation is solved on the pixels, and the error is the share of that one polynomial in the
detail of the layer.
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
    jumps : error over the jumps times the contrast there: the largest measured on eight scenes at two widths.
    """

    stretches: int
    clip: float
    even: float
    jumps: float


SPLITTINGS = (
    Splitting(1, 2.0, 0.018, 0.35),
    Splitting(1, 4.0, 0.006, 0.38),
    Splitting(1, 8.0, 0.006, 0.45),
    Splitting(1, 16.0, 0.006, 0.54),
    Splitting(2, 2.0, 0.005, 0.27),
    Splitting(2, 4.0, 0.004, 0.29),
)
LEAST_CONTRAST = 0.08
"""Contrast at an edge of the scales, as a share of the variation, even where the layer shows none on the spot."""
OF_A_SHARE = 0.4
"""Error of the polynomials of all levels over their share and the variation: 0.12 to 0.3 measured on two scenes."""
STEADY_RATE = 512.0
"""Up to here (a blur of 32 px) the rounding errors of one polynomial stay below 1e-5; at 80 px they would be 1e-2."""
LARGEST_SHARE = 0.15
"""More would leave texture where the tolerance would not notice but an eye would."""
SMALLEST_SHARE = 1e-5
"""Less is lost in the rounding of float32."""
FEWEST_PIXELS = 65_536
"""A smaller layer is quick to do on the pixels, and its levels would soon have no cells."""
ROUGHEST = 0.5
"""Step between neighbours over the variation, above which a layer is no photograph: 0.1 to 0.3 there, 1 in noise."""
OF_DETAIL = 0.52
"""Error of the polynomial on the pixels over its share and the detail of a photograph: on eight 0.23 to 0.45."""


def auto(layer: np.ndarray, scale: np.ndarray, finest: float, tolerance: float) -> FloatArray:
    """Diffuse so that the root-mean-square error is at most ``tolerance`` (float32: 1e-5 of the variation or more)."""
    layer, scale = prepared(layer, scale, finest)
    part = _moving(scale, finest)
    if scale[part].size == scale.size:
        return split(layer, scale, finest, *choose(layer, scale, finest, tolerance))
    after = layer.copy()
    if scale[part].size:
        inside, wanted = np.ascontiguousarray(layer[part]), np.ascontiguousarray(scale[part])
        after[part] = split(inside, wanted, finest, *choose(inside, wanted, finest, tolerance))
    return after


def _moving(scale: FloatArray, finest: float) -> tuple[slice, slice]:
    """The rectangle beyond which no light moves: one pixel around all that is blurred."""
    blurred = scale > finest
    sides = []
    for axis in (1, 0):
        lines = np.flatnonzero(blurred.any(axis=axis))
        sides.append(slice(max(int(lines[0]) - 1, 0), int(lines[-1]) + 2) if lines.size else slice(0, 0))
    return sides[0], sides[1]


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
    if _roughness(layer) > ROUGHEST * variation:
        return on_pixels(largest, 0.95 * allowed)
    whole = on_pixels(largest, tolerance / max(OF_DETAIL * _detail(layer, float(scale.max())), tolerance))
    if scale.size < FEWEST_PIXELS:
        return whole
    found = edges(layer, scale, variation)
    plans = [(float(whole[0] * degree_for(8 * largest / whole[0], whole[2])), whole)]
    for splitting in SPLITTINGS:
        stretches, clip = splitting.stretches, splitting.clip
        if largest / stretches <= clip:
            break
        jumps = splitting.jumps * contrast_at_jumps(found, finest, stretches, clip)
        missed = math.hypot(splitting.even, jumps / variation)
        if missed < 0.95 * allowed:
            share = min(math.sqrt(allowed**2 - missed**2) / OF_A_SHARE, LARGEST_SHARE)
            # In steps on the pixels, to which it takes as long as eight to set up the levels.
            plans.append((stretches * (8 + 1.3 * degree_for(8 * clip, share)), (stretches, clip, share)))
    return min(plans)[1]


def on_pixels(largest: float, share: float) -> tuple[int, float, float]:
    """The plan without coarse cells: as many stretches as keep the rounding errors of a polynomial small."""
    stretches = max(1, math.ceil(largest / STEADY_RATE))
    return stretches, math.inf, _bounded(share / stretches)


Edges = list[tuple[np.ndarray, np.ndarray]]
"""Of cells of one size: σ² (N, M) along lines, and the squared contrast (N, M − 2) over two cells."""


def edges(layer: FloatArray, scale: FloatArray, variation: float) -> list[Edges]:
    """Scales and contrasts along every 32nd row and column, for pixels and cells of 2, 4, 8, … pixels."""
    found: list[Edges] = []
    cell = 1
    while min(scale.shape) > 2 * cell and cell <= 64:
        middle, every = slice(cell // 2, None, cell), slice(cell // 2, None, max(cell, 32))
        lines = (
            (scale[every, middle], layer[every, middle]),
            (scale[middle, every].T, layer[middle, every].transpose(1, 0, 2)),
        )
        own: Edges = []
        for sigma, values in lines:
            difference = values[:, 2:] - values[:, :-2]
            contrast = np.einsum("yxk,yxk->yx", difference, difference) / 4 + (LEAST_CONTRAST * variation) ** 2
            own.append((sigma**2, contrast))
        found.append(own)
        cell *= 2
    return found


def contrast_at_jumps(found: list[Edges], finest: float, stretches: int, clip: float) -> float:
    """Contrast of a layer where a splitting goes wrong, to which its error is proportional.

    Of a rate ϱ (per stretch, in cells of a level) the level moves the part φ = min(ϱ, clip)/ϱ and leaves the rest to
    the next. Where φ is the same on both sides of an edge, or one side does not move at all, the order in which the
    levels take their turn does not matter. So what is missed is the jump of φ over two cells, weighted by the lower
    rate up to the clip and by the contrast of the layer: root of the mean square over lines, summed over levels.
    """
    squares = 0.0
    for level, own in enumerate(found):
        largest = 0.0
        for variance, contrast in own:
            rate = (variance - finest**2) * (1 / (2 * stretches * 4**level * clip))  # in clips
            largest = max(largest, float(rate.max()))
            moved = 1 / np.maximum(rate, 1)
            jump = moved[:, 2:] - moved[:, :-2]
            lower = np.minimum(np.minimum(rate[:, 2:], rate[:, :-2]), 1)
            squares += float(np.einsum("yx,yx,yx,yx", jump, jump, lower, contrast)) / jump.size / 2
        if largest <= 1:
            break
    return math.sqrt(squares)


def _variation(layer: FloatArray) -> float:
    """Standard deviation of a channel, root mean square of the channels; of some rows of a large layer."""
    return math.sqrt(float(_some(layer).var(axis=(0, 1), dtype=np.float64).mean()))


def _some(lines: np.ndarray) -> np.ndarray:
    """Every 32nd line of a large layer, all of a small one."""
    return lines[:: max(1, min(32, len(lines) // 32))]


def _detail(layer: FloatArray, largest: float) -> float:
    """Standard deviation of what is finer than twice the largest blur, or a little more, and so may be left out."""
    squares = 0.0
    for widths in (2.0, 1.3):
        for lines in (_some(layer), np.ascontiguousarray(_some(layer.transpose(1, 0, 2)))):
            lag = max(1, min(round(widths * largest), lines.shape[1] // 2))
            if lines.shape[1] > lag:
                squares = max(squares, float(np.mean((lines[:, lag:] - lines[:, :-lag]) ** 2)) / 2)
    return math.sqrt(squares)


def _bounded(share: float) -> float:
    return min(max(share, SMALLEST_SHARE), LARGEST_SHARE)


def _roughness(layer: FloatArray) -> float:
    """Root mean square of the steps from one pixel of a row to the next, over √2. One column is taken as a row."""
    lines = _some(layer) if layer.shape[1] > 1 else layer.transpose(1, 0, 2)
    steps = np.diff(lines, axis=1)
    return math.sqrt(float(np.mean(steps**2)) / 2) if steps.size else 0.0
