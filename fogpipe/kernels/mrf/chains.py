"""Dual ascent over column and row chains (default).

The energy is split into one part for the columns, with the data costs and the vertical edges, and one for the rows,
with the horizontal edges. A *dual* cost λ(pixel, label) is added to the one and taken from the other, which leaves
their sum as it is. The least energy of each chain follows exactly from one min-sum pass, and for every λ

    Σ least energy of the columns + Σ least energy of the rows  ≤  least energy.

A pass walks along all chains of one kind and hands a share of each min-marginal (what a label costs at least, whatever
its neighbours do) over to the chain that crosses there. This keeps the least energy of its own chain and
can only raise that of the other, so the bound never falls (Shekhovtsov et al. 2016, dual minorise-maximise). Labels
come from exact columns under the dual, improved by exact columns beside fixed neighbours.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.mrf.columns import columns, improve_columns, solve_columns, transposed
from fogpipe.kernels.mrf.energy import Cost, Field, Solution, energy
from fogpipe.kernels.mrf.tiles import LANES, WORK, collect, costs_against, costs_along, give_and_pass_on, weigh

SHARE_OF_COLUMNS, SHARE_OF_ROWS = 0.07, 0.2
"""Shares of the min-marginals that a pass hands over: the best of a coarse search on photographs at g = 0.5."""
MOMENTUM = 0.7
"""Share of the last change of the dual that is made once more before a pass, from the third on."""
LEFT_BY_A_PASS = 0.65
"""Share of the gap that a good pass leaves. Labels cost as much as a pass: they wait until the gap may be reached."""


def chains(field: Field, target_gap: float, passes: int) -> Solution:
    """Labels and a bound that are at most ``target_gap`` apart, or the best of ``passes`` passes over all chains.

    Labels are made after the first pass, whenever the target may be reached, and after the last. They are never worse
    than one label everywhere.
    """
    height, width = field.target.shape
    if width == 1:
        return columns(field)
    if height == 1:
        found = columns(transposed(field))
        return found._replace(labels=found.labels.T)
    ascent = Ascent(field)
    best = _constant(field)
    check = 1.0
    for count in range(1, passes + 1):
        ascent.step(backwards=count % 2 == 0, momentum=MOMENTUM if count > 2 else 0.0)
        if count in (check, passes):
            best = _better(field, *dual_bound(field, ascent.costs), best)
            if best.gap <= target_gap:
                return best
            check = count + max(_passes_to(target_gap, best.gap), math.ceil(count / 4))
    return _improved(field, best)


def _constant(field: Field) -> Solution:
    """The same label everywhere: the one nearest to the median, which is the point of least absolute distance."""
    nearest = round(float(np.median(field.target)) / field.step)
    labels = np.full(field.target.shape, min(max(nearest, 0), field.labels - 1), np.uint8)
    return Solution(labels, energy(field, labels), 0.0)


def _better(field: Field, labels: np.ndarray, bound: float, best: Solution) -> Solution:
    """The best labels so far or these, each column of which is solved again beside its neighbours."""
    improve_columns(field, labels)
    found = Solution(labels, energy(field, labels), max(bound, best.bound))
    return found if found.energy < best.energy else best._replace(bound=found.bound)


def _passes_to(target_gap: float, gap: float) -> float:
    """How many good passes take the gap to the target."""
    return math.ceil(math.log(target_gap / gap) / math.log(LEFT_BY_A_PASS)) if target_gap > 0 else math.inf


def _improved(field: Field, best: Solution) -> Solution:
    """Rows beside their neighbours, then columns, each exactly."""
    labels = np.ascontiguousarray(best.labels.T)
    improve_columns(transposed(field), labels)
    labels = np.ascontiguousarray(labels.T)
    improve_columns(field, labels)
    return Solution(labels, energy(field, labels), best.bound)


class Ascent:
    """The costs that the columns have, the rest of which the rows have, and the passes that raise the bound.

    The field is padded to whole squares of LANES × LANES with pixels that want 0 and are joined to nothing, which
    cost nothing. ``costs`` (blocks, rows, labels, LANES), data plus λ, are held in blocks of so many columns, in
    which the columns lie side by side as the lanes of a tile.
    """

    def __init__(self, field: Field) -> None:
        self.field = field
        self._target, self._down, self._right = (
            padded(map_, LANES) for map_ in (field.target, field.down, field.right)
        )
        height, width = self._target.shape
        self._values = (np.arange(field.labels) * field.step).astype(self._target.dtype)
        self.costs = np.empty((width // LANES, height, field.labels, LANES), self._target.dtype)
        in_bands(_data_costs, width // LANES, height * LANES, self._target, self._values, self.costs)
        self._before = np.zeros(self.costs.shape, self.costs.dtype)

    def step(self, backwards: bool, momentum: float) -> None:
        """One pass over the columns and one over the rows."""
        height, width = self._target.shape
        costs = self._edges(self.field.vertical, backwards)
        settings = np.array([SHARE_OF_COLUMNS, momentum], self.costs.dtype)
        size = height * LANES
        in_bands(_columns_pass, width // LANES, size, self.costs, self._before, self._down, *costs, settings, backwards)
        costs = self._edges(self.field.horizontal, backwards)
        maps = self._target, self._values, self._right
        share = self.costs.dtype.type(SHARE_OF_ROWS)
        in_bands(_rows_pass, height // LANES, width * LANES, self.costs, *maps, *costs, share, backwards)

    def _edges(self, cost: Cost, backwards: bool) -> tuple[np.ndarray, np.ndarray]:
        along, against = costs_along(cost, self.costs.dtype), costs_against(cost, self.costs.dtype)
        return (against, along) if backwards else (along, against)


def dual_bound(field: Field, costs: np.ndarray) -> tuple[np.ndarray, float]:
    """Best labels of each column with the costs that it has, and the bound that they prove, both in float64."""
    labels, bound = solve_columns(field, costs)
    target, right = padded(field.target, LANES), padded(field.right, LANES)
    least = np.empty(len(target) // LANES)
    values = np.arange(field.labels) * field.step
    maps = target, values, right
    against = costs_against(field.horizontal, np.float64)
    in_bands(_rows_bound, len(least), target.shape[1] * LANES, costs, *maps, against, least)
    return labels, bound + float(least.sum())


def padded(array: np.ndarray, multiple: int) -> np.ndarray:
    """The array with zeros below and on the right, so that its height and width are whole multiples."""
    height, width = array.shape[:2]
    return np.pad(array, ((0, -height % multiple), (0, -width % multiple), *[(0, 0)] * (array.ndim - 2)))


@njit(nogil=True, cache=True)
def _data_costs(first, last, target, values, costs):
    for block in range(first, last):
        for row in range(costs.shape[1]):
            for k in range(costs.shape[2]):
                for n in range(LANES):
                    costs[block, row, k, n] = abs(target[row, block * LANES + n] - values[k])


@njit(nogil=True, cache=True)
def _hand_over(unary, weight, along, against, share, backwards, work, messages, least):
    """Take what the chains give away from their costs."""
    collect(unary, weight, against, backwards, work, messages, least)
    positions = unary.shape[0]
    step = -1 if backwards else 1
    here = positions - 1 if backwards else 0
    behind = np.zeros_like(unary[0])
    for _ in range(positions):
        weigh(along, weight[here - 1 if backwards else here], work)  # of the last position, which has no edge, any
        give_and_pass_on(unary[here], behind, share, work, messages[here])
        behind = messages[here]
        here += step


@njit(nogil=True, cache=True)
def _columns_pass(first, last, costs, before, down, along, against, settings, backwards):
    _, rows, labels, _ = costs.shape
    messages, weight = np.empty((rows, labels, LANES), costs.dtype), np.empty((rows, LANES), costs.dtype)
    work, least = np.empty(WORK, costs.dtype), np.empty(LANES)
    for block in range(first, last):
        for row in range(rows):
            for n in range(LANES):
                weight[row, n] = down[row, block * LANES + n]
            _extrapolate(costs[block, row], before[block, row], settings[1])
        _hand_over(costs[block], weight, along, against, settings[0], backwards, work, messages, least)


@njit(nogil=True, cache=True)
def _extrapolate(costs, before, momentum):
    for k in range(costs.shape[0]):
        for n in range(LANES):
            now = costs[k, n]
            costs[k, n] += momentum * (now - before[k, n])
            before[k, n] = now


@njit(nogil=True, cache=True)
def _rows_pass(first, last, costs, target, values, right, along, against, share, backwards):
    blocks, _, labels, _ = costs.shape
    unary = np.empty((blocks * LANES, labels, LANES), costs.dtype)
    messages, weight = np.empty_like(unary), np.empty((blocks * LANES, LANES), costs.dtype)
    work, least, squares = np.empty(WORK, costs.dtype), np.empty(LANES), _squares(labels, costs.dtype)
    for band in range(first, last):
        rows = slice(band * LANES, (band + 1) * LANES)
        _weights_of_rows(right[rows], weight)
        for block in range(blocks):
            here = slice(block * LANES, (block + 1) * LANES)
            _rows_in(costs[block, rows], target[rows, here], values, squares, unary[here])
        _hand_over(unary, weight, along, against, share, backwards, work, messages, least)
        for block in range(blocks):
            here = slice(block * LANES, (block + 1) * LANES)
            _rows_out(unary[here], target[rows, here], values, squares, costs[block, rows])


@njit(nogil=True, cache=True)
def _squares(labels, dtype):
    """Scratch to transpose squares in. Caches cannot hold rows together that start a power of two apart."""
    return np.empty((labels, LANES, LANES + 1), dtype)


@njit(nogil=True, cache=True)
def _rows_in(costs, target, values, squares, unary):
    """Costs of the rows, data less those of the columns, with the rows as lanes."""
    for row in range(LANES):
        for k in range(costs.shape[1]):
            value = values[k]
            for n in range(LANES):
                squares[k, row, n] = abs(target[row, n] - value) - costs[row, k, n]
    for k in range(costs.shape[1]):
        for n in range(LANES):
            for row in range(LANES):
                unary[n, k, row] = squares[k, row, n]


@njit(nogil=True, cache=True)
def _rows_out(unary, target, values, squares, costs):
    for k in range(costs.shape[1]):
        for n in range(LANES):
            for row in range(LANES):
                squares[k, row, n] = unary[n, k, row]
    for row in range(LANES):
        for k in range(costs.shape[1]):
            value = values[k]
            for n in range(LANES):
                costs[row, k, n] = abs(target[row, n] - value) - squares[k, row, n]


@njit(nogil=True, cache=True)
def _weights_of_rows(right, weight):
    for n in range(LANES):
        for column in range(weight.shape[0]):
            weight[column, n] = right[n, column]


@njit(nogil=True, cache=True)
def _rows_bound(first, last, costs, target, values, right, against, bound):
    blocks, _, labels, _ = costs.shape
    unary, weight = np.empty((blocks * LANES, labels, LANES)), np.empty((blocks * LANES, LANES))
    messages, work, least = np.empty_like(unary), np.empty(WORK), np.empty(LANES)
    squares = _squares(labels, np.float64)
    for band in range(first, last):
        rows = slice(band * LANES, (band + 1) * LANES)
        _weights_of_rows(right[rows], weight)
        for block in range(blocks):
            here = slice(block * LANES, (block + 1) * LANES)
            _rows_in(costs[block, rows], target[rows, here], values, squares, unary[here])
        collect(unary, weight, against, False, work, messages, least)
        bound[band] = least.sum()
