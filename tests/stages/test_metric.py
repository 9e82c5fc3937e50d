"""Scores against what is known by hand: equal pictures, shifts, pure colours, made edges."""

from __future__ import annotations

import numpy as np
import pytest

from fogpipe.kernels.srgb import linear_from_srgb
from fogpipe.stages import metric

RNG = np.random.default_rng(4)
PICTURE = RNG.random((24, 32, 3)).astype(np.float32)


def grey(value: float, shape: tuple[int, int] = (16, 16)) -> np.ndarray:
    return np.full((*shape, 3), value, np.float32)


def test_equal_pictures_are_perfect():
    assert metric.psnr(PICTURE, PICTURE) == np.inf
    assert metric.ssim(PICTURE, PICTURE) == pytest.approx(1)
    assert metric.ciede2000(PICTURE, PICTURE) == 0


def test_psnr_of_a_shift_is_its_formula():
    assert metric.psnr(grey(0.5), grey(0.6), color="srgb") == pytest.approx(20, abs=1e-5)  # float32 values


def test_linear_light_is_scored_as_it_is_displayed():
    light = linear_from_srgb(PICTURE)
    shifted = np.clip(PICTURE + 0.05, 0, 1)
    for score in (metric.psnr, metric.ssim, metric.ciede2000):
        by_display = score(PICTURE, shifted, color="srgb")
        assert score(light, linear_from_srgb(shifted)) == pytest.approx(by_display, rel=1e-4)  # float32 curves


def test_what_no_screen_shows_does_not_count():
    assert metric.psnr(grey(1.5), grey(1.0)) == np.inf
    assert metric.psnr(grey(-0.5), grey(0.0)) == np.inf


@pytest.mark.parametrize("score", [metric.psnr, metric.ssim, metric.ciede2000])
def test_8_bit_integers_are_display_values(score):
    levels = np.rint(PICTURE * 255).astype(np.uint8)
    other = np.rint(np.clip(PICTURE + 0.1, 0, 1) * 255).astype(np.uint8)
    by_floats = score((levels / 255).astype(np.float64), (other / 255).astype(np.float64), color="srgb")
    assert score(levels, other) == pytest.approx(by_floats)


def test_ssim_falls_with_noise_and_is_undefined_below_its_window():
    noisy = [np.clip(PICTURE + RNG.normal(0, s, PICTURE.shape), 0, 1).astype(np.float32) for s in (0.05, 0.2)]
    assert 1 > metric.ssim(noisy[0], PICTURE) > metric.ssim(noisy[1], PICTURE)
    assert np.isnan(metric.ssim(PICTURE[:10], PICTURE[:10]))


def test_ciede2000_of_pure_colours():
    red, green = grey(0.0), grey(0.0)
    red[..., 0] = green[..., 1] = 1
    # 86.6 by Sharma's formula for Lab (53.24, 80.09, 67.20) and (87.73, -86.18, 83.18).
    assert metric.ciede2000(red, green) == pytest.approx(86.6, abs=0.1)
    assert metric.ciede2000(grey(0), grey(1)) == pytest.approx(100, abs=0.01)


def test_transmission_error_is_over_what_is_known():
    t = np.array([[0.5, 0.6, np.nan]], np.float32)
    truth = np.array([[0.4, 0.6, 0.1]], np.float32)
    error = metric.transmission_error(t, truth)
    assert error.root_mean_square == pytest.approx(0.1 / np.sqrt(2), rel=1e-6)
    assert error.bias == pytest.approx(0.05, rel=1e-6)
    assert np.isnan(metric.transmission_error(t * np.nan, truth).root_mean_square)


def test_airlight_error_tells_strength_from_hue():
    white = np.ones(3)
    dimmer = metric.airlight_error(0.8 * white, white)
    assert dimmer.distance == pytest.approx(0.2 * np.sqrt(3))
    assert dimmer.angle == pytest.approx(0, abs=1e-6)  # degrees; of rounded unit vectors
    assert metric.airlight_error(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])).angle == pytest.approx(90)
    assert np.isnan(metric.airlight_error(np.zeros(3), white).angle)


def test_airlight_error_of_a_field_is_its_mean():
    field = np.ones((4, 5, 3))
    field[:2] = 0.5
    assert metric.airlight_error(field, np.ones(3)).distance == pytest.approx(np.sqrt(3) / 4)


def steps(contrast: float) -> np.ndarray:
    """Vertical stripes of 4 pixels, from 0.5 to 0.5·(1 + contrast)."""
    bright = (np.arange(32) // 4 % 2).astype(np.float32)
    return np.broadcast_to((0.5 * (1 + contrast * bright))[None, :, None], (20, 32, 3))


def test_visible_edges_of_restored_contrast():
    found = metric.visible_edges(steps(0.1), steps(0.4), color="srgb")
    assert found.new == 0  # they were visible before
    assert found.gain == pytest.approx(4, rel=1e-5)  # float32 steps
    assert found.saturated == 0


def test_new_visible_edges_are_counted():
    half = np.concatenate([steps(0.02)[:10], steps(0.4)[10:]])  # 2 % in the upper half is below the threshold
    # 7 borders of 2 pixels in 20 rows; in the half, in 10 rows, and 16 + 9 pixels at the new border between the halves.
    before, after = 10 * 14 + 25, 20 * 14
    assert metric.visible_edges(half, steps(0.4), color="srgb").new == pytest.approx((after - before) / before)


def test_an_edge_at_the_threshold():
    # 2 (1 − √(a/b)) = 5 % at b/a = (1 − 0.025)⁻² = 1.0519.
    for factor, visible in ((1.051, False), (1.053, True)):
        found = metric.visible_edges(steps(0.4), steps(factor - 1), color="srgb")
        assert np.isfinite(found.gain) == visible


def test_without_an_edge_the_descriptors_are_undefined():
    found = metric.visible_edges(grey(0.5), grey(0.5))
    assert np.isnan(found.new)
    assert np.isnan(found.gain)
    assert found.saturated == 0


def test_new_black_and_white_is_counted_alike_in_8_bit_and_float():
    before = grey(0.5)
    after = before.copy()
    after[:4] = 0.999  # 254.7 of 255
    after[4:8] = 0.0
    for image, restored in ((before, after), (np.uint8(np.rint(before * 255)), np.uint8(np.rint(after * 255)))):
        assert metric.visible_edges(image, restored, color="srgb").saturated == 0.5
    assert metric.visible_edges(after, after, color="srgb").saturated == 0


@pytest.mark.parametrize("score", [metric.psnr, metric.ssim, metric.ciede2000, metric.visible_edges])
def test_what_cannot_be_scored_is_refused(score):
    with pytest.raises(ValueError, match="NaN or infinite at 3 of"):
        score(np.where(np.arange(32)[None, :, None] + np.arange(24)[:, None, None] == 0, np.nan, PICTURE), PICTURE)
    with pytest.raises(ValueError, match="bring them to the same size"):
        score(PICTURE[:-1], PICTURE)
