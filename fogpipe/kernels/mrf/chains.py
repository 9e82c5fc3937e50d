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

import numpy as np
from numba import njit

from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.mrf.columns import columns, improve_columns, solve_columns, transposed
from fogpipe.kernels.mrf.energy import Cost, Field, Solution, energy
from fogpipe.kernels.mrf.tiles import LANES, add, collect, copy, costs_against, costs_along, pass_on

SHARE_OF_COLUMNS, SHARE_OF_ROWS = 0.07, 0.2
"""Shares of the min-marginals that a pass hands over: the best of a coarse search on photographs at g = 0.5."""
MOMENTUM = 0.7
"""Share of the last change of the dual that is made once more before a pass, from the third on."""
FIRST_CHECK = 2


def chains(field: Field, target_gap: float, passes: int) -> Solution:
    """Labels and a bound that are at most ``target_gap`` apart, or the best of ``passes`` passes over all chains.

    Labels are made after 2, 8, 32… passes and after the last. They are never worse than one label everywhere.
    """
    height, width = field.target.shape
    if width == 1:
        return columns(field)
    if height == 1:
        found = columns(transposed(field))
        return found._replace(labels=found.labels.T)
    ascent = Ascent(field)
    best = _constant(field)
    check = FIRST_CHECK
    for count in range(1, passes + 1):
        ascent.step(backwards=count % 2 == 0, momentum=MOMENTUM if count > FIRST_CHECK else 0.0)
        if count in (check, passes):
            check *= 4
            best = _better(field, *dual_bound(field, ascent.dual), best)
            if best.gap <= target_gap:
                return best
    return _improved(field, best)


def _constant(field: Field) -> Solution:
    """The same label everywhere: the one nearest to the median, which is the point of least absolute distance."""
    nearest = round(float(np.median(field.target)) / field.step)
    labels = np.full(field.target.shape, min(max(nearest, 0), field.labels - 1), np.uint8)
    return Solution(labels, energy(field, labels), 0.0)


def _better(field: Field, labels: np.ndarray, bound: float, best: Solution) -> Solution:
    found = Solution(labels, energy(field, labels), max(bound, best.bound))
    return found if found.energy < best.energy else best._replace(bound=found.bound)


def _improved(field: Field, best: Solution) -> Solution:
    """Columns beside their neighbours, then rows, then columns again, each exactly."""
    labels, across = best.labels, transposed(field)
    improve_columns(field, labels)
    labels = np.ascontiguousarray(labels.T)
    improve_columns(across, labels)
    labels = np.ascontiguousarray(labels.T)
    improve_columns(field, labels)
    return Solution(labels, energy(field, labels), best.bound)


