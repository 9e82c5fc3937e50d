"""Min-sum along many chains at once: the arithmetic of a tile, the costs of every label in :data:`LANES` chains.

A tile has the shape (labels, LANES). Lanes are independent of each other, so the inner loops below are what the
compiler turns into vector instructions; that is why they are as plain as they are. All of a tile is computed
in the precision of its array.
"""

from __future__ import annotations

import numpy as np
from numba import njit

LANES = 32


def costs_along(cost, dtype):
    """What a message pays from a first pixel to a second one: per label up, once when up, the same two down."""
    return np.array([cost.rise, cost.jump, cost.fall, 0], dtype)


def costs_against(cost, dtype):
    """The same from a second pixel to a first one."""
    return np.array([cost.fall, 0, cost.rise, cost.jump], dtype)


@njit(nogil=True, cache=True)
def copy(source, target):
    """``target = source`` for rows; assigning slices would compile numba's messages about their shapes, for seconds."""
    for n in range(len(target)):
        target[n] = source[n]


@njit(nogil=True, cache=True)
def add(one, other, total):
    """``total = one + other`` for tiles."""
    for k in range(one.shape[0]):
        for n in range(one.shape[1]):
            total[k, n] = one[k, n] + other[k, n]


@njit(nogil=True, cache=True)
def lowest(tile, least):
    """The smallest cost of each lane."""
    copy(tile[0], least)
    for k in range(1, tile.shape[0]):
        for n in range(tile.shape[1]):
            least[n] = min(least[n], tile[k, n])


@njit(nogil=True, cache=True)
def pass_on(held, weight, costs, work, message):
    """Message ``message[b] = min over a of held[a] + weight · cost(a → b)``, in O(labels), lowered by its value at 0.

    ``work`` is a scratch tile of four rows; its last row is what the message was lowered by.
    """
    slope, jump, least, taken = work[0], work[1], work[2], work[3]
    for n in range(LANES):
        slope[n] = weight[n] * costs[0]
        jump[n] = weight[n] * costs[1]
    copy(held[0], message[0])
    copy(held[0], least)
    _scan_up(held, least, slope, jump, message)
    for n in range(LANES):
        slope[n] = weight[n] * costs[2]
        jump[n] = weight[n] * costs[3]
    copy(held[held.shape[0] - 1], least)
    _scan_down(held, least, slope, jump, message)
    copy(message[0], taken)
    _lower(message, taken)


@njit(nogil=True, cache=True)
def _scan_up(held, least, slope, jump, message):
    for b in range(1, held.shape[0]):
        for n in range(LANES):
            climbed = least[n] + slope[n]
            here = held[b, n]
            message[b, n] = min(here, climbed + jump[n])
            least[n] = min(here, climbed)


@njit(nogil=True, cache=True)
def _scan_down(held, least, slope, jump, message):
    labels = held.shape[0]
    for c in range(1, labels):
        b = labels - 1 - c
        for n in range(LANES):
            fallen = least[n] + slope[n]
            here = held[b, n]
            message[b, n] = min(message[b, n], fallen + jump[n])
            least[n] = min(here, fallen)


@njit(nogil=True, cache=True)
def _lower(tile, taken):
    for k in range(tile.shape[0]):
        for n in range(tile.shape[1]):
            tile[k, n] -= taken[n]


@njit(nogil=True, cache=True)
def collect(unary, weight, against, backwards, work, messages, least):
    """Messages to each position of a chain from all behind it, and the least cost of each lane's chain.

    Parameters
    ----------
    unary : (positions, labels, LANES) costs of the labels.
    weight : (positions, LANES) weight of the edge from each position to the next.
    against : costs from the position behind to the one before it, of :func:`pass_on`.
    backwards : whether "behind" means lower positions rather than higher ones.
    work : (4 + labels, LANES) scratch.
    messages : (positions, labels, LANES), written.
    least : (LANES,) float64, written.
    """
    positions = unary.shape[0]
    held = work[4 : 4 + unary.shape[1]]
    least[:] = 0
    here = 0 if backwards else positions - 1
    messages[here] = 0
    for _ in range(1, positions):
        before = here + 1 if backwards else here - 1
        add(unary[here], messages[here], held)
        pass_on(held, weight[here if backwards else before], against, work, messages[before])
        for n in range(LANES):
            least[n] += work[3, n]
        here = before
    add(unary[here], messages[here], held)
    lowest(held, work[0])
    for n in range(LANES):
        least[n] += work[0, n]
