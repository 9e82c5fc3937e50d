"""An expansion is the best of all labellings that it may choose from, tried one by one."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from fogpipe.kernels.mrf import Cost, Field, energy
from fogpipe.stages.haziness import mrf
from fogpipe.testing import check_stage

from fogpipe_graphcut.expansion import expand, expand_all, expansion

ROUNDING = 1e-9
"""Sums of some tens of float64 numbers of at most 1e5 are right to this share."""


def random_field(seed: int, labels: int = 4) -> Field:
    """A field of 3 × 3 pixels with any of the costs, some edges absent, ordered on rows or not."""
    rng = np.random.default_rng(seed)
    g, s = rng.choice([0.0, 0.01, 2.0, 200.0]), rng.choice([0.0, 1.0, 100.0])
    down, right = rng.choice([0.0, 1.0, 15.0], (2, 3, 3))
    down[-1], right[:, -1] = 0, 0
    ordered = Cost(float(g), 0.0, float(s))
    even = ordered if seed % 2 else Cost(float(g), float(g), 0.0)
    return Field(rng.uniform(0, 255, (3, 3)), down, right, 255 / (labels - 1), labels, ordered, even)


def test_it_keeps_the_promises_of_a_stage():
    check_stage(expansion)


@pytest.mark.parametrize("seed", range(12))
def test_an_expansion_is_optimal(seed: int):
    field = random_field(seed)
    labels = np.random.default_rng(seed + 100).integers(0, field.labels, (3, 3)).astype(np.uint8)
    for alpha in range(field.labels):
        choices = (np.reshape(takes, (3, 3)) for takes in itertools.product((False, True), repeat=9))
        least = min(energy(field, np.where(takes, np.uint8(alpha), labels)) for takes in choices)
        assert energy(field, expand(field, labels, alpha)) == pytest.approx(least, rel=ROUNDING)


@pytest.mark.parametrize("seed", range(6))
def test_no_expansion_improves_what_comes_out_and_the_bound_holds(seed: int):
    field = random_field(seed, labels=2)
    found = expand_all(field, 20)
    least = min(energy(field, np.array(x, np.uint8).reshape(3, 3)) for x in itertools.product(range(2), repeat=9))
    # Two labels: one expansion of each decides between all labellings that lie above and below the present one.
    assert found.bound <= least * (1 + ROUNDING)
    for alpha in range(2):
        assert energy(field, expand(field, found.labels, alpha)) >= found.energy * (1 - ROUNDING)


def test_it_ends_within_the_certified_gap_of_the_default_solver():
    image = np.random.default_rng(5).random((24, 20, 3))
    cut, chains = expansion(image, smoothness=0.5), mrf(image, smoothness=0.5, passes=64)
    assert chains.bound <= cut.energy
    # A local minimum of all expansions; measured 0.3 % above the default on this noise.
    assert cut.energy <= 1.02 * chains.energy


def test_a_small_g_is_not_rounded_away():
    target = np.full((5, 6), 127.5)
    target[2, 3] = 255
    down, right = np.ones((2, 5, 6))
    down[-1], right[:, -1] = 0, 0
    field = Field(target, down, right, 255.0, 2, Cost(1e-6, 0.0, 1e-6), Cost(1e-6, 1e-6, 0.0))
    assert (expand(field, np.zeros((5, 6), np.uint8), 1) == 1).all()
