"""Picks how large cells may be, and how far polynomials go, to meet a tolerance at the least cost.

Two errors add up in quadrature: what a polynomial leaves out, which its share bounds, and what large cells miss. Both
are proportional to the detail of the layer, what differs over one or two widths of the blur. Where cells would
miss too much, the equation is solved on the pixels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray, floats, require_maps
from fogpipe.kernels.bands import in_bands, meanwhile
from fogpipe.kernels.diffusion.adaptive import CAP, adaptive, largest_rate
from fogpipe.kernels.diffusion.grid import rates
from fogpipe.kernels.diffusion.polynomial import degree_for
from fogpipe.kernels.diffusion.published import prepared
from fogpipe.kernels.diffusion.rows import as_integers, count_above, largest_known
from fogpipe.kernels.diffusion.tiles import in_rows, on_grid

MISSED = {1.0: 0.047, 2.0: 0.035, 4.0: 0.026, 8.0: 0.0165, 16.0: 0.0125, 32.0: 0.0118}
"""By the clip, what cells miss over the detail of a photograph: the largest on nine scenes, two sizes, three widths.

The median is half of that. The largest are of a room with ragged edges of its depth. Larger cells would save a tenth of
the time, but leaves before the sky get soft edges, as one sees when the picture is enlarged."""
OF_DETAIL = 0.57
"""Error of a polynomial over its share and the detail of a photograph: on eight 0.23 to 0.45 where the width varies.

