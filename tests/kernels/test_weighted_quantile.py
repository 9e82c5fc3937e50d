"""A pass of the transmission solver: the paper's median, its minimum, and the histograms that stand in for sorting."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from fogpipe.kernels.bands import set_threads, threads
from fogpipe.kernels.dehazing.binned_quantile import LARGEST_RADIUS, binned
from fogpipe.kernels.dehazing.weighted_quantile import exact

PULL = 2 * 3 / 15  # three channels, λ = 15


def maps(height: int, width: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A depth in steps with noise, a bound below it, and a guide that sees the steps."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:height, :width]
    step = np.where((x // 8 + y // 11) % 2 == 0, -0.4, -1.6)
    log_t = np.minimum(step + rng.normal(0, 0.25, step.shape), 0)
    bound = log_t - rng.uniform(0, 0.5, step.shape)
    guide = 0.4 + 0.2 * (step > -1) + rng.normal(0, 0.02, step.shape)
    return log_t.astype(np.float32), bound.astype(np.float32), guide.astype(np.float32)


def neighbours(log_t, bound, guide, y, x, radius, deviation):
    """What pixel (y, x) may look at, with normalised weights (eq. 13 and 14)."""
    rows, columns = slice(max(0, y - radius), y + radius + 1), slice(max(0, x - radius), x + radius + 1)
    values, weights = (
        log_t[rows, columns].ravel(),
        np.exp(-((guide[rows, columns] - guide[y, x]) ** 2) / 2 / deviation**2),
    )
    kept = values >= bound[y, x]
    weights = weights.ravel()[kept].astype(np.float64)
    return values[kept].astype(np.float64), weights / weights.sum()


def test_a_half_is_the_median_formula_of_the_paper():
    log_t, bound, guide = maps(13, 17)
    got = exact(log_t, bound, guide, PULL, 0.5, 3, 0.1)
    for y, x in ((0, 0), (6, 8), (12, 3), (5, 16)):
        values, weights = neighbours(log_t, bound, guide, y, x, 3, 0.1)
        order = np.argsort(values)
        values, below = values[order], np.concatenate([[0], np.cumsum(weights[order])])
        r = log_t[y, x] + 15 / 6 * ((1 - below) - below)  # eq. 25, with λ/6
        # Rounded to float32 once.
        assert got[y, x] == pytest.approx(np.median(np.concatenate([values, r])), abs=1e-6)


@pytest.mark.parametrize("quantile", [0.2, 0.5, 0.95])
@pytest.mark.parametrize("pull", [0.01, PULL, 8.0])
def test_no_other_value_has_less_energy(quantile, pull):
    log_t, bound, guide = maps(12, 14, seed=1)
    got = exact(log_t, bound, guide, pull, quantile, 4, 0.1)
    for y, x in ((2, 3), (6, 6), (11, 13)):
        values, weights = neighbours(log_t, bound, guide, y, x, 4, 0.1)

        def energy(u, values=values, weights=weights, data=float(log_t[y, x])):
            e = values - u
            return pull / 2 * (u - data) ** 2 + np.sum(
                weights * np.where(e > 0, 2 * quantile * e, 2 * (quantile - 1) * e)
            )

        others = np.linspace(-3, 0, 601)
        assert energy(float(got[y, x])) <= min(map(energy, others)) + 1e-6  # float32


def test_the_top_quantile_of_equal_weights_is_the_dilation_of_the_dark_channel():
    log_t, bound, guide = maps(20, 23)
    got = exact(log_t, bound, guide, 1e-12, 1.0, 3, 1e3)
    np.testing.assert_array_equal(got, grey_dilation(log_t, size=(7, 7), mode="nearest"))


@pytest.mark.parametrize("quantile", [0.5, 0.95])
def test_histograms_come_near_sorting_even_on_noise(quantile):
    log_t, bound, guide = maps(60, 70)
    wanted = np.exp(exact(log_t, bound, guide, PULL, quantile, 15, 0.1))
    got = np.exp(binned(log_t, bound, guide, PULL, quantile, 15, 0.1, 320))
    # Every pixel of D and S is noise here. On photographs it is below 1e-3, see the stage.
    assert np.sqrt(np.mean((got - wanted) ** 2)) < 4e-3


def test_few_values_and_frequent_ones_have_bins_of_their_own():
    """Equal values below and at the bound are told apart, which bins of even width cannot do."""
    log_t, _, guide = maps(60, 70)
    few = (np.rint(20 * log_t) / 20).astype(np.float32)
    frequent = np.where(np.random.default_rng(2).random(log_t.shape) < 0.5, few, log_t).astype(np.float32)
    for values in (few, frequent):
        wanted, got = (f(values, values, guide, PULL, 0.5, 15, 0.1, *n) for f, n in ((exact, ()), (binned, (320,))))
        # The bins of the guide, which is noise here, are left; with even bins it is 0.04 and 0.02.
        assert np.sqrt(np.mean((np.exp(got) - np.exp(wanted)) ** 2)) < 4e-3


@pytest.mark.parametrize("quantile", [0.5, 0.95])
def test_few_neighbours_are_sorted(quantile):
    log_t, bound, guide = maps(30, 35)
    arguments = (log_t, bound, guide, PULL, quantile, 1, 0.1)  # nine neighbours at most
    np.testing.assert_allclose(binned(*arguments, 64), exact(*arguments), atol=1e-6)  # p in float32


def test_more_bins_come_nearer():
    log_t, bound, guide = maps(40, 50)
    wanted = np.exp(exact(log_t, bound, guide, PULL, 0.95, 10, 0.1))
    errors = [np.std(np.exp(binned(log_t, bound, guide, PULL, 0.95, 10, 0.1, n)) - wanted) for n in (16, 64, 256)]
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.parametrize("solver", [exact, lambda *a: binned(*a, 64)])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (4, 5), (30, 40)])
def test_the_bound_holds_and_nothing_is_clearer_than_the_clearest(solver, shape):
    log_t, bound, guide = maps(*shape)
    got = solver(log_t, bound, guide, PULL, 0.95, 6, 0.1)
    assert (got >= bound).all()
    assert got.max() <= log_t.max() + 1e-6  # the last bin ends there, up to rounding


@pytest.mark.parametrize("solver", [exact, lambda *a: binned(*a, 64)])
def test_a_constant_stays(solver):
    flat = np.full((20, 30), -0.7, np.float32)
    got = solver(flat, flat, np.full_like(flat, 0.5), PULL, 0.95, 5, 0.1)
    np.testing.assert_allclose(got, -0.7, atol=1e-4)  # the least width of 64 bins together


def test_one_and_two_threads_give_the_same_bytes():
    log_t, bound, guide = maps(200, 180)
    before = threads()
    try:
        runs = []
        for count in (1, 2):
            set_threads(count)
            runs.append(binned(log_t, bound, guide, PULL, 0.95, 9, 0.1, 32))
    finally:
        set_threads(before)
    assert runs[0].tobytes() == runs[1].tobytes()


def test_a_window_that_overflows_the_counts_is_refused():
    with pytest.raises(ValueError, match=f"more than {LARGEST_RADIUS}"):
        binned(*maps(4, 4), PULL, 0.5, LARGEST_RADIUS + 1, 0.1, 16)
