"""Picks how large cells may be, and how far polynomials go, to meet a tolerance at the least cost.

Two errors add up in quadrature: what a polynomial leaves out, which its share bounds, and what large cells miss. Both
are proportional to the detail of the layer, what differs over one or two widths of the blur. Where cells would
miss too much, the equation is solved on the pixels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.diffusion.adaptive import CAP, adaptive
from fogpipe.kernels.diffusion.grid import conductances
from fogpipe.kernels.diffusion.polynomial import degree_for
from fogpipe.kernels.diffusion.published import prepared
from fogpipe.kernels.diffusion.tiles import on_grid

MISSED = {2.0: 0.035, 4.0: 0.026, 8.0: 0.0165, 16.0: 0.0125, 32.0: 0.0118}
"""By the clip, what cells miss over the detail of a photograph: the largest on nine scenes, two sizes, three widths.

The median is half of that. The largest are of a room with ragged edges of its depth. Larger cells save no time: by
then it goes into the passes over the pixels."""
OF_DETAIL = 0.52
"""Error of a polynomial over its share and the detail of a photograph: on eight 0.23 to 0.45."""
STEADY_RATE = 512.0
"""Up to here (a blur of 32 px) the rounding errors of one polynomial stay below 1e-5; at 80 px they would be 1e-2."""
LONGEST_RATE = 4096.0
"""Of a polynomial of the reference (a blur of 90 px): to find one of a higher degree takes too long."""
ENOUGH = 2
"""Blurs of as many times the length of the layer leave 3e-9 of any pattern; wider ones would only take longer."""
LARGEST_SHARE = 0.15
"""More would leave texture where the tolerance would not notice but an eye would."""
SMALLEST_SHARE = 1e-5
"""Less is lost in the rounding of float32."""
FEWEST_PIXELS = 65_536
"""A smaller layer is quick to do on the pixels, and its cells would soon be few."""
MOST_CELLS = 0.19
"""For each pixel, as estimated. More were seen to take more memory than three layers."""
ROUGHEST = 0.5
"""Step between neighbours over the variation, above which a layer is no photograph: 0.1 to 0.3 there, 1 in noise."""


class Plan(NamedTuple):
    """How to diffuse a layer.

    Attributes
    ----------
    clip : rate at which cells get larger neighbours; infinite for none, the pixels themselves.
    stretches : of time, each with a polynomial of its own; 1 with cells.
    share : what a polynomial may leave out of any pattern.
    """

    clip: float
    stretches: int
    share: float


def auto(layer: np.ndarray, scale: np.ndarray, finest: float, tolerance: float) -> FloatArray:
    """Diffuse so that the root-mean-square error is at most ``tolerance`` (float32: 1e-5 of the variation or more)."""
    layer, scale = prepared(layer, scale, finest)
    if scale.max() > ENOUGH * max(scale.shape):
        scale = np.minimum(scale, scale.dtype.type(ENOUGH * max(scale.shape)))
    if scale.size < FEWEST_PIXELS and layer.dtype == np.float32:
        # Costs next to nothing, and in a few pixels the rounding of hundreds of steps would not average out.
        return auto(layer.astype(np.float64), scale, finest, tolerance).astype(np.float32)
    part = _moving(scale, finest)
    if scale[part].size == scale.size:
        return follow(choose(layer, scale, finest, tolerance), layer, scale, finest)
    after = np.empty_like(layer)
    in_bands(_copy, len(layer), scale.shape[1], layer, after)
    if scale[part].size:
        inside, wanted = np.ascontiguousarray(layer[part]), np.ascontiguousarray(scale[part])
        after[part] = follow(choose(inside, wanted, finest, tolerance), inside, wanted, finest)
    return after


def reference(layer: np.ndarray, scale: np.ndarray, finest: float) -> FloatArray:
    """The equation itself, in float64: at most 1e-9 of any pattern is left out. About 300 steps for 25 px."""
    layer, scale = prepared(layer.astype(np.float64), scale, finest)
    stretches = max(1, math.ceil((float(scale.max()) ** 2 - finest**2) / 2 / LONGEST_RATE))
    return follow(Plan(math.inf, stretches, 1e-9 / stretches), layer, scale, finest)


def follow(plan: Plan, layer: FloatArray, scale: FloatArray, finest: float) -> FloatArray:
    """Diffuse a layer (H, W, 4) according to a plan."""
    if plan.clip < math.inf:
        return adaptive(layer, scale, finest, plan.clip, plan.share)
    east, south = conductances(scale, finest, 1 / plan.stretches)
    largest = max(float(east.max()), float(south.max()))
    for _ in range(plan.stretches):
        layer = on_grid(layer, east, south, largest, plan.share)
    return layer


def choose(layer: FloatArray, scale: FloatArray, finest: float, tolerance: float) -> Plan:
    """The cheapest plan that meets a tolerance."""
    variation, widest = _variation(layer), float(scale.max())
    largest = (widest**2 - finest**2) / 2
    if largest <= 0:
        return Plan(math.inf, 1, LARGEST_SHARE)
    rough = _roughness(layer) > ROUGHEST * variation
    # For a rough layer no less than it can be: the share of a polynomial is then a strict bound.
    detail = variation / OF_DETAIL if rough else _detail(layer, widest)
    detail = max(detail, 1e-6 * variation, 1e-3 * tolerance)
    whole = on_pixels(largest, tolerance / (OF_DETAIL * detail))
    plans = [(float(whole.stretches * degree_for(8 * largest / whole.stretches, whole.share)), whole)]
    if scale.size >= FEWEST_PIXELS:
        rates = (_some(scale) ** 2 - finest**2) / 2
        for clip, missed in MISSED.items():
            left = tolerance**2 - (missed * detail) ** 2
            if clip < largest and left > 0:
                plan = Plan(clip, 1, _bounded(math.sqrt(left) / (OF_DETAIL * detail)))
                on_grid_degree, degree = (degree_for(8 * each, plan.share) for each in (clip, CAP * clip))
                cells, others = _cells(rates, clip, on_grid_degree)
                # In steps on the pixels, of which a step of as many cells takes two, and to set up the cells eight.
                if cells <= MOST_CELLS:
                    plans.append((8 + 2 * cells * degree + others * on_grid_degree, plan))
    return min(plans)[1]


def on_pixels(largest: float, share: float) -> Plan:
    """The plan without cells: as many stretches as keep the rounding errors of a polynomial small."""
    stretches = max(1, math.ceil(largest / STEADY_RATE))
    return Plan(math.inf, stretches, _bounded(share / stretches))


def _copy(first: int, last: int, layer: FloatArray, after: FloatArray) -> None:
    after[first:last] = layer[first:last]


def _moving(scale: FloatArray, finest: float) -> tuple[slice, slice]:
    """The rectangle beyond which no light moves: one pixel around all that is blurred."""
    blurred = scale > finest
    sides = []
    for axis in (1, 0):
        lines = np.flatnonzero(blurred.any(axis=axis))
        sides.append(slice(max(int(lines[0]) - 1, 0), int(lines[-1]) + 2) if lines.size else slice(0, 0))
    return sides[0], sides[1]


def _cells(rates: FloatArray, clip: float, reach: int) -> tuple[float, float]:
    """Cells for each pixel, one of 4^k pixels where the rate is up to 4^k clips; and the share of pixels far from them.

    Of lines, so the reach is doubled for what comes from above and below.
    """
    from scipy.ndimage import maximum_filter1d

    near = maximum_filter1d(rates > clip, 4 * reach + 1, axis=1)
    sizes = 0.25 ** np.ceil(np.log(np.maximum(rates / clip, 1)) / math.log(4))
    return float(np.mean(sizes * near)), 1 - float(np.mean(near))


def _variation(layer: FloatArray) -> float:
    """Standard deviation of a channel, root mean square of the channels; of some rows of a large layer."""
    channels = np.ascontiguousarray(_some(layer).reshape(-1, 4).T)
    return math.sqrt(float(channels.var(axis=1, dtype=np.float64).mean()))


def _some(lines: np.ndarray) -> np.ndarray:
    """Every 32nd line of a large layer, all of a small one."""
    return lines[:: max(1, min(32, len(lines) // 32))]


def _detail(layer: FloatArray, largest: float) -> float:
    """Standard deviation of what is finer than twice the largest blur, or a little more, and so may be left out."""
    squares = 0.0
    for widths in (2.0, 1.3):
        for lines in (_some(layer), _some(layer.transpose(1, 0, 2))):
            lag = max(1, min(round(widths * largest), lines.shape[1] // 2))
            if lines.shape[1] > lag:
                step = max(1, min(4, (lines.shape[1] - lag) // 32))
                difference = lines[:, lag::step] - lines[:, :-lag:step]
                squares = max(squares, float(np.mean(difference**2)) / 2)
    return math.sqrt(squares)


def _bounded(share: float) -> float:
    return min(max(share, SMALLEST_SHARE), LARGEST_SHARE)


def _roughness(layer: FloatArray) -> float:
    """Root mean square of the steps from one pixel of a row to the next, over √2. One column is taken as a row."""
    lines = _some(layer) if layer.shape[1] > 1 else layer.transpose(1, 0, 2)
    steps = np.diff(lines, axis=1)
    return math.sqrt(float(np.mean(steps**2)) / 2) if steps.size else 0.0
