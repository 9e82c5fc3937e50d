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
from fogpipe.kernels.bands import in_bands

ROUNDING = 1e-9
"""Energies that differ by less, in units of the data cost, are the same."""


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
    """Labels (H, W) uint8, their energy, and a lower bound of every energy (at least 0, since no cost is negative)."""

    labels: np.ndarray
    energy: float
    bound: float

    @property
    def gap(self) -> float:
        """How far the energy may be from the least one, as a share of it."""
        excess = self.energy - self.bound
        return excess / self.energy if excess > ROUNDING else 0.0


def energy(field: Field, labels: np.ndarray) -> float:
    """The energy of a labelling, in float64."""
    height, width = labels.shape
    sums = np.empty(height)
    in_bands(_rows_of_energy, height, width, field, labels, sums)
    return float(sums.sum())


@njit(nogil=True, cache=True)
def _rows_of_energy(first, last, field, labels, sums):
    height, width = labels.shape
    for row in range(first, last):
        total = 0.0
        for column in range(width):
            here = np.int64(labels[row, column])
            total += abs(field.target[row, column] - here * field.step)
            if row < height - 1:
                total += field.down[row, column] * differ(field.vertical, here - labels[row + 1, column])
            if column < width - 1:
                total += field.right[row, column] * differ(field.horizontal, here - labels[row, column + 1])
        sums[row] = total


@njit(nogil=True, cache=True)
def differ(cost, fallen):
    """The cost of an edge of weight 1 whose second label is lower than the first by ``fallen``."""
    return cost.fall * fallen if fallen >= 0 else cost.jump - cost.rise * fallen
