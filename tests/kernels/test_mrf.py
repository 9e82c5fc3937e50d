"""Every solver is held against all labellings of tiny grids, and the default against itself on one and two threads."""

from __future__ import annotations

import importlib
import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fogpipe.kernels import bands
from fogpipe.kernels.mrf import SOLVERS, Cost, Field, energy
from fogpipe.kernels.mrf.chains import chains
from fogpipe.kernels.mrf.columns import improve_columns

ROOT = Path(__file__).resolve().parents[2]
ROUNDING = 1e-9
"""Sums of a few hundred float64 numbers of at most 1e5 are right to this share of the largest."""


def field(
    target: np.ndarray, labels: int = 3, g: float = 0.5, s: float = 100.0, edges: tuple[float, float] = (1.0, 1.0)
) -> Field:
    """A field in grey levels with the order on its vertical edges."""
    down, right = np.full_like(target, edges[0]), np.full_like(target, edges[1])
    down[-1], right[:, -1] = 0, 0
    return Field(target, down, right, 255 / max(1, labels - 1), labels, Cost(g, 0.0, s), Cost(g, g, 0.0))


def least_energy(tiny: Field) -> float:
    """The least energy of all labellings, written from the definition rather than with the kernels."""
    height, width = tiny.target.shape
    best = np.inf
    for chosen in itertools.product(range(tiny.labels), repeat=height * width):
        x = np.array(chosen).reshape(height, width)
        total = float(np.abs(tiny.target - x * tiny.step).sum())
        for row, column in itertools.product(range(height), range(width)):
            if row + 1 < height:
                total += tiny.down[row, column] * pair(tiny.vertical, x[row, column], x[row + 1, column])
            if column + 1 < width:
                total += tiny.right[row, column] * pair(tiny.horizontal, x[row, column], x[row, column + 1])
        best = min(best, total)
    return best


def pair(cost: Cost, first: int, second: int) -> float:
    return cost.jump + cost.rise * (second - first) if first < second else cost.fall * (first - second)


@st.composite
def tiny_fields(draw: st.DrawFn) -> Field:
    height, width = draw(st.sampled_from([(1, 1), (1, 6), (6, 1), (2, 3), (3, 2), (2, 2)]))
    labels = draw(st.integers(1, 3))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    g, s = draw(st.sampled_from([0.0, 0.01, 0.5, 2.0, 200.0])), draw(st.sampled_from([0.0, 1.0, 100.0]))
    made = field(rng.uniform(0, 255, (height, width)), labels, g, s)
    down, right = rng.choice([0.0, 1.0, 15.0], (2, height, width))
    down[-1], right[:, -1] = 0, 0
    made = made._replace(down=down, right=right)
    return made._replace(horizontal=made.vertical) if draw(st.booleans()) else made


@pytest.mark.parametrize("solver", SOLVERS)
@settings(max_examples=40)
@given(tiny=tiny_fields())
def test_the_least_energy_lies_between_bound_and_energy(solver: str, tiny: Field):
    found = SOLVERS[solver](tiny, 1e-6, 20)
    least = least_energy(tiny)
    assert found.labels.max() < tiny.labels
    assert found.energy == pytest.approx(energy(tiny, found.labels), rel=ROUNDING)
    assert found.bound <= least * (1 + ROUNDING) + ROUNDING
    assert least <= found.energy * (1 + ROUNDING) + ROUNDING


@settings(max_examples=40)
@given(tiny=tiny_fields(), seed=st.integers(0, 2**32 - 1))
def test_exact_columns_beside_fixed_neighbours_never_raise_the_energy(tiny: Field, seed: int):
    labels = np.random.default_rng(seed).integers(0, tiny.labels, tiny.target.shape).astype(np.uint8)
    before = energy(tiny, labels)
    improve_columns(tiny, labels)
    assert energy(tiny, labels) <= before * (1 + ROUNDING) + ROUNDING


@pytest.mark.parametrize("solver", ["chains", "columns", "trws"])
@pytest.mark.parametrize("s", [0.0, 1.0, 100.0])
def test_a_single_chain_is_solved_exactly(solver: str, s: float):
    column = np.random.default_rng(1).uniform(0, 255, (40, 1))
    found = SOLVERS[solver](field(column, 32, 0.5, s), 1e-9, 8)
    assert found.gap < ROUNDING


