"""Iterated conditional modes (Besag 1986): each pixel takes its best label next to its neighbours, for comparison."""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.mrf.energy import Field, Solution, differ, energy


def icm(field: Field, target_gap: float, passes: int) -> Solution:
    """From the labels nearest to the data, in a chequerboard order, until nothing changes or ``passes`` are done.

    The bound is the data cost alone.
    """
    height, width = field.target.shape
    nearest = np.rint(field.target / field.step) if field.step else np.zeros((height, width))
    labels = np.clip(nearest, 0, field.labels - 1).astype(np.uint8)
    bound = float(np.abs(field.target - labels * field.step).sum(dtype=np.float64))
    changed = np.empty(height, np.int64)
    for _ in range(passes):
        moves = 0
        for colour in (0, 1):
            in_bands(_move, height, width, field, colour, labels, changed)
            moves += int(changed.sum())
        found = Solution(labels, energy(field, labels), bound)
        if moves == 0 or found.gap <= target_gap:
            break
    return Solution(labels, energy(field, labels), bound)


@njit(nogil=True, cache=True)
def _move(first, last, field, colour, chosen, changed):
    """Pixels of one colour: their neighbours, all of the other, stay as they are meanwhile."""
    height, width = chosen.shape
    for row in range(first, last):
        changed[row] = 0
        for column in range((row + colour) % 2, width, 2):
            best, best_cost = np.int64(chosen[row, column]), np.inf
            now = best
            for count in range(field.labels):
                k = (now + count) % field.labels  # the present label first, so that ties change nothing
                cost = abs(field.target[row, column] - k * field.step)
                if row > 0:
                    cost += field.down[row - 1, column] * differ(field.vertical, chosen[row - 1, column] - k)
                if row < height - 1:
                    cost += field.down[row, column] * differ(field.vertical, k - chosen[row + 1, column])
                if column > 0:
                    cost += field.right[row, column - 1] * differ(field.horizontal, chosen[row, column - 1] - k)
                if column < width - 1:
                    cost += field.right[row, column] * differ(field.horizontal, k - chosen[row, column + 1])
                if cost < best_cost:
                    best, best_cost = k, cost
            changed[row] += best != now
            chosen[row, column] = best
