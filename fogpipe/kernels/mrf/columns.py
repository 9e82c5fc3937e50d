"""Exact columns: dynamic programming down each column, alone or with its neighbours held fixed."""

from __future__ import annotations

import numpy as np
from numba import njit

from fogpipe.kernels.bands import in_bands
from fogpipe.kernels.mrf.energy import Field, Solution, energy
from fogpipe.kernels.mrf.tiles import LANES, WORK, collect, costs_against


def columns(field: Field) -> Solution:
    """Least energy of every column without the edges between columns, which is a bound of the whole."""
    labels, bound = solve_columns(field, None)
    return Solution(labels, energy(field, labels), bound)


def solve_columns(field: Field, costs: np.ndarray | None) -> tuple[np.ndarray, float]:
    """Labels of each column of least cost on its own, and the sum of these costs.

    ``costs`` (blocks, rows, labels, LANES), of the field padded to whole squares, take the place of the data costs.
    """
    height, width = field.target.shape
    blocks = -(-width // LANES)
    costs = np.zeros((blocks, 0, field.labels, LANES), np.float32) if costs is None else costs
    labels = np.empty((height, width), np.uint8)
    least = np.empty(blocks)
    in_bands(_solve, blocks, height * LANES, field, costs_against(field.vertical, np.float64), costs, labels, least)
    return labels, float(least.sum())


def improve_columns(field: Field, labels: np.ndarray) -> None:
    """Give every second column its best labels next to what its neighbours have, then the others. In place.

    The energy never grows.
    """
    against = costs_against(field.vertical, np.float64)
    height, width = labels.shape
    for parity in range(min(2, width)):
        blocks = -(-((width - parity + 1) // 2) // LANES)
        in_bands(_improve, blocks, height * LANES, field, against, parity, labels)


def transposed(field: Field) -> Field:
    """The field with rows and columns exchanged."""
    return field._replace(
        target=np.ascontiguousarray(field.target.T),
        down=np.ascontiguousarray(field.right.T),
        right=np.ascontiguousarray(field.down.T),
        vertical=field.horizontal,
        horizontal=field.vertical,
    )


@njit(nogil=True, cache=True)
def _solve(first, last, field, against, costs, chosen, least):
    height, width = field.target.shape
    rows = max(height, costs.shape[1])
    unary = np.zeros((rows, field.labels, LANES))
    weight = np.zeros((rows, LANES))
    messages, work, cost = np.empty_like(unary), np.empty(WORK), np.empty(LANES)
    for block in range(first, last):
        left = block * LANES
        lanes = min(LANES, width - left)
        _load(field, left, 1, lanes, unary, weight)
        for row in range(costs.shape[1]):
            _convert(costs[block, row], unary[row])
        collect(unary, weight, against, False, work, messages, cost)
        least[block] = cost.sum()
        _choose(unary[:height], messages, weight, field.vertical, left, 1, lanes, chosen)


@njit(nogil=True, cache=True)
def _improve(first, last, field, against, parity, chosen):
    height, width = field.target.shape
    unary = np.empty((height, field.labels, LANES))
    weight = np.empty((height, LANES))
    messages, work, cost = np.empty_like(unary), np.empty(WORK), np.empty(LANES)
    beside = np.zeros((4, LANES))
    for block in range(first, last):
        left = parity + 2 * block * LANES
        lanes = min(LANES, (width - left + 1) // 2)
        _load(field, left, 2, lanes, unary, weight)
        for row in range(height):
            _neighbours(field, chosen[row], row, left, lanes, beside)
            _add_edges(beside, field.horizontal, unary[row])
        collect(unary, weight, against, False, work, messages, cost)
        _choose(unary, messages, weight, field.vertical, left, 2, lanes, chosen)


@njit(nogil=True, cache=True)
def _convert(costs, unary):
    for k in range(costs.shape[0]):
        for n in range(LANES):
            unary[k, n] = costs[k, n]


@njit(nogil=True, cache=True)
def _neighbours(field, chosen, row, left, lanes, beside):
    """Labels on the left, weights of the edges to them, and the same two on the right, for every second column."""
    width = len(chosen)
    for n in range(lanes):
        column = left + 2 * n
        if column > 0:
            beside[0, n], beside[1, n] = chosen[column - 1], field.right[row, column - 1]
        else:
            beside[1, n] = 0
        if column < width - 1:
            beside[2, n], beside[3, n] = chosen[column + 1], field.right[row, column]
        else:
            beside[3, n] = 0


@njit(nogil=True, cache=True)
def _add_edges(beside, cost, tile):
    before, weight_before, after, weight_after = beside[0], beside[1], beside[2], beside[3]
    for k in range(tile.shape[0]):
        for n in range(tile.shape[1]):
            fallen = before[n] - k
            tile[k, n] += weight_before[n] * (cost.fall * fallen if fallen >= 0 else cost.jump - cost.rise * fallen)
        for n in range(tile.shape[1]):
            fallen = k - after[n]
            tile[k, n] += weight_after[n] * (cost.fall * fallen if fallen >= 0 else cost.jump - cost.rise * fallen)


@njit(nogil=True, cache=True)
def _load(field, left, stride, lanes, unary, weight):
    """Data costs and weights of the columns ``left``, ``left + stride``…; lanes that are left over cost nothing."""
    height = field.target.shape[0]
    for row in range(height):
        for n in range(LANES):
            column = left + stride * n
            weight[row, n] = field.down[row, column] if n < lanes else 0
        for k in range(field.labels):
            value = k * field.step
            for n in range(lanes):
                unary[row, k, n] = abs(field.target[row, left + stride * n] - value)
            unary[row, k, lanes:] = 0


@njit(nogil=True, cache=True)
def _choose(unary, messages, weight, cost, left, stride, lanes, chosen):
    """Walk down from the first row, each pixel taking the label of least cost next to the one above it."""
    labels = unary.shape[1]
    above, best, best_cost = np.zeros(LANES), np.zeros(LANES), np.empty(LANES)
    for row in range(unary.shape[0]):
        best_cost[:] = np.inf
        for k in range(labels):
            for n in range(LANES):
                fallen = above[n] - k
                edge = cost.fall * fallen if fallen >= 0 else cost.jump - cost.rise * fallen
                total = unary[row, k, n] + messages[row, k, n] + (weight[row - 1, n] * edge if row > 0 else 0.0)
                if total < best_cost[n]:
                    best_cost[n] = total
                    best[n] = k
        for n in range(LANES):
            above[n] = best[n]
        for n in range(lanes):
            chosen[row, left + stride * n] = np.uint8(best[n])
