"""Refinements of a transmission: the bilateral filter of eq. 7, the mean of two, and a sky that stays."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.stages.refine import bilateral, mean, sky_kept


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


def test_a_mean_lies_between_and_follows_the_first_in_dense_haze():
    first, second = np.meshgrid(np.linspace(0.02, 1, 9), np.linspace(0.02, 1, 7))
    between = mean(first, second)
    slack = 1e-12  # through logarithm and exponential, float64
    assert (between >= np.minimum(first, second) - slack).all()
    assert (between <= np.maximum(first, second) + slack).all()
    clear, dense = np.full((1, 1), 1.0), np.full((1, 1), 0.02)
    assert mean(clear, dense)[0, 0] == pytest.approx(0.02**0.6)
    assert mean(dense, clear)[0, 0] == pytest.approx(0.02 ** (1 - 0.6 * 0.02))
    np.testing.assert_allclose(mean(first, second, weight=0.0), first)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_a_mean_of_no_light_or_no_haze_is_finite(value):
    t = np.full((1, 3), value, np.float32)
    np.testing.assert_allclose(mean(t, t), max(value, 0.02), rtol=1e-6)  # float32


AIRLIGHT = np.array([0.8, 0.85, 0.9], np.float32)


def test_a_sky_as_bright_as_the_airlight_stays_as_it_is():
    t = np.array([[0.0, 0.05, 0.5, 1.0]], np.float32)
    for brightness in (1.0, 1.2):
        sky = np.broadcast_to(AIRLIGHT * brightness, (1, 4, 3)).astype(np.float32)
        np.testing.assert_array_equal(sky_kept(t, sky, AIRLIGHT), 1)


def test_what_is_darker_by_the_error_keeps_half_the_contrast():
    """Wiener's factor of a signal as strong as the noise."""
    t = np.full((1, 1), 0.02)
    cloud = np.reshape(AIRLIGHT - 0.04 * 0.98, (1, 1, 3)).astype(np.float64)
    assert sky_kept(t, cloud, AIRLIGHT)[0, 0] == pytest.approx(0.04, rel=1e-5)  # an airlight in float32


def test_things_are_left_as_they_are_and_nothing_gets_denser():
    t = np.linspace(0.1, 1, 12).reshape(3, 4)
    things = np.full((3, 4, 3), 0.3)
    kept = sky_kept(t, things, AIRLIGHT)
    assert (kept >= t).all()
    np.testing.assert_allclose(kept, t, rtol=0.006)  # (0.04 / 0.55)²
    np.testing.assert_array_equal(sky_kept(t, things, AIRLIGHT, airlight_error=0.0), t)


def test_a_darker_cloud_never_comes_out_brighter():
    """No rings: what a pixel comes out as falls with what it is."""
    step = np.linspace(0, 0.4, 200)
    sky = np.repeat(AIRLIGHT - step[None, :, None], 5, axis=0)
    t = sky_kept(np.full((5, 200), 0.05), sky, AIRLIGHT)
    assert (np.diff(step[2:-2] / t[2, 2:-2]) >= 0).all()  # at the ends the median sees a step twice


def test_the_sky_between_branches_is_found_and_noise_is_not():
    rng = np.random.default_rng(1)
    sky = np.broadcast_to(AIRLIGHT, (60, 60, 3)) + rng.normal(0, 0.01, (60, 60, 3)).astype(np.float32)
    sky[:, ::10] = 0.3
    t = sky_kept(np.full((60, 60), 0.1, np.float32), sky, AIRLIGHT)
    assert (t[:, 5::10] > 0.9).mean() > 0.95
    cloud = sky_kept(np.full((60, 60), 0.1, np.float32), sky - np.float32(0.1), AIRLIGHT)
    # (1 + 0.04² · 0.9² / 0.1²) t; a median of 25 has 0.25 of the noise of a pixel, here a fortieth of x.
    assert np.median(cloud[:, 5::10]) == pytest.approx(0.113, abs=0.003)


@pytest.mark.parametrize("refine", [mean, lambda t, u: sky_kept(u, np.full((*t.shape, 3), 0.5), AIRLIGHT)])
def test_a_hole_is_refused(refine):
    t = np.full((2, 3), 0.5)
    with pytest.raises(ValueError, match="NaN or infinite at 1 of 6"):
        refine(t, np.where([[True, False, False]] * 1 + [[False] * 3], np.nan, t))
