"""Sequential tree-reweighted message passing (Kolmogorov 2006), for comparison.

The trees are the rows and the columns of the grid. Messages run along single edges in the order of the pixels, so that
what a long column with a hard order knows travels one averaging at a time; that is why
:mod:`fogpipe.kernels.mrf.chains` needs far fewer passes here. One thread: each pixel waits for the last.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.mrf.chains import dual_bound, padded
from fogpipe.kernels.mrf.energy import Field, Solution, differ, energy
from fogpipe.kernels.mrf.tiles import LANES


def trws(field: Field, target_gap: float, passes: int) -> Solution:
    """Labels and bound after at most ``passes`` passes forth and back; the gap is checked after 2, 4, 8…"""
    height, width = field.target.shape
    # A message lives on its edge: the one to the second pixel until the pass back replaces it by the one to the first.
    down = np.zeros((height, width, field.labels), field.target.dtype)
    right = np.zeros_like(down)
    labels = np.zeros((height, width), np.uint8)
    best = Solution(labels, np.inf, 0.0)
    check = 2
    for count in range(1, passes + 1):
        _pass(field, down, right, labels, False)
        reached = energy(field, labels)
        if reached < best.energy:
            best = best._replace(labels=labels.copy(), energy=reached)
        _pass(field, down, right, labels, True)
        if count in (check, passes):
            check *= 2
            best = best._replace(bound=max(best.bound, _bound(field, down, right)))
            if best.gap <= target_gap:
                break
    return best


@njit(nogil=True, cache=True)
def _pass(field, down, right, chosen, back):
    """One pass in the order of the pixels, which also chooses labels, or one back."""
    height, width = field.target.shape
    every, held = np.empty(field.labels), np.empty(field.labels)
    share = 0.5 if height > 1 and width > 1 else 1.0  # one over the number of chains through a pixel
    for count in range(height * width):
        site = height * width - 1 - count if back else count
        row, column = site // width, site % width
        if not back:
            chosen[row, column] = _choice(field, down, right, chosen, row, column, every)
        _collected(field, down, right, row, column, every)
        if back:
            if row > 0:
                _send(every, share, field.down[row - 1, column], field.vertical, True, held, down[row - 1, column])
            if column > 0:
                _send(every, share, field.right[row, column - 1], field.horizontal, True, held, right[row, column - 1])
        else:
            if row < height - 1:
                _send(every, share, field.down[row, column], field.vertical, False, held, down[row, column])
            if column < width - 1:
                _send(every, share, field.right[row, column], field.horizontal, False, held, right[row, column])


@njit(nogil=True, cache=True)
def _collected(field, down, right, row, column, every):
    """The data cost and all messages to a pixel."""
    height, width = field.target.shape
    for k in range(len(every)):
        every[k] = abs(field.target[row, column] - k * field.step)
        if row > 0:
            every[k] += down[row - 1, column, k]
        if column > 0:
            every[k] += right[row, column - 1, k]
        if row < height - 1:
            every[k] += down[row, column, k]
        if column < width - 1:
            every[k] += right[row, column, k]


@njit(nogil=True, cache=True)
def _send(every, share, weight, cost, to_first, held, message):
    """Replace the message that came along an edge by the one that goes back along it, less its smallest value."""
    for k in range(len(held)):
        held[k] = share * every[k] - message[k]
    up, up_jump, down, down_jump = (
        (cost.fall, 0.0, cost.rise, cost.jump) if to_first else (cost.rise, cost.jump, cost.fall, 0.0)
    )
    labels = len(held)
    least = held[0]
    message[0] = held[0]
    for b in range(1, labels):
        least += weight * up
        message[b] = min(held[b], least + weight * up_jump)
        least = min(least, held[b])
    least = held[labels - 1]
    for c in range(1, labels):
        b = labels - 1 - c
        least += weight * down
        message[b] = min(message[b], least + weight * down_jump)
        least = min(least, held[b])
    lowest = message.min()
    for b in range(labels):
        message[b] -= lowest


@njit(nogil=True, cache=True)
def _choice(field, down, right, chosen, row, column, costs):
    """The best label next to the labels above and on the left, with the messages from below and the right."""
    height, width = field.target.shape
    for k in range(len(costs)):
        costs[k] = abs(field.target[row, column] - k * field.step)
        if row > 0:
            costs[k] += field.down[row - 1, column] * differ(field.vertical, np.int64(chosen[row - 1, column]) - k)
        if column > 0:
            fallen = np.int64(chosen[row, column - 1]) - k
            costs[k] += field.right[row, column - 1] * differ(field.horizontal, fallen)
        if row < height - 1:
            costs[k] += down[row, column, k]
        if column < width - 1:
            costs[k] += right[row, column, k]
    return np.uint8(costs.argmin())


def _bound(field: Field, down: np.ndarray, right: np.ndarray) -> float:
    """The bound of the messages: after a pass, the chains through a pixel hold equal shares of its costs."""
    costs = padded(np.zeros_like(down), LANES)
    _share_out(field, down, right, costs)
    height, width, labels = costs.shape
    blocks = costs.reshape(height, width // LANES, LANES, labels).transpose(1, 0, 3, 2)
    return dual_bound(field, np.ascontiguousarray(blocks))[1]


@njit(nogil=True, cache=True)
def _share_out(field, down, right, costs):
    """What the column through each pixel has of its costs."""
    height, width = field.target.shape
    every = np.empty(field.labels)
    share = 0.5 if height > 1 and width > 1 else (1.0 if width == 1 else 0.0)
    for row in range(height):
        for column in range(width):
            _collected(field, down, right, row, column, every)
            for k in range(field.labels):
                vertical = down[row, column, k] if row < height - 1 else 0.0
                vertical += down[row - 1, column, k] if row > 0 else 0.0
                costs[row, column, k] = share * every[k] - vertical
