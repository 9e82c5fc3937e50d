"""Airlight of hazy pictures whose airlight is known; a lamp and a white wall are there to fool the estimators."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fogpipe.bench.airlight import ESTIMATORS, EXTRAS, hazy_pictures
from fogpipe.stages import airlight
from fogpipe.stages.metric import airlight_error

STAGES = (airlight.brightest, airlight.dark_channel, airlight.quad_tree, airlight.scribble, airlight.fading)
every_stage = pytest.mark.parametrize("stage", STAGES, ids=lambda stage: stage.__name__)
B = np.array([0.78, 0.80, 0.84], np.float32)


@pytest.fixture(scope="module")
def errors() -> Callable[[str, str], tuple[float, float]]:
    """The largest distance and angle of an estimator over a hazy street, seen in white haze and in brown."""
    pictures = {extra: list(hazy_pictures(["outdoor:4"], extra, (320, 240))) for extra in EXTRAS}

    def errors(way: str, extra: str) -> tuple[float, float]:
        found = [airlight_error(ESTIMATORS[way](image).airlight, truth) for image, truth in pictures[extra]]
        return max(float(e.distance) for e in found), max(float(e.angle) for e in found)

    return errors


# In the thinner haze hills at the horizon keep a transmission of 0.2 and are up to 0.1 from the airlight of the sky.
@pytest.mark.parametrize("extra", EXTRAS)
@pytest.mark.parametrize("way", ["quad tree", "fading", "fading, drawn to grey"])
def test_neither_lamp_nor_wall_moves_the_robust_estimators(errors, way, extra):
    distance, angle = errors(way, extra)
    assert distance < 0.08
    assert angle < 3


def test_a_lamp_fools_the_brightest_pixels_but_not_the_dark_channel(errors):
    assert errors("brightest", "a lamp")[0] > 0.3
    assert errors("dark channel, median", "a lamp")[0] < errors("brightest", "a lamp")[0]


def test_a_wall_fools_every_estimator_that_looks_for_white(errors):
    for way in ("brightest", "dark channel, brightest", "dark channel, median"):
        assert errors(way, "a white wall")[0] > 0.3


def test_each_estimator_in_its_own_words():
    image = np.full((64, 64, 3), 0.2, np.float32)
    image[:32, :32] = B  # haze
    image[40:44, 40:44] = 0.95  # a small lamp
    np.testing.assert_allclose(airlight.brightest(image).airlight, 0.95, rtol=1e-6)
    for found in (airlight.dark_channel(image), airlight.quad_tree(image)):
        np.testing.assert_allclose(found.airlight, B, rtol=1e-6)  # float32 medians


def test_a_scribble_is_the_median_of_what_it_marks():
    image = np.full((50, 60, 3), 0.2, np.float32)
    image[:10] = B
    mask = np.zeros((50, 60), bool)
    mask[2:8, 5:40] = True
    mask[2:14, 7] = True  # a stroke that slipped
    np.testing.assert_allclose(airlight.scribble(image, mask).airlight, B, rtol=1e-6)
    np.testing.assert_allclose(airlight.scribble(image, points=((0.9, 0.9),)).airlight, 0.2, rtol=1e-6)
    np.testing.assert_allclose(airlight.scribble(image).airlight, B, rtol=1e-6)  # the middle of the upper border
    with pytest.raises(ValueError, match="nothing is marked"):
        airlight.scribble(image, points=())


def test_uncertainty_is_the_spread_of_the_colours_in_each_channel():
    rng = np.random.default_rng(3)
    spread = np.array([0.01, 0.03, 0.05])
    image = 0.5 + spread * rng.standard_normal((100, 100, 3))
    found = airlight.scribble(image, np.ones((100, 100), bool))
    np.testing.assert_allclose(found.uncertainty, spread, rtol=0.05)  # 10 000 draws: three standard errors are 3.5 %
    np.testing.assert_allclose(found.airlight, 0.5, atol=0.003)


@every_stage
def test_a_constant_picture_is_its_airlight_without_uncertainty(stage):
    found = stage(np.broadcast_to(B, (40, 50, 3)))
    np.testing.assert_allclose(found.airlight, B, rtol=1e-6)
    np.testing.assert_allclose(found.uncertainty, 0, atol=1e-6)  # float32


@every_stage
@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (3, 2), (7, 500)])
def test_every_size_has_an_airlight(stage, shape):
    found = stage(np.random.default_rng(1).random((*shape, 3)))
    assert found.airlight.shape == found.uncertainty.shape == (3,)
    assert np.isfinite(found.airlight).all()
    assert np.isfinite(found.uncertainty).all()


@every_stage
def test_black_below_black_and_brighter_than_white(stage):
    np.testing.assert_array_equal(stage(np.zeros((30, 30, 3))).airlight, 0)
    np.testing.assert_array_equal(stage(np.full((30, 30, 3), -0.1)).airlight, 0)
    np.testing.assert_allclose(
        stage(np.full((30, 30, 3), 50.0)).airlight, 50, rtol=1e-6
    )  # float32 where OpenCV is used


@every_stage
def test_nan_is_refused(stage):
    with pytest.raises(ValueError, match="NaN or infinite"):
        stage(np.full((5, 5, 3), np.nan))


def test_an_estimate_is_drawn_to_a_greyer_one_that_nearly_agrees():
    tinted = np.array([0.65, 0.62, 0.60], np.float32)
    grey, pale = np.full(3, 0.66, np.float32), np.array([0.66, 0.66, 0.635], np.float32)
    np.testing.assert_allclose(airlight.greyer(tinted, grey), grey, rtol=1e-6)  # float32
    # Saturations of 0.077 and 0.038: half of the way.
    np.testing.assert_allclose(airlight.greyer(tinted, pale), (tinted + pale) / 2, atol=1e-3)


def test_an_estimate_stays_beside_one_that_is_far_away_or_of_more_colour():
    blue = np.array([0.65, 0.72, 0.82], np.float32)
    for other in (np.ones(3), np.array([0.62, 0.72, 0.84]), np.zeros(3)):
        np.testing.assert_array_equal(airlight.greyer(blue, other), blue)
    np.testing.assert_array_equal(airlight.greyer(np.zeros(3), np.zeros(3)), 0)


def test_only_two_finite_colours_can_be_drawn_to_each_other():
    colour = np.full(3, 0.7)
    with pytest.raises(ValueError, match=r"other must be one colour, \(3,\), not of shape \(4, 5, 3\)"):
        airlight.greyer(colour, np.ones((4, 5, 3)))
    with pytest.raises(ValueError, match="NaN or infinite"):
        airlight.greyer(np.full(3, np.nan), colour)


def street_below(sky: np.ndarray) -> np.ndarray:
    """Dark random houses below the upper half of a picture."""
    image = np.broadcast_to(sky, (240, 320, 3)).astype(np.float32)
    image[120:] = np.random.default_rng(2).uniform(0.1, 0.5, (120, 320, 1))
    return image


def test_an_uneven_airlight_follows_the_brightness_of_the_sky():
    light = np.linspace(0.75, 1.02, 320)[None, :, None]
    found = airlight.uneven(street_below(light * B), B)
    assert found.shape == (240, 320, 3)
    # Blurred by a few pixels of a picture half the size, in which the light changes by 0.002 a pixel, and drawn to 1.
    np.testing.assert_allclose(found[:110], np.broadcast_to(light * B, (110, 320, 3)), rtol=0.03)
    brightness = found / B
    np.testing.assert_allclose(brightness, brightness[..., :1].repeat(3, axis=2), rtol=1e-5)  # one colour; float32
    below = brightness[120:, :, 0]
    assert light.min() < below.min() < below[:, 0].mean() < below[:, -1].mean() < light.max()


def test_an_even_sky_is_an_even_airlight():
    noisy = street_below(B + np.random.default_rng(3).normal(0, 0.02, (240, 320, 3)))
    np.testing.assert_allclose(airlight.uneven(noisy, B), np.broadcast_to(B, noisy.shape), rtol=0.01)  # noise


def test_hills_before_the_sky_are_none_of_it():
    image = street_below(B)
    image[80:120] = 0.92 * B  # behind t = 0.1
    np.testing.assert_allclose(airlight.uneven(image, B)[80:120], np.broadcast_to(B, (40, 320, 3)), rtol=0.01)


def test_without_a_sky_the_airlight_stays_one_colour():
    for image in (street_below(np.array([0.3, 0.5, 0.8])), np.zeros((40, 50, 3)), street_below(0.5 * B)):
        np.testing.assert_array_equal(airlight.uneven(image, B), B)
    np.testing.assert_array_equal(airlight.uneven(np.zeros((40, 50, 3)), np.zeros(3)), 0)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (3, 2), (7, 500)])
def test_an_uneven_airlight_of_every_size(shape):
    found = airlight.uneven(np.broadcast_to(B, (*shape, 3)), B)
    np.testing.assert_allclose(found, np.broadcast_to(B, (*shape, 3)), rtol=1e-5)  # float32


def test_only_one_finite_colour_can_be_uneven():
    image = np.ones((4, 5, 3))
    with pytest.raises(ValueError, match=r"airlight must be one colour, \(3,\)"):
        airlight.uneven(image, image)
    with pytest.raises(ValueError, match="NaN or infinite"):
        airlight.uneven(np.full((4, 5, 3), np.nan), B)
