"""Min-sum along many chains at once: the arithmetic of a tile, the costs of every label in :data:`LANES` chains.

A tile has the shape (labels, LANES). Lanes are independent of each other, so the inner loops below are what the
compiler turns into vector instructions. It does so for loops over few arrays, since it compares each pair of them, and
over indices that it knows not to be below 0; hence one flat array for all that a message needs, and loops that count
upwards. All of a tile is computed in the precision of its messages.
"""

from __future__ import annotations

import numpy as np
from numba import njit

LANES = 32
UP, UP_JUMP, DOWN, DOWN_JUMP, LOWERED, LEAST, FIRST, WORK = range(0, 8 * LANES, LANES)
"""Where in a scratch array of the size WORK each quantity of the lanes begins."""


def costs_along(cost, dtype):
    """What a message pays from a first pixel to a second one: per label up, once when up, the same two down."""
    return np.array([cost.rise, cost.jump, cost.fall, 0], dtype)


def costs_against(cost, dtype):
    """The same from a second pixel to a first one."""
    return np.array([cost.fall, 0, cost.rise, cost.jump], dtype)


@njit(nogil=True, cache=True)
def weigh(costs, weight, work):
    """The costs of an edge, times its weight in each lane: what the next message pays."""
    up, up_jump, down, down_jump = costs[0], costs[1], costs[2], costs[3]
    for n in range(LANES):
        work[UP + n] = weight[n] * up
        work[UP_JUMP + n] = weight[n] * up_jump
        work[DOWN + n] = weight[n] * down
        work[DOWN_JUMP + n] = weight[n] * down_jump


@njit(nogil=True, cache=True)
def pass_on(unary, behind, work, message):
    """Message ``message[b] = min over a of held[a] + cost(a → b)``, in O(labels), with held = unary + behind.

    It is lowered by what label 0 held, which ``work[LOWERED]`` keeps.
    """
    for n in range(LANES):
        work[LOWERED + n] = unary[0, n] + behind[0, n]
        work[LEAST + n] = 0
        message[0, n] = 0
    for b in range(1, unary.shape[0]):
        for n in range(LANES):
            held = unary[b, n] + behind[b, n] - work[LOWERED + n]
            climbed = work[LEAST + n] + work[UP + n]
            message[b, n] = min(held, climbed + work[UP_JUMP + n])
            work[LEAST + n] = min(held, climbed)
    _scan_down(unary, behind, work, message)


@njit(nogil=True, cache=True)
def give_and_pass_on(unary, behind, share, work, message):
    """Take a share of the min-marginals from the costs, each lane less its value at 0, and pass on what is left.

    ``message`` holds the one from ahead, and then the one to it.
    """
    for n in range(LANES):
        work[LOWERED + n] = unary[0, n] + behind[0, n]
        work[FIRST + n] = work[LOWERED + n] + message[0, n]
        work[LEAST + n] = 0
        message[0, n] = 0
    for b in range(1, unary.shape[0]):
        for n in range(LANES):
            held = unary[b, n] + behind[b, n]
            given = share * (held + message[b, n] - work[FIRST + n])
            unary[b, n] -= given
            held -= given + work[LOWERED + n]
            climbed = work[LEAST + n] + work[UP + n]
            message[b, n] = min(held, climbed + work[UP_JUMP + n])
            work[LEAST + n] = min(held, climbed)
    _scan_down(unary, behind, work, message)


@njit(nogil=True, cache=True)
def _scan_down(unary, behind, work, message):
    top = unary.shape[0] - 1
    for n in range(LANES):
        work[LEAST + n] = unary[top, n] + behind[top, n] - work[LOWERED + n]
    for c in range(1, unary.shape[0]):
        b = top - c
        for n in range(LANES):
            held = unary[b, n] + behind[b, n] - work[LOWERED + n]
            fallen = work[LEAST + n] + work[DOWN + n]
            message[b, n] = min(message[b, n], fallen + work[DOWN_JUMP + n])
            work[LEAST + n] = min(held, fallen)


@njit(nogil=True, cache=True)
def collect(unary, weight, against, backwards, work, messages, least):
    """Messages to each position of a chain from all behind it, and the least cost of each lane's chain.

    Parameters
    ----------
    unary : (positions, labels, LANES) costs of the labels.
    weight : (positions, LANES) weight of the edge from each position to the next.
    against : costs from the position behind to the one before it, of :func:`weigh`.
    backwards : whether "behind" means lower positions rather than higher ones.
    work : (WORK,) scratch.
    messages : (positions, labels, LANES), written.
    least : (LANES,) float64, written.
    """
    positions, labels = unary.shape[0], unary.shape[1]
    step = 1 if backwards else -1
    here = 0 if backwards else positions - 1
    least[:] = 0
    messages[here] = 0
    for _ in range(1, positions):
        weigh(against, weight[here if backwards else here - 1], work)
        pass_on(unary[here], messages[here], work, messages[here + step])
        for n in range(LANES):
            least[n] += work[LOWERED + n]
        here += step
    for n in range(LANES):
        lowest = unary[here, 0, n] + messages[here, 0, n]
        for k in range(1, labels):
            lowest = min(lowest, unary[here, k, n] + messages[here, k, n])
        least[n] += lowest
