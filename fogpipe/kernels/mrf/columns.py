"""Each column on its own, solved exactly by dynamic programming."""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.mrf.energy import Field, Solution, energy, pass_on


def columns(field: Field) -> Solution:
    """Least energy of every column without the edges between columns, which is a bound of the whole."""
    height, width = field.target.shape
    labels = np.empty((height, width), np.uint8)
    least = np.empty(width)
    in_bands(_solve, width, height, field, labels, least)
    return Solution(labels, energy(field, labels), float(least.sum()))


@njit(nogil=True, cache=True)
def _solve(first, last, field, chosen, least):
    height, labels = field.target.shape[0], field.labels
    fall, rise, jump = field.vertical
    below = np.zeros((height, labels))  # the message that each pixel gets from all below it
    held = np.empty(labels)
    for column in range(first, last):
        for row in range(height - 1, 0, -1):
            for k in range(labels):
                held[k] = below[row, k] + abs(field.target[row, column] - k * field.step)
            pass_on(held, field.down[row - 1, column], fall, 0.0, rise, jump, below[row - 1])
        above = 0
        for row in range(height):
            best, best_cost = 0, np.inf
            for k in range(labels):
                cost = below[row, k] + abs(field.target[row, column] - k * field.step)
                if row > 0:
                    step_down = above - k
                    weight = field.down[row - 1, column]
                    cost += weight * (fall * step_down if step_down >= 0 else jump - rise * step_down)
                if cost < best_cost:
                    best, best_cost = k, cost
            if row == 0:
                least[column] = best_cost
            chosen[row, column] = above = best
