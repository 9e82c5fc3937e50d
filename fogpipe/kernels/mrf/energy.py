"""The energy of Guo 2014, eq. 2 to 5, on a grid of labels, and its messages.

A label ``k`` stands for the haziness ``k·step`` in the units of the data cost. Each edge of the grid joins a *first*
pixel, the upper or the left one, to a *second* one. Labels ``a`` of the first and ``b`` of the second cost, times the
weight of the edge,

    fall · (a − b)         where a ≥ b,
    jump + rise · (b − a)  where a < b.

The order of eq. 5 (the upper pixel is at least as hazy) is fall = g, rise = 0, jump = s; the plain linear
cost g·|a − b| is fall = rise = g, jump = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from fogpipe.kernels.arrays import FloatArray


class Cost(NamedTuple):
    """What labels that differ cost along an edge of weight 1."""

    fall: float
    rise: float
    jump: float


class Field(NamedTuple):
    """A Markov random field.

    Attributes
    ----------
    target : (H, W) the value that each pixel wants; the data cost is ``|target − k·step|``.
    down : (H, W) weight of the edge from each pixel to the one below; 0 in the last row.
    right : (H, W) weight of the edge from each pixel to the one on its right; 0 in the last column.
    step : difference between neighbouring labels in units of the target.
    labels : number of labels, at most 256.
    vertical, horizontal : the costs along columns and along rows.
    """

    target: FloatArray
    down: FloatArray
    right: FloatArray
    step: float
    labels: int
    vertical: Cost
    horizontal: Cost


class Solution(NamedTuple):
    """Labels (H, W) uint8, their energy, and a lower bound of every energy (−inf where a solver has none)."""

    labels: np.ndarray
    energy: float
    bound: float

    @property
    def gap(self) -> float:
        """How far the energy may be from the least one, as a share of it; inf without a bound."""
        excess = self.energy - self.bound
        return max(0.0, excess / self.energy) if self.energy > 0 else 0.0


def energy(field: Field, labels: np.ndarray) -> float:
    """The energy of a labelling, in float64."""
    chosen = labels.astype(np.float64)
    data = np.abs(field.target - chosen * field.step).sum(dtype=np.float64)
    below = _pairs(chosen[:-1] - chosen[1:], field.down[:-1], field.vertical)
    beside = _pairs(chosen[:, :-1] - chosen[:, 1:], field.right[:, :-1], field.horizontal)
    return float(data + below + beside)


def _pairs(fallen: FloatArray, weight: FloatArray, cost: Cost) -> float:
    each = np.where(fallen >= 0, cost.fall * fallen, cost.jump - cost.rise * fallen)
    return float(np.sum(weight * each, dtype=np.float64))


@njit(nogil=True, cache=True)
def pass_on(held, weight, up, up_jump, down, down_jump, message):
    """Min-sum message ``message[b] = min over a of held[a] + weight · cost(a → b)``, in O(labels).

    Going up from a to b > a costs ``up_jump + up · (b − a)``, going down ``down_jump + down · (a − b)``.
    """
    labels = len(held)
    up, up_jump, down, down_jump = weight * up, weight * up_jump, weight * down, weight * down_jump
    least = held[0]
    message[0] = held[0]
    for b in range(1, labels):
        least += up
        message[b] = min(held[b], least + up_jump)
        least = min(least, held[b])
    least = held[labels - 1]
    for b in range(labels - 2, -1, -1):
        least += down
        message[b] = min(message[b], least + down_jump)
        least = min(least, held[b])