With 0.57 the promise was also kept where all is blurred by the same 2 to 5 px, with 0.55 not, by 3 %."""
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
MOST_CELLS = 0.23
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
    require_maps(layer=(layer, 4), scale=(scale, 1))
    layer, scale = floats(layer, scale)
    if scale.size < FEWEST_PIXELS and layer.dtype == np.float32:
        # Costs next to nothing, and in a few pixels the rounding of hundreds of steps would not average out.
        return auto(layer.astype(np.float64), scale.astype(np.float64), finest, tolerance).astype(np.float32)
    largest, part = _surveyed(scale, finest)
    enough = (ENOUGH * max(scale.shape)) ** 2 / 2
    if largest > enough:
        scale, largest = np.minimum(scale, scale.dtype.type(_scale_of(enough, finest))), enough
    if scale[part].size == scale.size:
        return follow(choose(layer, scale, finest, largest, tolerance), layer, scale, finest)
    after = np.empty_like(layer)
    kept = meanwhile(_keep, layer, after, *part)
    if scale[part].size:
        inside, wanted = floats(layer[part], scale[part])
        plan, target = choose(inside, wanted, finest, largest, tolerance), after[part]
        if target.flags.c_contiguous:
            follow(plan, inside, wanted, finest, target)
        else:
            target[...] = follow(plan, inside, wanted, finest)
    kept()
    return after


def reference(layer: np.ndarray, scale: np.ndarray, finest: float) -> FloatArray:
    """The equation itself, in float64: at most 1e-9 of any pattern is left out. About 300 steps for 25 px."""
    layer, scale = prepared(layer.astype(np.float64), scale, finest)
    stretches = max(1, math.ceil(largest_rate(scale, finest) / LONGEST_RATE))
    return follow(Plan(math.inf, stretches, 1e-9 / stretches), layer, scale, finest)


def follow(
    plan: Plan, layer: FloatArray, scale: FloatArray, finest: float, after: FloatArray | None = None
) -> FloatArray:
    """Diffuse a layer (H, W, 4) to σ = ``scale`` (H, W) according to a plan; into ``after`` if given."""
    if plan.clip < math.inf:
        return adaptive(layer, scale, finest, plan.clip, plan.share, after)
    if plan.stretches > 1:
        scale = np.sqrt(2 * rates(scale, finest) / scale.dtype.type(plan.stretches) + scale.dtype.type(finest**2))
    largest = largest_rate(scale, finest)
    for stretch in range(plan.stretches):
        last = stretch == plan.stretches - 1
        layer = on_grid(layer, scale, finest, largest, plan.share, after=after if last else None)
    return layer


def choose(layer: FloatArray, scale: FloatArray, finest: float, largest: float, tolerance: float) -> Plan:
    """The cheapest plan that meets a tolerance, where σ is ``scale`` (H, W) and ϱ at most ``largest``."""
    variation = math.sqrt(_variance(in_rows(layer), _apart(len(layer))))
    if largest <= 0:
        return Plan(math.inf, 1, LARGEST_SHARE)
    rough = _roughness(layer) > ROUGHEST * variation
    # For a rough layer no less than it can be: the share of a polynomial is then a strict bound.
    detail = variation / OF_DETAIL if rough else _detail(layer, math.sqrt(2 * largest))
    detail = max(detail, 1e-6 * variation, 1e-3 * tolerance)
    whole = on_pixels(largest, tolerance / (OF_DETAIL * detail))
    plans = [(float(whole.stretches * degree_for(8 * largest / whole.stretches, whole.share)), whole)]
    if scale.size >= FEWEST_PIXELS:
        for clip, missed in MISSED.items():
            left = tolerance**2 - (missed * detail) ** 2
            if clip < largest and left > 0:
                plan = Plan(clip, 1, _bounded(math.sqrt(left) / (OF_DETAIL * detail)))
                on_grid_degree, degree = (degree_for(8 * each, plan.share) for each in (clip, CAP * clip))
                limit = scale.dtype.type(_scale_of(clip, finest))
                cells, others = _cells(scale, _apart(len(scale)), scale.dtype.type(finest), limit, on_grid_degree)
                # In steps on the pixels, of which a step of as many cells takes five, and to set up the cells eight.
                if cells <= MOST_CELLS:
                    plans.append((8 + 5 * cells * degree + others * on_grid_degree, plan))
                if plan.share == LARGEST_SHARE:
                    break  # smaller cells are more, take more steps, and may leave out no more
    return min(plans)[1]


def on_pixels(largest: float, share: float) -> Plan:
    """The plan without cells: as many stretches as keep the rounding errors of a polynomial small."""
    stretches = max(1, math.ceil(largest / STEADY_RATE))
    return Plan(math.inf, stretches, _bounded(share / stretches))


def _keep(layer: FloatArray, after: FloatArray, down: slice, across: slice) -> None:
    """Copy what lies outside of a rectangle."""
    above, below = (slice(0, down.start), slice(None)), (slice(down.stop, None), slice(None))
    left, right = (down, slice(0, across.start)), (down, slice(across.stop, None))
    for part in (above, below, left, right):
        after[part] = layer[part]


def _scale_of(rate: float, finest: float) -> float:
    """The σ where ϱ is ``rate``."""
    return math.sqrt(2 * rate + finest**2)


def _surveyed(scale: FloatArray, finest: float) -> tuple[float, tuple[slice, slice]]:
    """The largest ϱ, and the rectangle beyond which no light moves: one pixel larger than all that is blurred."""
    rows, columns = scale.shape
    finest_bits = as_integers(scale.dtype.type(finest))
    largest = np.empty(rows, scale.dtype)
    first, last = np.empty(rows, np.int64), np.empty(rows, np.int64)
    in_bands(_survey, rows, columns, as_integers(scale), finest_bits, as_integers(largest), first, last)
    widest, top, bottom, left, right = _extent(largest, first, last)
    if bottom == 0:
        return 0.0, (slice(0, 0), slice(0, 0))
    part = slice(max(top - 1, 0), bottom + 1), slice(max(left - 1, 0), right + 1)
    return (widest**2 - finest**2) / 2, part


def _apart(rows: int) -> int:
    """How far the rows are apart that are looked at: 32 in a large layer, 1 in a small one."""
    return max(1, min(32, rows // 32))


def _detail(layer: FloatArray, largest: float) -> float:
    """Standard deviation of what is finer than twice the largest blur, or a little more, and so may be left out."""
    rows, columns = layer.shape[:2]
    squares = 0.0
    for widths in (2.0, 1.3):
        down, across = (max(1, min(round(widths * largest), count // 2)) for count in (rows, columns))
        squares = max(squares, _mean_square(in_rows(layer), 0, 4 * across, _apart(rows)))
        squares = max(squares, _mean_square(in_rows(layer), down, 0, _apart(rows - down)))
    return math.sqrt(squares / 2)


def _bounded(share: float) -> float:
    return min(max(share, SMALLEST_SHARE), LARGEST_SHARE)


def _roughness(layer: FloatArray) -> float:
    """Root mean square of the steps from one pixel of a row to the next, over √2; down a single column."""
    down, across = (0, 1) if layer.shape[1] > 1 else (1, 0)
    return math.sqrt(_mean_square(in_rows(layer), down, 4 * across, _apart(len(layer) - down)) / 2)


# In any order of adding up, the compiler makes vectors of these loops.
@numba.njit(nogil=True, cache=True, fastmath={"reassoc", "contract"})
def _mean_square(values, down, across, apart):
    """Of the differences to values further on, in rows ``apart``; 0 if there are none.

    Whole rows are read in either direction, since each pixel of a column would be a miss of the cache.
    """
    rows, columns = values.shape[0] - down, values.shape[1] - across
    total, count = 0.0, 0
    for y in range(0, rows, apart):
        here, there, squares = values[y, :columns], values[y + down, across:], values.dtype.type(0)
        for i in range(np.uintp(columns)):
            difference = there[i] - here[i]
            squares += difference * difference
        total, count = total + squares, count + columns
    return total / max(count, 1)


@numba.njit(nogil=True, cache=True, fastmath={"reassoc", "contract"})
def _variance(values, apart):
    """Mean over the channels, of rows ``apart`` of four numbers a pixel."""
    variance, count = 0.0, len(range(0, values.shape[0], apart)) * (values.shape[1] // 4)
    for k in range(4):
        start = float(values[0, k])  # about a value there is, for what varies little
        first, second = 0.0, 0.0
        for y in range(0, values.shape[0], apart):
            row = values[y, k:]
            for x in range(np.uintp(values.shape[1] // 4)):
                value = float(row[np.uintp(4) * x]) - start
                first += value
                second += value * value
        variance += max(second / count - (first / count) ** 2, 0.0)
    return variance / 4


@numba.njit(nogil=True, cache=True)
def _cells(scale, apart, finest, clip, reach):
    """Cells for each pixel, one of 4^k pixels where ϱ is up to 4^k times what it is for the scale ``clip``.

    And the share of pixels far from cells of several. Of rows ``apart``, so the reach is doubled for what comes from
    above and below.
    """
    rows, columns = scale.shape
    cells, near, count = 0.0, 0, 0
    for y in range(0, rows, apart):
        row, count = scale[y], count + columns
        joined, limit, saved = count_above(row, clip), clip, 0.75
        larger = joined
        while larger:
            cells -= saved * larger
            saved, limit = 0.25 * saved, np.sqrt(4 * (limit * limit - finest * finest) + finest * finest)
            larger = count_above(row, limit)
        if joined == columns:
            near += columns
        elif joined:
            done = 0
            for x in range(columns):
                if row[x] > clip:
                    end = min(x + 2 * reach + 1, columns)
                    near += end - max(done, x - 2 * reach)
                    done = end
    return (cells + near) / count, 1 - near / count


@numba.njit(nogil=True, cache=True)
def _extent(largest, first, last):
    """The largest scale, and the first row and the one after the last that are blurred, and the same of columns."""
    widest, left, right, top, bottom = largest[0], first[0], last[0], 0, 0
    for y in range(len(largest)):
        widest, left, right = max(widest, largest[y]), min(left, first[y]), max(right, last[y])
        if last[y]:
            top, bottom = (top if bottom else y), y + 1
    return widest, top, bottom, left, right


@numba.njit(nogil=True, cache=True)
def _survey(begin, end, scale, finest, largest, first, last):
    """The largest scale of each row, the first column that is blurred and the one after the last; 0 for none.

    Of scales as integers.
    """
    columns = scale.shape[1]
    for y in range(begin, end):
        largest[y], first[y], last[y] = largest_known(scale[y]), columns, 0
        if largest[y] > finest:
            left, right = 0, columns
            while not finest < scale[y, left] <= largest[y]:
                left += 1
            while not finest < scale[y, right - 1] <= largest[y]:
                right -= 1
            first[y], last[y] = left, right
