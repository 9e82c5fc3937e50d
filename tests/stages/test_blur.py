"""How wide the blur is (Hansard 2019, eq. 5–7), and that the diffusion is asked for what it can do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fogpipe.stages.blur import diffusion, scale, scale_power_law, scale_premoze
from fogpipe.stages.medium import fog

RANGES = np.linspace(0, 100, 201).reshape(3, 67)
"""Metres, float64. Figure 2 plots four scattering coefficients over the range, with ν = 0.9 and κa = 0.005 per metre;
the text gives neither their values nor the axis. These span a visibility (2 %) from 39 m to 780 m."""
FIGURE_2 = (0.005, 0.01, 0.04, 0.1)
TINY = 1e-12
"""An offset σ0 that is not there."""


def power_law(scattering: float, ranges: np.ndarray = RANGES) -> np.ndarray:
    return scale_power_law(ranges, np.array(scattering), np.array(100.0), asymmetry=0.9, finest=TINY)


def premoze(absorption: float, scattering: float, ranges: np.ndarray = RANGES) -> np.ndarray:
    return scale_premoze(
        ranges, np.array(absorption), np.array(scattering), np.array(100.0), asymmetry=0.9, finest=TINY
    )


@pytest.mark.parametrize("scattering", FIGURE_2)
def test_equation_5_as_printed(scattering):
    range_map = RANGES[RANGES > 0].reshape(1, -1)
    printed = np.sqrt(0.5 / (2 * 0.005 / (3 * range_map) + 4 / ((1 - 0.9) * scattering * range_map**3)))
    # Ten roundings of a double; σ0 adds its 1e-12 px.
    np.testing.assert_allclose(premoze(0.005, scattering, range_map), printed, rtol=1e-14, atol=2 * TINY)


@pytest.mark.parametrize("scattering", FIGURE_2)
def test_equation_6_is_equation_5_without_absorption(scattering):
    np.testing.assert_allclose(premoze(0, scattering), power_law(scattering), rtol=1e-15, atol=2 * TINY)


@pytest.mark.parametrize("scattering", FIGURE_2)
def test_figure_2_the_approximation_is_close_from_above(scattering):
    full, approximate = premoze(0.005, scattering), power_law(scattering)
    assert (approximate >= full).all()
    # (eq. 5 / eq. 6)² = 1 / (1 + κa (1 − ν) κs R² / 6), and 1 − 1/√(1 + 2a) ≤ a.
    bound = 0.005 * 0.1 * scattering * RANGES**2 / 12
    assert (approximate - full <= bound * approximate + TINY).all()
    assert bound.max() < 0.05  # "satisfactory for rendering purposes": at most 4.2 % at 100 m and κs = 0.1


def test_blur_grows_with_the_power_three_halves_of_range_and_a_half_of_scattering():
    sigma = power_law(0.02, np.array([[10.0, 40.0]]))
    assert sigma[0, 1] / sigma[0, 0] == pytest.approx(8, rel=1e-9)  # σ0 / σ = 1e-11
    assert power_law(0.08)[2, -1] / power_law(0.02)[2, -1] == pytest.approx(2, rel=1e-9)


def test_equation_7_is_equation_6_in_normalised_units():
    # λ = m Rmax √(1 − ν) / (2 √2)
    metres_to_pixels = 20 * 2 * np.sqrt(2) / (np.sqrt(0.1) * 100)
    normalised = scale(RANGES, np.array(0.02), np.array(100.0), strength=20, finest=1.5)
    physical = scale_power_law(
        RANGES, np.array(0.02), np.array(100.0), pixels_per_metre=metres_to_pixels, finest=1.5, asymmetry=0.9
    )
    np.testing.assert_allclose(normalised, physical, rtol=1e-14)  # a few roundings of a double


@pytest.mark.parametrize(("thickness", "albedo", "strength", "largest"), [(0.25, 1, 15, 8.5), (0.5, 0.5, 30, 16)])
def test_the_examples_of_the_paper(thickness, albedo, strength, largest):
    medium = fog(np.array(46.0), optical_thickness=thickness, albedo=albedo)
    range_map = np.array([[0.0, 46.0, 60.0, np.inf, np.nan]], np.float32)
    sigma = scale(range_map, medium.scattering, np.array(46.0), strength=strength)
    # σmax = σ0 + λ √κs' = 1 + 15 · ½ and 1 + 30 · ½; float32.
    np.testing.assert_allclose(sigma, [[1, largest, largest, largest, 1]], rtol=1e-6)


@pytest.mark.parametrize("function", [scale, scale_power_law])
def test_no_scattering_no_blur(function):
    assert (function(RANGES, np.array(0.0), np.array(100.0)) == 1).all()


def test_straight_scattering_does_not_blur():
    assert (scale_premoze(RANGES, np.array(0.1), np.array(0.1), np.array(100.0), asymmetry=1) == 1).all()


@pytest.mark.parametrize("farthest", [np.nan, 0.0])
def test_without_a_measured_range_nothing_is_blurred(farthest):
    range_map = np.array([[np.nan, np.inf, 0.0]])
    assert (scale(range_map, np.array(0.1), np.array(farthest)) == 1).all()


@pytest.mark.parametrize("bad", [-0.1, np.inf, np.nan])
def test_impossible_coefficient_is_refused(bad):
    with pytest.raises(ValueError, match="a coefficient must be a finite number of 0 or more"):
        scale(RANGES, np.array(bad), np.array(100.0))


@given(st.floats(0, 100), st.floats(0, 100), st.floats(0, 10))
def test_what_is_farther_is_blurred_more(near, far, scattering):
    near, far = sorted((near, far))
    sigma = scale(np.array([[near, far]]), np.array(scattering), np.array(100.0))
    assert 1 <= sigma[0, 0] <= sigma[0, 1]


LAYER = np.random.default_rng(5).random((24, 32, 4), dtype=np.float32)


def test_a_blur_that_is_not_there_is_skipped():
    assert "σ0" in diffusion.__stage__.identity_when(np.ones((2, 2)), 1.0, 0.002)
    np.testing.assert_array_equal(diffusion(LAYER, np.full((24, 32), 0.3)), LAYER)
    np.testing.assert_array_equal(diffusion(LAYER, np.full((24, 32), np.nan)), LAYER)


@settings(deadline=None)  # the first call compiles
@given(st.floats(1e-6, 0.1))
def test_a_blur_below_the_tolerance_changes_no_value_by_more(tolerance):
    # The largest scale that is skipped, on the layer that it changes most, a chequerboard of 0 and 1.
    scale = np.full((8, 8), np.sqrt(1 + tolerance / 2 * 0.999))
    board = np.repeat((np.indices((8, 8)).sum(0) % 2)[..., None], 4, axis=2).astype(np.float64)
    assert diffusion.__stage__.identity_when(scale, 1.0, tolerance)
    for solver in ("euler", "invariant"):
        blurred = diffusion(board, scale, solver=solver, tolerance=1e-30)
        assert 0 < np.abs(blurred - board).max() <= tolerance


@pytest.mark.parametrize("solver", ["euler", "invariant"])
@pytest.mark.parametrize("rate", [0.2500001, 1.0, 0.0, -0.1, np.nan])
def test_an_unstable_rate_is_refused(solver, rate):
    with pytest.raises(ValueError, match="at most 1/4"):
        diffusion(LAYER, np.full((24, 32), 3.0), solver=solver, max_rate=rate)


@pytest.mark.parametrize("solver", ["euler", "invariant"])
def test_the_limit_of_stability_is_allowed(solver):
    blurred = diffusion(LAYER, np.full((24, 32), 3.0), solver=solver, max_rate=0.25)
    assert LAYER.min() < blurred.min() < blurred.max() < LAYER.max()


def test_an_infinite_scale_is_refused():
    with pytest.raises(ValueError, match="scale is infinite"):
        diffusion(LAYER, np.full((24, 32), np.inf))


def test_sizes_must_agree():
    with pytest.raises(ValueError, match="scale has 24 × 32 pixels but layer has 32 × 24"):
        diffusion(LAYER, np.ones((32, 24)))
