"""Extinction, visibility, and the law of Beer and Lambert."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fogpipe.stages.medium import (
    VISIBILITY,
    extinction_from_visibility,
    fog,
    thicken,
    transmission,
    visibility_from_extinction,
)

CONTRAST = {"wmo-5%": 0.05, "koschmieder-2%": 0.02}
NOTHING_MEASURED = np.array(np.nan)


@pytest.mark.parametrize("threshold", CONTRAST)
@given(visibility=st.floats(1e-3, 1e6))
def test_visibility_survives_a_round_trip(threshold, visibility):
    extinction = extinction_from_visibility(visibility, threshold)
    # Two divisions, each rounded by at most half a unit in the last place of a double.
    assert visibility_from_extinction(extinction, threshold) == pytest.approx(visibility, rel=4e-16)


@pytest.mark.parametrize(("threshold", "constant"), [("wmo-5%", 2.996), ("koschmieder-2%", 3.912)])
def test_the_usual_constants(threshold, constant):
    # The constants are printed with three decimals.
    assert extinction_from_visibility(1.0, threshold) == pytest.approx(constant, abs=5e-4)


@pytest.mark.parametrize("threshold", CONTRAST)
def test_contrast_at_the_visibility_is_the_threshold(threshold):
    medium = fog(NOTHING_MEASURED, visibility=80.0, threshold=threshold)
    seen = transmission(np.array([[80.0]]), medium.extinction)
    # Rounding of an exponent near 4 in double precision.
    assert seen[0, 0] == pytest.approx(CONTRAST[threshold], rel=1e-14)


def test_clear_air_has_no_limit_of_visibility():
    assert extinction_from_visibility(math.inf) == 0
    assert visibility_from_extinction(0.0) == math.inf


@pytest.mark.parametrize("visibility", [0.0, -5.0, math.nan])
def test_impossible_visibility_is_refused(visibility):
    with pytest.raises(ValueError, match="visibility must be above 0 m"):
        extinction_from_visibility(visibility)


@pytest.mark.parametrize("extinction", [-1.0, math.nan])
def test_impossible_extinction_is_refused(extinction):
    with pytest.raises(ValueError, match="extinction must be 0 or more"):
        visibility_from_extinction(extinction)


@given(st.floats(1e-3, 1e4), st.floats(0, 20))
def test_optical_thickness_is_that_of_the_farthest_point(farthest, thickness):
    medium = fog(np.array(farthest), optical_thickness=thickness)
    assert float(medium.extinction) * farthest == pytest.approx(thickness, rel=4e-16)  # one division, one product


@pytest.mark.parametrize(
    ("thickness", "albedo", "absorption", "scattering"),
    [(0.25, 0, 0.25, 0), (0.25, 1, 0, 0.25), (0.5, 0.5, 0.25, 0.25)],
)
def test_the_three_examples_of_the_paper(thickness, albedo, absorption, scattering):
    medium = fog(np.array(46.0), optical_thickness=thickness, albedo=albedo)  # SYNS: Rmax = 46 m
    normalised = [float(coefficient) * 46 for coefficient in medium[:3]]
    assert normalised == pytest.approx([absorption, scattering, absorption + scattering], abs=1e-15)


def test_visibility_and_extinction_come_before_the_thickness():
    assert fog(np.array(10.0), extinction=0.3, optical_thickness=7.0).extinction == 0.3
    assert fog(np.array(10.0), visibility=50.0).extinction == extinction_from_visibility(50.0)


@pytest.mark.parametrize("threshold", ["wmo-5%", "koschmieder-2%"])
def test_the_visibility_is_told_however_the_medium_is_given(threshold):
    for amount in ({"extinction": 0.1}, {"optical_thickness": 1.0}, {"visibility": 50.0}, {"weather": "dense-fog"}):
        medium = fog(np.array(10.0), **amount, threshold=threshold)
        assert medium.visibility == pytest.approx(visibility_from_extinction(float(medium.extinction), threshold))
    assert fog(NOTHING_MEASURED, visibility=50.0, threshold=threshold).visibility == pytest.approx(
        50.0
    )  # rounding only
    assert fog(NOTHING_MEASURED, extinction=0.0, threshold=threshold).visibility == np.inf


def test_two_answers_to_one_question_are_refused():
    with pytest.raises(ValueError, match=r"give only one of visibility \(50.0\) and extinction \(0.1\)"):
        fog(np.array(10.0), visibility=50.0, extinction=0.1)


@pytest.mark.parametrize("farthest", [np.nan, 0.0])
def test_thickness_needs_a_distance(farthest):
    with pytest.raises(ValueError, match="set visibility"):
        fog(np.array(farthest))
    assert fog(np.array(farthest), optical_thickness=0.0).extinction == 0
    assert fog(np.array(farthest), extinction=0.1).extinction == 0.1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_transmission_is_the_exponential(dtype):
    range_map = np.linspace(0, 100, 501, dtype=dtype).reshape(3, 167)
    got = transmission(range_map, np.array(0.1))
    exact = np.exp(-0.1 * range_map.astype(np.float64))
    # The exponent, up to 10, is rounded twice (β, and the product), and the exponential to a few units.
    assert got.dtype == dtype
    np.testing.assert_allclose(got, exact, rtol=2 * 10 * np.finfo(dtype).eps / 2 + 4 * np.finfo(dtype).eps)


def test_what_is_unknown_stays_unknown_and_the_sky_is_gone():
    range_map = np.array([[0.0, np.nan, np.inf]], np.float32)
    np.testing.assert_array_equal(transmission(range_map, np.array(0.1)), [[1, np.nan, 0]])
    np.testing.assert_array_equal(transmission(range_map, np.array(0.0)), [[1, np.nan, 1]])
    np.testing.assert_array_equal(transmission(range_map, np.array(1e300)), [[1, np.nan, 0]])


def test_density_scales_the_extinction():
    range_map = np.array([[5.0, 5.0, np.inf, np.inf, np.nan]], np.float32)
    density = np.array([[2.0, 0.0, 1.0, 0.0, 0.0]], np.float32)
    got = transmission(range_map, np.array(0.1), density)
    np.testing.assert_allclose(got, [[math.exp(-1), 1, 0, 1, np.nan]], rtol=1e-6)  # float32


def test_one_is_the_mean_density():
    range_map = np.linspace(0, 60, 12, dtype=np.float32).reshape(3, 4)
    with_density = transmission(range_map, np.array(0.1), np.ones_like(range_map))
    np.testing.assert_array_equal(with_density, transmission(range_map, np.array(0.1)))


@given(st.lists(st.floats(0, 1e6, width=32), min_size=2, max_size=9), st.floats(0, 100))
def test_what_is_farther_is_seen_less(ranges, extinction):
    t = transmission(np.sort(np.array([ranges], np.float32)), np.array(extinction))
    assert (np.diff(t) <= 0).all()
    assert t.min() >= 0
    assert t.max() <= 1


@pytest.mark.parametrize("bad", [-1.0, -np.inf])
def test_negative_range_is_refused(bad):
    with pytest.raises(ValueError, match="range_map is negative at 1 pixels"):
        transmission(np.array([[1.0, bad, np.nan]]), np.array(0.1))


@pytest.mark.parametrize("bad", [-0.1, np.nan])
def test_impossible_coefficient_is_refused(bad):
    with pytest.raises(ValueError, match="extinction must be 0 or more"):
        transmission(np.ones((2, 2)), np.array(bad))


def test_sizes_must_agree():
    with pytest.raises(ValueError, match="density has 2 × 3 pixels but range_map has 3 × 2"):
        transmission(np.ones((2, 3)), np.array(0.1), np.ones((3, 2)))


# Guo 2014, Table 1: visibility in metres and extinction per kilometre at the denser bound of each grade, 2 %.
TABLE_1 = {
    "thick-fog": (50, 78.2),
    "moderate-fog": (200, 19.6),
    "light-fog": (500, 7.82),
    "thin-fog": (1_000, 3.91),
    "haze": (2_000, 1.96),
    "clear": (10_000, 0.391),
    "very-clear": (20_000, 0.196),
    "extremely-clear": (50_000, 0.078),
}
# Tables 2 and 3: λ and the weather that the authors see.
TABLES_2_AND_3 = [
    (0.4, "light-haze"),
    (1.0, "haze"),
    (2.0, "thin-fog"),
    (5.0, "light-fog"),
    (20.0, "thick-fog"),
    (0.6, "light-haze"),
    (1.8, "haze"),
    (4.0, "light-fog"),
    (15.0, "moderate-fog"),
    (25.0, "thick-fog"),
]


@pytest.mark.parametrize("weather", TABLE_1)
def test_the_grades_are_those_of_table_1(weather):
    visibility, per_kilometre = TABLE_1[weather]
    assert VISIBILITY[weather][0] == visibility
    # Three digits are printed, and 3.912/50 km = 0.0782 as 0.078.
    assert 1000 * extinction_from_visibility(visibility, "koschmieder-2%") == pytest.approx(per_kilometre, rel=5e-3)


def test_the_grades_follow_each_other_without_a_gap():
    bounds = list(VISIBILITY.values())
    assert all(denser[1] == clearer[0] for denser, clearer in itertools.pairwise(bounds))


def test_the_clearest_grade_has_the_extinction_of_table_1():
    extinction = fog(NOTHING_MEASURED, weather="extremely-clear", threshold="koschmieder-2%").extinction
    assert 1000 * extinction == pytest.approx(0.0141, rel=2e-3)  # three digits


@pytest.mark.parametrize(("factor", "weather"), TABLES_2_AND_3)
def test_the_factors_of_tables_2_and_3_are_extinctions_per_kilometre(factor, weather):
    nearest, farthest = (extinction_from_visibility(bound, "koschmieder-2%") for bound in VISIBILITY[weather])
    assert 1000 * nearest >= factor >= 1000 * farthest


def test_weather_is_a_visibility_by_name():
    medium = fog(NOTHING_MEASURED, weather="moderate-fog")
    assert medium.extinction == extinction_from_visibility(math.sqrt(200 * 500))
    with pytest.raises(ValueError, match=r"only one of visibility \(100\) and weather \(haze\)"):
        fog(NOTHING_MEASURED, weather="haze", visibility=100)


def test_more_is_always_more_fog():
    t = np.random.default_rng(1).random((6, 7))
    thicker = [thicken(t, factor=factor) for factor in (0, 0.4, 1, 2, 5, 20, 100)]
    assert all((denser <= clearer).all() for clearer, denser in itertools.pairwise(thicker))
    assert (thicker[0] == 1).all()
    assert thicker[-1].min() == 0.1


def test_the_factor_multiplies_the_optical_thickness():
    t = np.exp(-np.linspace(0, 2, 9)).reshape(3, 3)
    # A power of an exponential: a few units in the last place.
    np.testing.assert_allclose(thicken(t, factor=3, floor=0), t**3, rtol=1e-14)
    np.testing.assert_allclose(thicken(t, np.full((3, 3), 2.0), factor=1.5, floor=0), t**3, rtol=1e-14)


@pytest.mark.parametrize("floor", [0.0, 1.0])
@pytest.mark.parametrize("factor", [0.0, 100.0])
def test_extremes_of_the_factor_and_the_floor(factor, floor):
    t = np.array([[0.0, 1e-38, 0.5, 1.0, np.nan]], np.float32)
    thicker = thicken(t, factor=factor, floor=floor)
    assert np.isnan(thicker[0, 4])
    expected = [1.0] * 4 if factor == 0 or floor == 1 else [0, 0, 0, 1]
    np.testing.assert_allclose(thicker[0, :4], expected, atol=1e-30)  # 0.5 to the power of 100


def test_weather_gives_the_factor():
    t = np.array([[0.9, 0.99]])
    factor = 1000 * extinction_from_visibility(math.sqrt(50 * 200), "koschmieder-2%")
    np.testing.assert_array_equal(thicken(t, weather="thick-fog"), thicken(t, factor=factor))
    with pytest.raises(ValueError, match=r"only one of factor \(1\) and weather \(haze\)"):
        thicken(t, weather="haze", factor=1)
