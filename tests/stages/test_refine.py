"""The bilateral filter of eq. 7: its sum, its fast form, and their difference."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.refine import bilateral


def by_definition(t: np.ndarray, spatial: float, tonal: float) -> np.ndarray:
    """Eq. 7 over the whole image, in float64."""
    y, x = np.mgrid[: t.shape[0], : t.shape[1]]
    smooth = np.empty(t.shape)
    for u in np.ndindex(t.shape):
        weight = np.exp(-((y - u[0]) ** 2 + (x - u[1]) ** 2) / (2 * spatial**2) - (t - t[u]) ** 2 / (2 * tonal**2))
        smooth[u] = (weight * t).sum() / weight.sum()
    return smooth


def labels(kind: str, shape: tuple[int, int] = (60, 90)) -> np.ndarray:
    """Maps of 32 levels, as the labels of a field are."""
    rng = np.random.default_rng(8)
    y, x = np.mgrid[: shape[0], : shape[1]] / max(shape)
    field = {
        "noise": rng.random(shape),
        "ramp": y + 0.0 * x,
        "steps": ((x > 0.4) * 0.6 + (y > 0.3) * 0.4) * 1.0,
        "waves": 0.5 + 0.5 * np.sin(40 * x) * np.sin(25 * y),
    }[kind]
    return np.rint(31 * field / max(field.max(), 1e-9)) / 31


def test_the_exact_solver_is_the_definition():
    t = labels("noise", (20, 26))
    # What lies beyond four deviations weighs 6e-5 of the whole in each direction.
    np.testing.assert_allclose(bilateral(t, solver="exact"), by_definition(t, 3, 0.4), atol=2e-4)


@pytest.mark.parametrize("kind", ["noise", "ramp", "steps", "waves"])
@pytest.mark.parametrize("tolerance", [1e-2, 2e-3, 2e-4])
def test_the_fast_solver_keeps_the_tolerance(kind: str, tolerance: float):
    t = labels(kind)
    difference = bilateral(t, tolerance=tolerance) - bilateral(t, solver="exact")
    assert np.sqrt(np.mean(difference**2)) <= tolerance


@pytest.mark.parametrize("tonal", [0.05, 0.1, 1.0])
@pytest.mark.parametrize("spatial", [0.5, 6.0])
def test_other_widths_keep_it_too(spatial: float, tonal: float):
    t = labels("waves")
    given = {"spatial_deviation": spatial, "tonal_deviation": tonal}
    difference = bilateral(t, **given) - bilateral(t, solver="exact", **given)
    assert np.sqrt(np.mean(difference**2)) <= 2e-3  # the default tolerance


@pytest.mark.parametrize("solver", ["fast", "exact"])
def test_edges_higher_than_the_tonal_deviation_stay(solver):
    t = np.repeat([[0.1] * 20 + [0.9] * 20], 30, axis=0)
    smooth = bilateral(t, solver=solver, tonal_deviation=0.1)
    np.testing.assert_allclose(smooth, t, atol=1e-2)  # e^(−32) by definition; the fast solver has an error


@pytest.mark.parametrize("solver", ["fast", "exact"])
def test_unknown_stays_unknown_and_counts_for_nothing(solver):
    t = np.full((12, 15), 0.4, np.float32)
    t[3:5, 6] = np.nan
    smooth = bilateral(t, solver=solver)
    np.testing.assert_array_equal(np.isnan(smooth), np.isnan(t))
    np.testing.assert_allclose(smooth[~np.isnan(t)], 0.4, rtol=1e-5)  # sums of some hundred float32 products


@pytest.mark.parametrize("solver", ["fast", "exact"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1)])
def test_thin_images(solver, shape):
    t = np.linspace(0, 1, shape[0] * shape[1]).reshape(shape)
    smooth = bilateral(t, solver=solver)
    assert smooth.shape == shape
    assert 0 <= smooth.min() <= smooth.max() <= 1