class Ascent:
    """The dual, and the passes that raise its bound.

    The field is padded to whole squares of LANES × LANES with pixels that want 0 and are joined to nothing, which
    cost nothing. The dual has the shape (bands, blocks, labels, LANES, LANES): by squares of pixels, so that
    rows and columns of them are equally near in memory.
    """

    def __init__(self, field: Field) -> None:
        self.field = field
        self._target, self._down, self._right = (
            padded(map_, LANES) for map_ in (field.target, field.down, field.right)
        )
        height, width = self._target.shape
        shape = (height // LANES, width // LANES, field.labels, LANES, LANES)
        self.dual = np.zeros(shape, self._target.dtype)
        self._before = np.zeros_like(self.dual)
        self._values = (np.arange(field.labels) * field.step).astype(self.dual.dtype)

    def step(self, backwards: bool, momentum: float) -> None:
        """One pass over the columns and one over the rows."""
        bands, blocks = self.dual.shape[:2]
        costs = self._costs(self.field.vertical, backwards)
        settings = np.array([SHARE_OF_COLUMNS, momentum], self.dual.dtype)
        maps = self._target, self._values, self._down
        size = bands * LANES**2
        in_bands(_columns_pass, blocks, size, self.dual, self._before, *maps, *costs, settings, backwards)
        costs = self._costs(self.field.horizontal, backwards)
        settings = np.array([SHARE_OF_ROWS], self.dual.dtype)
        in_bands(_rows_pass, bands, blocks * LANES**2, self.dual, self._right, *costs, settings, backwards)

    def _costs(self, cost: Cost, backwards: bool) -> tuple[np.ndarray, np.ndarray]:
        along, against = costs_along(cost, self.dual.dtype), costs_against(cost, self.dual.dtype)
        return (against, along) if backwards else (along, against)


def dual_bound(field: Field, dual: np.ndarray) -> tuple[np.ndarray, float]:
    """Best labels of each column under a dual, and the bound that it proves, both in float64."""
    bands, blocks = dual.shape[:2]
    labels, bound = solve_columns(field, dual)
    least = np.empty(bands)
    against = costs_against(field.horizontal, np.float64)
    in_bands(_rows_bound, bands, blocks * LANES**2, dual, padded(field.right, LANES), against, least)
    return labels, bound + float(least.sum())


def padded(array: np.ndarray, multiple: int) -> np.ndarray:
    """The array with zeros below and on the right, so that its height and width are whole multiples."""
    height, width = array.shape[:2]
    return np.pad(array, ((0, -height % multiple), (0, -width % multiple), *[(0, 0)] * (array.ndim - 2)))


@njit(nogil=True, cache=True)
def _hand_over(unary, weight, along, against, share, backwards, work, messages, least):
    """Replace the costs of the chains by what each pixel gives away of them."""
    collect(unary, weight, against, backwards, work, messages, least)
    positions, labels = unary.shape[0], unary.shape[1]
    held, ahead = work[4 : 4 + labels], work[4 + labels :]
    ahead[:] = 0
    here = positions - 1 if backwards else 0
    for count in range(positions):
        add(unary[here], ahead, held)
        add(held, messages[here], messages[here])  # the min-marginals
        _split(held, messages[here], share, unary[here])
        if count < positions - 1:
            after = here - 1 if backwards else here + 1
            pass_on(held, weight[after if backwards else here], along, work, ahead)
            here = after


@njit(nogil=True, cache=True)
def _split(held, marginal, share, given):
    """Give a share of the min-marginals away, each lane less its value at 0."""
    for k in range(held.shape[0]):
        for n in range(held.shape[1]):
            given[k, n] = share * (marginal[k, n] - marginal[0, n])
    for k in range(held.shape[0]):
        for n in range(held.shape[1]):
            held[k, n] -= given[k, n]


@njit(nogil=True, cache=True)
def _columns_pass(first, last, dual, before, target, values, down, along, against, settings, backwards):
    bands, _, labels, _, _ = dual.shape
    unary, weight = np.empty((bands * LANES, labels, LANES), dual.dtype), np.empty((bands * LANES, LANES), dual.dtype)
    messages, work, least = np.empty_like(unary), np.empty((4 + 2 * labels, LANES), dual.dtype), np.empty(LANES)
    for block in range(first, last):
        columns = slice(block * LANES, (block + 1) * LANES)
        for row in range(bands * LANES):
            copy(down[row, columns], weight[row])
        for band in range(bands):
            rows = slice(band * LANES, (band + 1) * LANES)
            _extrapolate(dual[band, block], before[band, block], settings[1])
            _columns_in(dual[band, block], target[rows, columns], values, unary[rows])
        _hand_over(unary, weight, along, against, settings[0], backwards, work, messages, least)
        for band in range(bands):
            _columns_out(unary[band * LANES : (band + 1) * LANES], dual[band, block])


@njit(nogil=True, cache=True)
def _extrapolate(dual, before, momentum):
    for k in range(dual.shape[0]):
        for row in range(LANES):
            for n in range(LANES):
                now = dual[k, row, n]
                dual[k, row, n] += momentum * (now - before[k, row, n])
                before[k, row, n] = now


@njit(nogil=True, cache=True)
def _columns_in(dual, target, values, unary):
    """Costs of the columns, data and λ, with the columns as lanes."""
    for k in range(dual.shape[0]):
        for row in range(LANES):
            for n in range(LANES):
                unary[row, k, n] = abs(target[row, n] - values[k]) + dual[k, row, n]


@njit(nogil=True, cache=True)
def _columns_out(given, dual):
    for k in range(dual.shape[0]):
        for row in range(LANES):
            for n in range(LANES):
                dual[k, row, n] -= given[row, k, n]


@njit(nogil=True, cache=True)
def _rows_pass(first, last, dual, right, along, against, settings, backwards):
    _, blocks, labels, _, _ = dual.shape
    unary, weight = np.empty((blocks * LANES, labels, LANES), dual.dtype), np.empty((blocks * LANES, LANES), dual.dtype)
    messages, work, least = np.empty_like(unary), np.empty((4 + 2 * labels, LANES), dual.dtype), np.empty(LANES)
    square = np.empty((LANES, LANES + 1), dual.dtype)
    for band in range(first, last):
        _weights_of_rows(right, band * LANES, weight)
        for block in range(blocks):
            _rows_in(dual[band, block], square, unary[block * LANES : (block + 1) * LANES])
        _hand_over(unary, weight, along, against, settings[0], backwards, work, messages, least)
        for block in range(blocks):
            _rows_out(unary[block * LANES : (block + 1) * LANES], square, dual[band, block])


# Both go through a small square whose rows do not start a power of two apart, which caches cannot hold together.
@njit(nogil=True, cache=True)
def _rows_in(dual, square, unary):
    """Costs of the rows, −λ, with the rows as lanes."""
    for k in range(dual.shape[0]):
        for row in range(LANES):
            for n in range(LANES):
                square[n, row] = -dual[k, row, n]
        for n in range(LANES):
            for row in range(square.shape[0]):
                unary[n, k, row] = square[n, row]


@njit(nogil=True, cache=True)
def _rows_out(given, square, dual):
    for k in range(dual.shape[0]):
        for n in range(LANES):
            for row in range(square.shape[0]):
                square[n, row] = given[n, k, row]
        for row in range(LANES):
            for n in range(LANES):
                dual[k, row, n] += square[n, row]


@njit(nogil=True, cache=True)
def _weights_of_rows(right, top, weight):
    for n in range(LANES):
        for column in range(weight.shape[0]):
            weight[column, n] = right[top + n, column]


@njit(nogil=True, cache=True)
def _rows_bound(first, last, dual, right, against, bound):
    _, blocks, labels, _, _ = dual.shape
    unary, weight = np.empty((blocks * LANES, labels, LANES)), np.empty((blocks * LANES, LANES))
    messages, work, least = np.empty_like(unary), np.empty((4 + labels, LANES)), np.empty(LANES)
    square = np.empty((LANES, LANES + 1))
    for band in range(first, last):
        _weights_of_rows(right, band * LANES, weight)
        for block in range(blocks):
            _rows_in(dual[band, block], square, unary[block * LANES : (block + 1) * LANES])
        collect(unary, weight, against, False, work, messages, least)
        bound[band] = least.sum()
