"""Diffusion on cells as large as the blur allows: all of them take their steps together, and keep the mean.

Where the blur is wide a cell stands for many pixels, and one polynomial of a low degree moves light on all cells at
once, so nothing waits at an edge. Pixels far from any larger cell are stepped on the grid, in tiles. At the end each
cell gives its pixels what it has, along the slope to its neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numba
import numpy as np

from fogpipe.kernels.arrays import FloatArray
from fogpipe.kernels.bands import in_bands, meanwhile
from fogpipe.kernels.channels import load, store
from fogpipe.kernels.diffusion.grid import hierarchy
from fogpipe.kernels.diffusion.partition import LinksBack, Partition, links_back, partition
from fogpipe.kernels.diffusion.polynomial import LARGEST_FACTOR, coefficients, degree_for, quantised
from fogpipe.kernels.diffusion.rows import largest_of
from fogpipe.kernels.diffusion.tiles import SQUARE, on_grid
from fogpipe.kernels.diffusion.transfer import gathered, spread

RIM = 2
"""Squares at most around those that are taken from the cells: what is missing beyond shows in the last of these."""
CAP = 2.0
"""Largest rate of a link, in clips. Twice as much gains little and takes two fifths more steps."""


def adaptive(
    layer: FloatArray, scale: FloatArray, finest: float, clip: float, share: float, after: FloatArray | None = None
) -> FloatArray:
    """Diffuse a layer (H, W, 4) on cells whose rates are about ``clip`` to four times as much.

    ``scale`` is σ (H, W) of its pixels, ``finest`` is σ0, and ``share`` what a polynomial may leave out of any pattern.
    The result is written into ``after`` if that is given.
    """
    growing = hierarchy(scale, finest, clip, CAP * clip)
    pixels = next(growing)
    if largest_of(pixels.joined.reshape(-1)) == 0:
        return on_grid(layer, scale, finest, largest_rate(scale, finest), share, after=after)
    after = np.empty(layer.shape, layer.dtype) if after is None else after
    degree, degree_of_cells = degree_for(8 * clip, share), degree_for(quantised(8 * CAP * clip), share)
    near = meanwhile(_near, pixels.joined, degree, degree_of_cells)
    stepped = meanwhile(_step_pixels, layer, scale, finest, near, clip, share, after)
    levels = [pixels, *growing]
    if degree > LARGEST_FACTOR:
        stepped()  # several passes take another layer, whose memory is free before cells need some
    cells = partition(levels, near(), CAP * clip)
    back = meanwhile(links_back, cells)
    values, held = gathered(layer, levels, cells)
    held = _evened(held, cells, back(), share)
    stepped()
    spread(held, cells, levels, values, after, clip)
    return after


def _step_pixels(
    layer: FloatArray,
    scale: FloatArray,
    finest: float,
    near: Callable[[], np.ndarray],
    clip: float,
    share: float,
    after: FloatArray,
) -> None:
    """Those that are far from larger cells."""
    others = near() < 2
    on_grid(layer, scale, finest, _calm(scale, finest, others, clip, share), share, others, after)


def _near(joined: np.ndarray, degree: int, degree_of_cells: int) -> np.ndarray:
    """Squares: 2 for those whose light comes from a larger cell or goes there, 1 for a rim around them, 0 for others.

    ``joined`` is not 0 where pixels of a square are part of a larger cell. From beyond so many pixels as the steps on
    the grid, light does not come, and what is cut off is noticed in as many cells as these take steps; but half of the
    one and a quarter of the other changed eight scenes by at most 3 % of the tolerance.
    """
    import cv2

    squares = math.ceil(degree / 2 / SQUARE)
    rim = min(math.ceil(degree_of_cells / 4 / SQUARE), RIM)
    around, beyond = (np.ones((2 * count + 1, 2 * count + 1), np.uint8) for count in (squares, rim))
    inner = cv2.dilate((joined > 0).view(np.uint8), around)
    return inner + cv2.dilate(inner, beyond)


def _calm(scale: FloatArray, finest: float, squares: np.ndarray, clip: float, share: float) -> float:
    """No less than the largest rate in some squares: the clip, for what has a face above that is not in those."""
    if degree_for(8 * clip, share) <= LARGEST_FACTOR:
        return clip
    # Several passes over the layer, or none: that is worth a look.
    calm = np.repeat(np.repeat(squares, SQUARE, axis=0), SQUARE, axis=1)
    return min(clip, largest_rate(scale, finest, calm[: scale.shape[0], : scale.shape[1]]))


def largest_rate(scale: FloatArray, finest: float, among: np.ndarray | bool = True) -> float:
    """Largest rate of the pixels that are blurred; 0 for none."""
    widest = float(np.fmax.reduce(scale, axis=None, where=among, initial=finest))
    return (widest**2 - finest**2) / 2


def _evened(held: FloatArray, cells: Partition, back: LinksBack, share: float) -> FloatArray:
    """Diffused for a unit of time, by Clenshaw's recurrence b(k) = c(k) F + 2 X b(k+1) − b(k+2), X = 1 − 2A/λ.

    It begins with b(m) = c(m) F and ends with c(0) F + X b(1) − b(2).
    """
    spectrum = quantised(2 * back.leaving)
    if spectrum == 0:
        return held
    real, links = held.dtype.type, (cells.neighbours.ravel(), cells.weights.ravel())
    links = *links, cells.starts[1], back.first, back.finer, back.rates
    *series, last = coefficients(spectrum, degree_for(spectrum, share))
    now, of_now, older, of_older = held, last, held, 0.0
    for k in range(len(series) - 1, -1, -1):
        twice = of_now * (2 if k else 1)
        factors = real(series[k]), real(twice), real(twice * 2 / spectrum), real(of_older)
        after = np.empty_like(held) if older is held else older
        # The larger cells, which come last, take longest.
        in_bands(_step, len(cells.mass), 1, *links, held, now, older, *factors, after, last_first=True)
        now, of_now, older, of_older = after, 1.0, now, of_now
    return now


_FOUR = np.uintp(4)


@numba.njit(nogil=True, cache=True, fastmath={"contract"})
def _step(
    lowest, highest, neighbours, weights, start, first, finer, rates,
    held, now, older, factor, of_here, of_flow, of_older, after,
):  # fmt: skip
    for number in range(lowest, highest):
        own = np.uintp(number) * _FOUR
        here = load(now, own)
        flow = here - here
        for side in range(own, own + _FOUR):
            flow = flow + weights[side] * (load(now, np.uintp(neighbours[side]) * _FOUR) - here)
        if number >= start:
            for link in range(first[number - start], first[number - start + 1]):
                flow = flow + rates[link] * (load(now, np.uintp(finer[link]) * _FOUR) - here)
        kept = factor * load(held, own) - of_older * load(older, own)
        store(after, own, kept + of_here * here + of_flow * flow)
