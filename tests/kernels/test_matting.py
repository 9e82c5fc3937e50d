"""Laplace's equation in a margin: the exact solution, and how slowly Jacobi sweeps approach it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fogpipe.kernels import bands
from fogpipe.kernels.matting import direct, jacobi


def horizon(margin: int, rows: int = 60, columns: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Scene below a wavy horizon, sky at 1.5 above, and the margin between."""
    noise = np.random.default_rng(8)
    line = 40 + 6 * np.sin(np.arange(columns) / 15)
    height = line[None] - np.arange(rows)[:, None]
    values = np.where(height > 0, 1.5, noise.uniform(0.2, 1, (rows, columns))).astype(np.float32)
    return values, (height > 0) & (height <= margin)


def test_direct_solves_the_equation():
    values, free = horizon(12)
    solution = direct(values.astype(np.float64), free)
    y, x = np.nonzero(free & (np.arange(200) > 0) & (np.arange(200) < 199))
    mean = (solution[y - 1, x] + solution[y + 1, x] + solution[y, x - 1] + solution[y, x + 1]) / 4
    # The first guess is weighted with 1e-10.
    np.testing.assert_allclose(solution[y, x], mean, atol=1e-9)


def test_a_guide_of_one_colour_changes_nothing_and_an_edge_stops_the_flow():
    values, free = horizon(12)
    plain = direct(values, free)
    # The likeness of a colour to itself is 1 + 3e-4 for every neighbour; float32.
    np.testing.assert_allclose(direct(values, free, np.ones((*values.shape, 3))), plain, rtol=1e-6)
    guide = np.zeros((*values.shape, 1))
    guide[free | (values == 1.5)] = 1.0  # the margin has the colour of the sky
    assert direct(values, free, guide)[free].min() > 1.4 > 1 > plain[free].min()


@pytest.mark.parametrize("solve", [direct, lambda values, free: jacobi(values, free, 24)], ids=["direct", "jacobi"])
def test_only_free_pixels_change(solve):
    values, free = horizon(12)
    solution = solve(values, free)
    np.testing.assert_array_equal(solution[~free], values[~free])
    assert (solution[free] < 1.5).any()
    assert solution.min() >= values.min()
    assert solution.max() <= 1.5


def test_jacobi_converges_to_direct():
    values, free = horizon(4)
    values = values.astype(np.float64)
    exact = direct(values, free)
    errors = [np.abs(jacobi(values, free, sweeps) - exact).max() for sweeps in (0, 8, 32, 128, 512)]
    # A strip of width 4 loses cos²(π/10) ≈ 0.90 per sweep along its slowest way; 512 sweeps leave 1e-9 (guess).
    assert all(after < before for before, after in pairwise(errors))
    assert errors[-1] < 1e-8


@pytest.mark.parametrize(("margin", "measured"), [(4, 0.17), (8, 0.24), (12, 0.28)])
def test_the_published_number_of_sweeps_stops_early(margin, measured):
    """After 2µ sweeps from Smax the margin is still far from the solution, in units of Rmax."""
    values, free = horizon(margin)
    exact = direct(values, free)
    rms = [np.sqrt(((jacobi(values, free, s) - exact)[free] ** 2).mean()) for s in (0, 2 * margin, 2 * margin**2)]
    assert rms[1] == pytest.approx(measured, abs=0.02)  # measured figures, two decimals
    # The sweeps that are needed grow with µ²: information walks at random.
    assert rms[2] < 0.1 * rms[0] < rms[1]


def test_a_region_that_borders_nothing_keeps_its_guess():
    values = np.full((5, 5), np.nan)
    values[2, 2] = values[2, 3] = 4.0
    free = np.isfinite(values)
    for solution in (direct(values, free), jacobi(values, free, 5)):
        # One part in 1e10 of the guess decides a direct solve in double precision.
        np.testing.assert_allclose(solution[free], 4, rtol=1e-5)
        np.testing.assert_array_equal(np.isnan(solution), np.isnan(values))


def test_threads_do_not_change_a_bit():
    values, free = horizon(12, rows=80, columns=5000)  # 60 000 free pixels, two bands
    before = bands.threads()
    try:
        results = []
        for count in (1, 2):
            bands.set_threads(count)
            results.append(jacobi(values, free, 6).tobytes())
    finally:
        bands.set_threads(before)
    assert results[0] == results[1]