@pytest.mark.parametrize("solver", SOLVERS)
def test_what_joins_nothing_is_rounded_to_the_nearest_label(solver: str):
    target = np.random.default_rng(2).uniform(-20, 280, (9, 40))
    found = SOLVERS[solver](field(target, 32, edges=(0, 0)), 1e-6, 4)
    np.testing.assert_array_equal(found.labels, np.clip(np.rint(target / (255 / 31)), 0, 31))
    assert found.gap < ROUNDING


def test_the_bound_of_chains_closes_in_on_the_energy_with_more_passes():
    noise = np.random.default_rng(3).uniform(0, 255, (64, 64))
    gaps = [chains(field(noise, 8, 2.0), 0.0, passes).gap for passes in (1, 8, 128)]
    assert gaps[0] > gaps[1] > gaps[2]
    assert gaps[2] < 0.02  # measured 0.4 %


def test_chains_stop_soon_after_the_gap_is_reached(monkeypatch: pytest.MonkeyPatch):
    module = importlib.import_module("fogpipe.kernels.mrf.chains")
    made = {"passes": 0, "labels": 0}

    def counted(name: str, function):
        def call(*arguments, **named):
            made[name] += 1
            return function(*arguments, **named)

        return call

    monkeypatch.setattr(module.Ascent, "step", counted("passes", module.Ascent.step))
    monkeypatch.setattr(module, "dual_bound", counted("labels", module.dual_bound))
    noise = field(np.random.default_rng(3).uniform(0, 255, (64, 64)), 8, 0.5)
    gaps = [module.chains(noise, 0.0, count).gap for count in range(1, 25)]
    for target in (gaps[0], 0.03, 0.01):
        made.update(passes=0, labels=0)
        assert module.chains(noise, target, 64).gap <= target
        needed = next(count for count, gap in enumerate(gaps, 1) if gap <= target)
        # Labels wait for a quarter of the passes done, or as if each took a third of the gap.
        assert made["passes"] <= max(1.25 * needed + 1, 3)
        assert made["labels"] <= 1 + made["passes"] / 2


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_same_bytes_for_one_and_for_two_threads(solver: str, dtype: type, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(bands, "MIN_PIXELS_PER_BAND", 64)
    noisy = field(np.random.default_rng(4).uniform(0, 255, (70, 90)).astype(dtype), 16)
    kept = bands.threads()
    try:
        several = []
        for count in (1, 2, 3):
            bands.set_threads(count)
            several.append(SOLVERS[solver](noisy, 1e-4, 6))
    finally:
        bands.set_threads(kept)
    for other in several[1:]:
        assert other.labels.tobytes() == several[0].labels.tobytes()
        assert (other.energy, other.bound) == (several[0].energy, several[0].bound)


@pytest.mark.parametrize(("dtype", "g"), [(np.float32, 1e-3), (np.float64, 1e-9)])
def test_a_tiny_smoothness_still_breaks_ties(dtype: type, g: float):
    # Both labels are equally far from the data, so the smallest g decides; solvers in whole numbers round it to 0.
    target = np.full((6, 5), 127.5, dtype)
    target[2, 2] = 255
    found = chains(field(target, 2, g, g), 1e-15, 8)
    assert (found.labels == 1).all()
    assert found.energy == 127.5 * (target.size - 1)


MEMORY = """
import numpy as np
from fogpipe.runtime.record import peak_memory
from tests.kernels.test_mrf import chains, field

def peak(height):
    chains(field(np.random.default_rng(1).uniform(0, 255, (height, 640)).astype(np.float32), 32), 0.0, 3)
    return peak_memory()

least = peak(32)
print(peak(480) - least, peak(960) - least)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the system does not tell the peak")
def test_memory_is_linear_in_pixels_and_below_130_mb_for_640_by_480():
    done = subprocess.run([sys.executable, "-c", MEMORY], cwd=ROOT, capture_output=True, text=True, check=True)
    at_480, at_960 = map(int, done.stdout.split())
    # The dual and its last state are 79 MB; some of it may be memory of the warm-up.
    assert 2 * 4 * 32 * 480 * 640 / 2 < at_480 < 130e6
    assert at_960 - at_480 < 130e6  # as many rows again take as much again
